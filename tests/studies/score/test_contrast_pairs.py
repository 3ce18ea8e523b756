"""Contrast accuracy written from CDP's published definition another way: exact counts, and Fourier's distributions."""

from dataclasses import replace
from fractions import Fraction
from math import pi

import numpy as np
import pytest
from refusal import refusal
from scipy.stats import norm

import rodcone as public
from scenes.contrast_patches import patch_pairs
from studies.metrics.truth import named_light
from studies.score.contrast import accuracy
from studies.score.contrast_chart import chart_accuracy, pair_accuracy
from studies.score.even_field import even_field
from studies.score.over_light import LUX

EXPOSURE_S = 0.033


def by_definition(bright: list[int], dark: list[int], contrast: Fraction, tolerance: Fraction) -> Fraction:
    """Share of all combinations whose Michelson contrast lies within K (1 - d) and K (1 + d), in whole numbers."""
    low, high = contrast * (1 - tolerance), contrast * (1 + tolerance)
    right = sum(x + y > 0 and low * (x + y) <= x - y <= high * (x + y) for x in bright for y in dark)
    return Fraction(right, len(bright) * len(dark))


@pytest.mark.parametrize(("contrast", "mean"), [((1, 5), 3.0), ((1, 5), 40.0), ((2, 5), 8.0), ((1, 10), 200.0)])
def test_the_share_of_pairs_is_that_of_all_combinations_counted_exactly(contrast: tuple[int, int], mean: float) -> None:
    """Whole readings, many of which lie on a limit; some aren't above 0."""
    rng, share = np.random.default_rng(3), Fraction(*contrast)
    bright, dark = (rng.poisson(mean * (1 + sign * float(share)), 60) - 2 for sign in (1, -1))
    expected = by_definition(bright.tolist(), dark.tolist(), share, Fraction(1, 2))
    assert pair_accuracy(bright, dark, float(share), 0.5) == pytest.approx(float(expected), abs=1e-12)
    assert pair_accuracy(bright.astype(float), dark.astype(float), float(share), 0.5) == pytest.approx(float(expected))


def distribution(mean_e: float, rest_e: float, gain: float, reach: int) -> np.ndarray:
    """Probabilities of whole DN from -reach to reach, by Fourier's integral of the characteristic function.

    Of counts n, Poisson, with normal noise, over the gain: exp(mean (exp(i t / g) - 1) - (t s / g)^2 / 2); a bin as
    wide as a step has sin(t / 2) / (t / 2).
    """
    turn = np.linspace(-8.0, 8.0, 4001)  # where normal noise of 1.6 DN has left e^-80
    seen = np.exp(mean_e * (np.exp(1j * turn / gain) - 1) - (turn * rest_e / gain) ** 2 / 2) * np.sinc(turn / 2 / pi)
    steps = np.arange(-reach, reach + 1)
    return np.array([np.trapezoid(seen * np.exp(-1j * turn * step), turn).real for step in steps]) / (2 * pi)


@pytest.mark.parametrize(("lux", "bits"), [(0.1, None), (1.0, None), (4.0, None), (0.05, 16)])
def test_the_closed_form_is_the_definition_on_distributions_by_fourier(lux: float, bits: int | None) -> None:
    """PRNU of so few electrons adds to the normal noise; pairs are counted on whole DN, with limits as fractions."""
    sensor, reach = public.low_noise(), 150
    if bits is not None:  # steps of a thirteenth of an electron: pairs that read less than one count too
        sensor, reach = replace(sensor, bits=bits, pixel=replace(sensor.pixel, full_well_e=5000.0)), 300
    field = even_field(sensor, named_light("D65"), EXPOSURE_S, "G")
    mean_cd_m2, pixel = lux * 0.18 / pi, sensor.pixel
    sides = []
    for sign in (1.2, 0.8):
        mean_e = sign * mean_cd_m2 * field.electrons_per_cd_m2
        rest_e = np.sqrt(pixel.read_noise_e**2 + pixel.dsnu_e**2 + (pixel.prnu * mean_e) ** 2)
        sides.append(distribution(mean_e, rest_e, sensor.gain_e_per_dn, reach))
    x, y = np.meshgrid(*[np.arange(-reach, reach + 1)] * 2, indexing="ij")
    right = (x + y > 0) & (x + y <= 10 * (x - y)) & (10 * (x - y) <= 3 * (x + y))  # 0.1 and 0.3
    assert [side.sum() for side in sides] == pytest.approx([1.0, 1.0], abs=1e-9)
    assert accuracy(field, mean_cd_m2) == pytest.approx(sides[0] @ right @ sides[1], abs=1e-8)


def chart_picture(side: int, error: float, rng: np.random.Generator) -> np.ndarray:
    """Draw the chart from its pairs, with normal noise in proportion to each row's mean."""
    picture = np.full((side, side), 0.18)
    middles = (np.arange(side) + 0.5) / side
    for pair in patch_pairs():
        rows = np.abs(middles - pair.row) < pair.side / 2
        for column, sign in ((pair.bright_column, 1), (pair.dark_column, -1)):
            inside = np.ix_(rows, np.abs(middles - column) < pair.side / 2)
            noise = error * pair.mean * rng.standard_normal(picture[inside].shape)
            picture[inside] = pair.mean * (1 + sign * pair.contrast) + noise
    return picture


def test_a_picture_of_the_chart_has_the_accuracy_of_normal_noise() -> None:
    """Of noise s over the mean, (x - y) / (x + y) is nearly normal about K with s / 2^1/2 (1 + K^2)^1/2."""
    sharp = chart_accuracy(chart_picture(200, 0.0, np.random.default_rng(1)))
    assert [one.accuracy for one in sharp] == [1.0] * 12
    found = chart_accuracy(chart_picture(600, 0.05, np.random.default_rng(2)))
    for one in found:
        contrast = one.pair.contrast
        spread = 0.05 / np.sqrt(2) * np.sqrt(1 + contrast**2)
        assert one.accuracy == pytest.approx(2 * norm.cdf(contrast / 2 / spread) - 1, abs=0.02)  # 58^2 pixels a patch
    assert [one.pair.contrast for one in found[:3]] == [0.1, 0.2, 0.4]
    assert [one.pair.mean for one in found[::3]] == [0.5, 0.125, 0.03125, 0.0078125]


@pytest.mark.parametrize("shape", [(64, 65), (32, 32), (64, 64, 3)])
def test_a_picture_that_is_not_the_chart_is_refused(shape: tuple[int, ...]) -> None:
    assert "luminance: shape" in refusal(lambda: chart_accuracy(np.zeros(shape)))


def test_light_goes_in_thirds_of_a_decade_from_a_hundredth_of_a_lux_to_ten_thousand() -> None:
    thirds = [(1.0, 2.15, 4.64)[step % 3] * 10.0 ** (step // 3) for step in range(-6, 13)]
    assert pytest.approx(thirds) == LUX
    assert (LUX[0], LUX[-1], len(LUX)) == (0.01, 10_000.0, 19)
