"""Luminance substitution: the SNR in closed form, the weight over it, and what replacing the luminance keeps."""

import numpy as np
import pytest
from builders import raw_image
from hypothesis import given
from hypothesis import strategies as st
from refusal import refusal

from isp.colour.colour_fit import ColourFit
from isp.substitution import green_snr, matrix_with_white, substitution_weight
from rodcone.colour_spaces import luminance_of_srgb
from sensor.raw import RawImage


def raw(level_e: float, read_noise_e: float = 3.0) -> RawImage:
    return raw_image(np.full((16, 16), level_e + 100), white_dn=10_100.0, read_noise_e=read_noise_e, dsnu_e=4.0)


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


def test_weight_is_a_half_at_the_threshold_and_whole_an_octave_away() -> None:
    assert substitution_weight(4.95, 4.95) == pytest.approx(0.5, abs=1e-12)
    assert [substitution_weight(4.95 * 2.0**x, 4.95) for x in (-3, -1, 1, 3)] == [1.0, 1.0, 0.0, 0.0]
    # smoothstep 3 t^2 - 2 t^3 at t = 3/4 and 1/4
    assert substitution_weight(4.95 * 2**-0.5, 4.95) == pytest.approx(27 / 16 - 27 / 32, abs=1e-12)
    assert substitution_weight(4.95 * 2**0.5, 4.95) == pytest.approx(3 / 16 - 1 / 32, abs=1e-12)


def test_no_light_substitutes_and_a_frame_that_is_all_saturated_does_not() -> None:
    assert substitution_weight(0.0, 4.95) == substitution_weight(-0.3, 4.95) == 1.0
    assert substitution_weight(float("nan"), 4.95) == 0.0
    assert substitution_weight(1e-9, 0.0) == 0.0
    assert substitution_weight(1e9, float("inf")) == 1.0


def test_a_negative_threshold_is_refused() -> None:
    for threshold in (-1.0, float("nan")):
        refusal(substitution_weight, 1.0, threshold, match=r"is not allowed; give 0 or more")


@given(st.floats(0.0, 1.0))
def test_a_plain_matrix_keeps_its_colour_differences_and_takes_w_as_luminance(weight: float) -> None:
    rng = np.random.default_rng(0)
    matrix = rng.uniform(-1.0, 1.0, (3, 3))
    matrix /= matrix.sum(axis=1, keepdims=True)
    balanced = rng.uniform(0.0, 1.0, (50, 4))
    plain = balanced[:, :3] @ matrix.T
    mixed = balanced @ matrix_with_white(ColourFit.of(matrix), np.zeros(4), weight).T
    assert mixed[:, 0] - mixed[:, 1] == pytest.approx(plain[:, 0] - plain[:, 1], abs=1e-12)
    expected = (1 - weight) * luminance_of_srgb(plain) + weight * balanced[:, 3]
    assert luminance_of_srgb(mixed) == pytest.approx(expected, abs=1e-12)


def test_with_a_fit_noise_moves_the_picture_to_w_and_a_neutral_stays_one() -> None:
    fit = ColourFit(tuple("RGBW"), *_moments(np.random.default_rng(1)))
    for noise in (0.0, 1e-4, 1e-2, 1.0):
        levels = np.array([1.0, 0.5, 1.2, 0.05]) * noise
        for weight in (0.0, 0.5, 1.0):
            assert matrix_with_white(fit, levels, weight).sum(axis=1) == pytest.approx(1.0, abs=1e-9)
    share = [
        matrix_with_white(fit, np.array([1.0, 0.5, 1.2, 0.01]) * noise, 0.0)[:, 3].mean() for noise in (0, 1e-3, 1)
    ]
    assert share[0] < share[1] < share[2]
    assert matrix_with_white(fit, np.array([1e6, 1e6, 1e6, 1.0]), 1.0) == pytest.approx(
        np.tile([0, 0, 0, 1.0], (3, 1)), abs=1e-4
    )


def test_colours_are_uncertain_even_without_noise() -> None:
    """So W has a part in the colours, and their differences are amplified less; until decision 0069 neither was so."""
    fit = ColourFit(tuple("RGBW"), *_moments(np.random.default_rng(1)))
    exact, used = fit.matrix("RGBW"), matrix_with_white(fit, np.zeros(4), 0.0)
    assert (used[:, :3] ** 2).sum() < 0.9999 * (exact[:, :3] ** 2).sum()
    assert used == pytest.approx(exact, abs=0.02)


def _moments(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    signals, target = rng.uniform(0, 1, (30, 4)), rng.uniform(0, 1, (30, 3))
    return signals.mean(axis=0), signals.T @ signals / 30, signals.T @ target / 30
