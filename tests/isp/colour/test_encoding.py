"""Encodings: Display P3 against colour-science, and what both share."""

import numpy as np
import pytest
from outside_truth import colour_science

from isp.colour import encoding
from isp.colour.encoding import encode, quantise
from rodcone.colour_spaces import encode_srgb

COLOURS = np.random.default_rng(0).uniform(-0.1, 1.2, (40, 3))


def test_srgb_is_the_standards() -> None:
    np.testing.assert_array_equal(encode(COLOURS, "srgb"), encode_srgb(COLOURS))


def test_display_p3_agrees_with_colour_science() -> None:
    spaces = colour_science().RGB_COLOURSPACES
    matrix = colour_science().matrix_RGB_to_RGB(spaces["sRGB"], spaces["Display P3"], None)
    theirs = spaces["Display P3"].cctf_encoding(np.clip(COLOURS @ matrix.T, 0, 1))
    # their sRGB matrix is the standard's, rounded to four digits: 2e-3 in linear light, up to 12.92 times in the dark
    assert np.abs(encode(COLOURS, "display-p3") - theirs).max() < 5e-3


def test_p3_holds_a_green_that_srgb_clips() -> None:
    green = np.array([-0.2, 1.0, -0.05])
    assert encode(green, "srgb") == pytest.approx([0.0, 1.0, 0.0])
    assert np.all((encode(green, "display-p3") > 0) & (encode(green, "display-p3") < 1))


@pytest.mark.parametrize("name", ["srgb", "display-p3"])
def test_strips_of_rows_are_encoded_and_quantised_as_the_whole_picture(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    linear = np.random.default_rng(1).uniform(-0.1, 1.3, (9, 5, 3))
    assert np.array_equal(encode(linear, name, white=3.0, gain=0.7), encode(linear / 3.0 * 0.7, name))
    whole = encode(linear, name)
    samples = quantise(whole, 16)
    monkeypatch.setattr(encoding, "STRIP_ROWS", 4)
    assert np.array_equal(encode(linear, name), whole)
    assert np.array_equal(quantise(whole, 16), samples)
