"""Encodings: Display P3 against colour-science, and what both share."""

import numpy as np
import pytest
from outside_truth import colour_science

from isp.colour.encoding import ENCODINGS, encode
from rodcone.colour_spaces import encode_srgb
from rodcone.errors import InputError

COLOURS = np.random.default_rng(0).uniform(-0.1, 1.2, (40, 3))


def test_srgb_is_the_standards() -> None:
    np.testing.assert_array_equal(encode(COLOURS, "srgb"), encode_srgb(COLOURS))


def test_display_p3_agrees_with_colour_science() -> None:
    spaces = colour_science().RGB_COLOURSPACES
    matrix = colour_science().matrix_RGB_to_RGB(spaces["sRGB"], spaces["Display P3"], None)
    theirs = spaces["Display P3"].cctf_encoding(np.clip(COLOURS @ matrix.T, 0, 1))
    # their sRGB matrix is the standard's, rounded to four digits: 2e-3 in linear light, up to 12.92 times in the dark
    assert np.abs(encode(COLOURS, "display-p3") - theirs).max() < 5e-3


def test_white_grey_and_black_are_the_same_in_both() -> None:
    grey = np.linspace(0, 1, 11)[:, None] * np.ones(3)
    assert encode(grey, "display-p3") == pytest.approx(encode(grey, "srgb"), abs=1e-12)


def test_p3_holds_a_green_that_srgb_clips() -> None:
    green = np.array([-0.2, 1.0, -0.05])
    assert encode(green, "srgb") == pytest.approx([0.0, 1.0, 0.0])
    assert np.all((encode(green, "display-p3") > 0) & (encode(green, "display-p3") < 1))


def test_another_encoding_is_refused() -> None:
    with pytest.raises(InputError, match=r"encoding: 'p3' is unknown; allowed: display-p3, srgb"):
        encode(COLOURS, "p3")
    assert set(ENCODINGS) == {"srgb", "display-p3"}
