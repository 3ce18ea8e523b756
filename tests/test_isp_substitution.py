"""Luminance substitution: the frame's SNR in closed form, and what replacing the luminance keeps."""

import numpy as np
import pytest

from isp.colour import luminance_of_srgb
from isp.substitution import green_snr, substitute_luminance
from sensor.raw import RawImage


def raw(level_e: float, read_noise_e: float = 3.0) -> RawImage:
    dn = np.full((16, 16), level_e + 100).astype(np.uint16)
    return RawImage(dn, ("RG", "BW"), 100.0, 10_100.0, 1.0, read_noise_e, 4.0, 0.0, 0.01)


def test_frame_snr_is_green_over_the_noise_of_one_sample() -> None:
    estimate = np.full((16, 16, 4), 50.0)
    assert green_snr(raw(50), estimate) == pytest.approx(50 / np.sqrt(50 + 9 + 16 + 1 / 12), rel=1e-12)


def test_negative_green_counts_with_the_dark_noise_alone() -> None:
    estimate = np.full((16, 16, 4), -2.0)
    assert green_snr(raw(0), estimate) == pytest.approx(-2 / np.sqrt(9 + 16 + 1 / 12), rel=1e-12)


def test_saturated_pixels_do_not_count() -> None:
    image = raw(50)
    image.dn[:8] = 10_100
    estimate = np.full((16, 16, 4), 50.0)
    estimate[:8] = 10_000.0
    assert green_snr(image, estimate) == pytest.approx(50 / np.sqrt(50 + 25 + 1 / 12), rel=1e-12)
    assert np.isnan(green_snr(raw(10_000), estimate))


def test_substitution_takes_w_as_luminance_and_keeps_colour_differences() -> None:
    rng = np.random.default_rng(0)
    rgb, white = rng.uniform(0, 1, (6, 6, 3)), rng.uniform(0, 1, (6, 6))
    usable = np.ones((6, 6), bool)
    usable[0] = False
    result = substitute_luminance(rgb, white, usable)
    assert luminance_of_srgb(result[1:]) == pytest.approx(white[1:], abs=1e-12)
    assert result[..., 0] - result[..., 1] == pytest.approx(rgb[..., 0] - rgb[..., 1], abs=1e-12)
    assert np.array_equal(result[0], rgb[0])
