"""Figures that are files: the same bytes each time, text as text, pixels as they are, names apart."""

import re
from base64 import b64decode
from io import BytesIO
from itertools import pairwise

import numpy as np
import pytest
from matplotlib import rc_context
from matplotlib.figure import Figure
from PIL import Image

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
