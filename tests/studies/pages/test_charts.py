"""Figures of pages and commands: each line counted once more, by hand or by a closed form."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from matplotlib.axes import Axes

from render.illuminants import illuminant
from render.spectrum import Spectrum
from sensor.emva1288.characterise import Characterisation
from sensor.emva1288.photon_transfer import Transfer
from sensor.presets import low_noise, preset
from studies.metrics.truth import light_of
from studies.pages import design_page, plots
from studies.photograph.snr import channel_e

Drawn = Callable[..., list[Axes]]


@pytest.fixture
def drawn(monkeypatch: pytest.MonkeyPatch) -> Drawn:
    """Axes of what a function draws, in place of its SVG."""
    for module in (plots, design_page):
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
        electrons = channel_e(quiet, light_of("D65"), 1.0, 0.033)[index] * light
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
