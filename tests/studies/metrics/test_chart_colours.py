"""Colours of a chart's patches: the transfer curve, pairs, and colours as they are in daylight."""

import numpy as np
import pytest

from rodcone.colour_spaces import WHITE_AT, luminance_of_srgb
from studies.metrics.target_figures import WHITE_PATCH, daylight_delta_e, daylight_srgb, pair_delta_e, true_pair_delta_e


def chart_of(colours: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Picture of a row of two pixels a patch, and its masks."""
    picture = np.repeat(colours[None], 2, axis=0).astype(np.float64)
    masks = np.zeros((len(colours), 2, len(colours)), dtype=bool)
    masks[np.arange(len(colours)), :, np.arange(len(colours))] = True
    return picture, masks


def test_pairs_are_neighbours_and_greys_differ_by_their_lightness() -> None:
    # greys of L* 50 and 51: CIEDE2000 is 1 / S_L, and S_L = 1 + 0.015 x^2 / sqrt(20 + x^2) with x = 50.5 - 50
    def luminance(lightness: float) -> float:
        return ((lightness + 16) / 116) ** 3

    picture, masks = chart_of(np.outer([luminance(50.0), luminance(51.0), 0.3, 0.3], np.ones(3)))
    expected = 1 / (1 + 0.015 * 0.25 / np.sqrt(20.25))
    assert pair_delta_e(picture, masks) == pytest.approx([expected, 0.0], abs=1e-4)


def test_the_chart_in_daylight_has_no_error_and_one_colour_alone_has_a_large_one() -> None:
    picture, masks = chart_of(daylight_srgb())
    assert daylight_delta_e(picture, masks) == pytest.approx(np.zeros(24), abs=1e-9)
    luminances = luminance_of_srgb(daylight_srgb())
    assert luminances[WHITE_PATCH] == pytest.approx(WHITE_AT)
    assert luminances.argmax() == WHITE_PATCH
    grey, _ = chart_of(np.outer(luminances, np.ones(3)))  # the chart under a light of one wavelength, at best
    errors = daylight_delta_e(grey, masks)
    assert errors[18:].max() < 2.0  # its greys stay what they are
    assert 12.0 < errors[:18].mean() < 40.0


def test_true_pairs_are_one_under_d65_and_two_under_other_lights() -> None:
    assert true_pair_delta_e("D65") == pytest.approx(np.zeros(12), abs=1e-6)
    # tests/scenes/test_metamers.py holds each pair's own bounds under these lights
    for light in ("A", "F11", "sodium_high"):
        assert ((true_pair_delta_e(light) > 1.0) & (true_pair_delta_e(light) < 30.0)).all()
