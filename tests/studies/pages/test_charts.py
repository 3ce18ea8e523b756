"""Figures of pages and commands: each line counted once more, by hand or by a closed form."""

import re
from base64 import b64decode
from collections.abc import Callable, Mapping
from dataclasses import replace
from html import unescape
from io import BytesIO
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.text import Text
from PIL import Image

from render.illuminants import illuminant
from render.spectrum import Spectrum
from sensor.emva1288.characterise import Characterisation
from sensor.emva1288.photon_transfer import Transfer
from sensor.presets import low_noise, preset
from studies.dataset.judge import MEASURED, Score, judge_page, psnr_chart
from studies.design.expect import ExpectedError
from studies.metrics.truth import named_light
from studies.pages import gain_plot, plots
from studies.pages.plots import (
    CHART,
    LABEL_GAP,
    STYLE,
    blank,
    name_at_ends,
    picture_rows,
    plain_ticks,
    png_bytes,
    svg_text,
)
from studies.photograph.snr import channel_e

Drawn = Callable[..., list[Axes]]


@pytest.fixture
def drawn(monkeypatch: pytest.MonkeyPatch) -> Drawn:
    """Axes of what a function draws, in place of its SVG."""
    for module in (plots, gain_plot):
        monkeypatch.setattr(module, "svg_text", lambda figure: figure)
    return lambda draw, *arguments: draw(*arguments).axes


def curves(axes: Axes) -> Mapping[str, tuple[Any, Any]]:
    """Lines by their label."""
    return {str(line.get_label()): line.get_data() for line in axes.lines}


def test_snr_is_in_decibels_over_light_and_its_mark_at_20(drawn: Drawn) -> None:
    """Without dark noise and patterns SNR^2 is the electrons, but for the rounding of a DN."""
    sensor = low_noise("bayer")
    silent = dict.fromkeys(("read_noise_e", "dsnu_e", "prnu", "dark_current_e_per_s", "column_gain_spread"), 0.0)
    quiet = replace(sensor, pixel=replace(sensor.pixel, **silent, column_offset_e=0.0), bits=16)
    (axes,) = drawn(plots.snr_svg, {"quiet": quiet}, "D65", 0.033, 10.0)
    assert axes.get_title("left") == "SNR of a pixel [dB], D65, 33 ms"
    for index, channel in enumerate("RGB"):
        light, snr_db = curves(axes)[f"quiet {channel}"]
        electrons = channel_e(quiet, named_light("D65"), 1.0, 0.033)[index] * light
        seen = (electrons > 10) & np.isfinite(snr_db)
        assert seen.sum() > 50
        np.testing.assert_allclose(snr_db[seen], 10 * np.log10(electrons[seen]), atol=0.05)
        assert np.isfinite(snr_db).tolist() == (electrons < quiet.pixel.full_well_e).tolist()
    (mark,) = [line for line in axes.lines if len(line.get_xdata()) == 2]
    assert mark.get_ydata() == pytest.approx([20.0, 20.0])


def test_photon_transfer_is_drawn_in_its_units(drawn: Drawn) -> None:
    """A camera of 0.5 DN a photo-electron and a dark variance of 2 DN^2, without chance: points lie on the lines."""
    light_e = np.geomspace(10.0, 10_000.0, 13)
    transfer = Transfer(light_e, 64.0 + 0.5 * light_e, 2.0 + 0.25 * light_e)
    share = np.linspace(-0.01, 0.01, 13)
    chip = Characterisation((), transfer, 64.0, 2.0, 0.5, 5000.0, share, ())
    linear, logarithmic, snr, linearity = drawn(plots.transfer_svg, chip, "a camera")
    for axes, x, y in (
        (linear, 0.5 * light_e, 2.0 + 0.25 * light_e),
        (logarithmic, light_e, np.sqrt(8.0 + light_e)),
        (snr, light_e[light_e <= 5000], 20 * np.log10(light_e / np.sqrt(8.0 + light_e))[light_e <= 5000]),
        (linearity, light_e, 100 * share),
    ):
        (points,) = [line for line in axes.lines if line.get_marker() == "o"]
        np.testing.assert_allclose(points.get_xdata(), x, err_msg=axes.get_title("left"))
        np.testing.assert_allclose(points.get_ydata(), y, err_msg=axes.get_title("left"))
    np.testing.assert_allclose(curves(linear)["slope 0.5 DN/e⁻"], [[0.0, 5000.0], [2.0, 2502.0]])
    e, alone_db = curves(snr)["shot noise alone"]
    np.testing.assert_allclose(alone_db, 10 * np.log10(e))
    np.testing.assert_allclose(curves(snr)["with dark noise"][1], 20 * np.log10(e / np.sqrt(e + 8.0)))
    np.testing.assert_allclose(curves(logarithmic)["dark noise"][1], np.sqrt([8.0, 8.0]))
    e, noise_e = curves(logarithmic)["shot noise, slope ½"]
    np.testing.assert_allclose(noise_e, np.sqrt(e))


def test_spectra_end_at_1_in_their_own_nanometres(drawn: Drawn) -> None:
    """A line of sodium stands in its band of 5 nm; a slope of 1 to 3 keeps its proportions."""
    slope = Spectrum(np.array([380.0, 780.0]), np.array([1.0, 3.0]))
    sodium, linear = drawn(plots.lights_svg, {"sodium_low": illuminant("sodium_low"), "slope": slope})
    nm, values = sodium.lines[0].get_data()
    assert (nm[np.argmax(values)], values.max()) == (587.5, 1.0)
    nm, values = linear.lines[0].get_data()
    np.testing.assert_allclose(values, (1 + (nm - 380) / 200) / (1 + (777.5 - 380) / 200))


def test_charts_over_light_hold_the_lines_that_are_given_and_a_log_scale_where_they_span_20_times() -> None:
    light = np.array([0.1, 1.0, 10.0])
    figure = plots.light_charts(
        light, {"dB": {"A": [20.0, 25.0, 30.0], "B": [-1.0, 0.0, 1.0]}, "e": {"C": [1, 5, 21], "D": [2, 2, 2]}}
    )
    assert [(axes.get_title("left"), axes.get_yscale()) for axes in figure.axes] == [("dB", "linear"), ("e", "log")]
    assert [list(line.get_ydata()) for line in figure.axes[0].lines] == [[20.0, 25.0, 30.0], [-1.0, 0.0, 1.0]]
    assert all(list(line.get_xdata()) == light.tolist() for axes in figure.axes for line in axes.lines)
    ends = {text.get_text(): text.get_position()[1] for text in figure.axes[0].texts}
    assert ends["A"] > ends["B"]


def test_names_of_eight_sensors_stay_on_the_sheet_and_beside_the_lines(drawn: Drawn) -> None:
    (axes,) = drawn(plots.snr_svg, {f"sensor {x}": preset("low_noise") for x in range(8)}, "D65", 0.033, 10.0)
    figure = axes.get_figure()
    figure.draw_without_rendering()
    (legend,) = figure.legends
    box, plot = legend.get_window_extent(), axes.get_window_extent()
    assert box.x0 > plot.x1
    assert plot.height > figure.bbox.height / 2
    assert figure.bbox.containsx(box.x1)
    assert figure.bbox.containsy(box.y0)
    assert len({str(line._dash_pattern) for line in axes.lines[:-1]}) == 8


def test_a_sensors_name_is_no_formula() -> None:
    assert "a$^b$.toml W" in plots.snr_svg({"a$^b$.toml": preset("low_noise")}, "D65", 0.033, 10.0)


# Numbers of the design's and the judge's page, recounted from what they were made of.


LIGHT = (0.1, 10.0)


def errors(psnr_db: tuple[float, float], luminance_db: float, colour: tuple[float, float]) -> list[ExpectedError]:
    made = zip(LIGHT, psnr_db, colour, strict=True)
    return [ExpectedError(light, 0.01, decibels, 0.0, luminance_db, 3.0, x) for light, decibels, x in made]


BY_CAMERA = {
    "bayer": errors((20.0, 30.0), 25.0, (9.0, 5.0)),
    "W/R": errors((21.5, 29.75), 24.5, (8.0, 5.25)),  # ahead in the dark, behind by day, and behind in luminance
    "rgbw": errors((20.5, 29.0), 25.5, (9.5, 5.0)),
}


def cells(html: str) -> list[list[str]]:
    """Text of each table row's cells."""
    rows = re.findall(r"<tr>(.*?)</tr>", html, re.DOTALL)
    return [[unescape(re.sub("<.*?>", "", x)) for x in re.findall(r"<t[hd].*?</t[hd]>", row)] for row in rows]


def test_gains_are_plotted_over_the_first_camera(monkeypatch: pytest.MonkeyPatch) -> None:
    figures: list[Any] = []
    monkeypatch.setattr(gain_plot, "svg_text", lambda figure: figures.append(figure) or "<svg/>")
    gain_plot.gain_svg(BY_CAMERA)
    decibels, colours = [(+1.50, -0.25), (+0.50, -1.00)], [(+1.00, -0.25), (-0.50, +0.00)]  # less error is a gain
    for axes, rows in zip(figures[-1].axes, (decibels, colours), strict=True):
        for line, row in zip(axes.lines[:2], rows, strict=True):
            np.testing.assert_allclose(line.get_xdata(), LIGHT)
            np.testing.assert_allclose(line.get_ydata(), row, atol=1e-9)


def test_every_score_stands_in_table_and_chart_with_its_interval() -> None:
    keys = [metric.key for metric in MEASURED]
    scores = [
        Score("pixel", f"{light}cd/m2", name, light, scenes, dict.fromkeys(keys, mean), dict.fromkeys(keys, half))
        for name, scenes, mean, half in (("mine", 4, 20.25, 0.5), ("expect", 0, 23.5, np.nan))
        for light in LIGHT
    ]
    scores[1].means["psnr_db"] = 30.75
    rows = cells(judge_page({"rodcone": "1", "identity": "2", "name": "mine"}, scores))
    assert rows[0][3:] == [metric.name for metric in MEASURED]
    for row, score in zip(rows[1:], scores, strict=True):
        assert row[1:3] == [score.developer, str(score.scenes or "—")]
        for text, metric in zip(row[3:], MEASURED, strict=True):
            mean, *half = (float(x.replace("−", "-")) for x in text.split(" ± "))
            unit = 0.51 * 10.0**-metric.digits
            assert mean == pytest.approx(score.means[metric.key], abs=unit)
            assert len(half) == (score.scenes > 0)
            assert half == pytest.approx([0.5] * len(half), abs=unit)
    lines = [line for line in psnr_chart(scores).axes[0].lines if len(line.get_xdata()) == len(LIGHT)]
    drawn = {tuple(line.get_ydata()) for line in lines}
    assert {(20.25, 30.75), (23.5, 23.5), (19.75, 30.25), (20.75, 31.25)} <= drawn  # means, and the interval's caps


# Figures that are files: the same bytes each time, text as text, pixels as they are, names apart.


PICTURE = np.random.default_rng(0).random((6, 9, 3))


def chart() -> Figure:
    with rc_context(STYLE):
        figure = blank(*CHART)
        figure.subplots().loglog([1.0, 30.0], [0.02, 5.0])
    plain_ticks(figure.axes[0])
    return figure


@pytest.mark.thorough
def test_the_same_figure_is_the_same_file_however_often_and_in_whichever_order_it_is_written() -> None:
    for make in (chart, lambda: picture_rows([[("a", PICTURE)], [("b", PICTURE)]])):
        first, second = make(), make()
        svg = svg_text(first)
        assert png_bytes(second) == png_bytes(first)
        assert svg_text(first) == svg_text(second) == svg


def test_words_and_pixels_stand_in_the_svg_as_they_are() -> None:
    svg = svg_text(picture_rows([[("W & <b>", PICTURE), ("second", PICTURE[:, :3])]]))
    assert svg.startswith("<svg")
    assert "dc:date" not in svg
    assert "W &amp; &lt;b&gt;" in svg
    coded = [b64decode(found) for found in re.findall(r"base64,([^\"]*)\"", svg)]
    for content, pixels in zip(coded, (PICTURE, PICTURE[:, :3]), strict=True):
        with Image.open(BytesIO(content)) as picture:
            shown = np.asarray(picture.convert("RGB"), dtype=float) / 255
        assert abs(shown - pixels).max() <= 1 / 255
    assert svg.count("image-rendering:pixelated") == 2


def test_ticks_have_no_exponent_and_less_than_two_decades_have_1_2_and_5() -> None:
    svg = svg_text(chart())
    words = re.findall(r"<text[^>]*>([^<]*)</text>", svg)
    assert words == ["1", "2", "5", "10", "20", "0.1", "1"]


def test_names_at_the_ends_of_lines_keep_their_order_and_their_distance() -> None:
    for log in [False, True]:
        figure = blank(*CHART)
        axes = figure.subplots()
        axes.set(ylim=(1.0, 100.0), yscale="log" if log else "linear")
        name_at_ends(axes, [("low", 50.0, "black"), ("high", 51.0, "black"), ("far", 1.0, "black")])
        figure.draw_without_rendering()
        heights = {text.get_text(): text.get_window_extent().y0 for text in axes.texts}
        assert sorted(heights, key=lambda name: heights[name]) == ["far", "low", "high"], log
        points = [height * 72 / figure.dpi for height in sorted(heights.values())]
        assert min(high - low for low, high in pairwise(points)) >= 0.9 * LABEL_GAP, log


def test_titles_of_neighbouring_pictures_do_not_print_over_each_other() -> None:
    long = "table1_output: the default, W's luminance, 5ms"
    figure = picture_rows([[(long, PICTURE), (long, PICTURE)], [("short", PICTURE), (long, PICTURE)]])
    svg_text(figure)  # lays it out
    renderer = FigureCanvasAgg(figure).get_renderer()
    titles = [max(axes.findobj(Text), key=lambda text: len(text.get_text())) for axes in figure.axes]
    boxes = [title.get_window_extent(renderer) for title in titles]
    pictures = [axes.get_window_extent(renderer) for axes in figure.axes]
    assert all(box.x1 <= picture.x1 + 8 for box, picture in zip(boxes, pictures, strict=True))
    assert not any(box.overlaps(other) for box in boxes for other in [*pictures, *boxes] if other is not box)
