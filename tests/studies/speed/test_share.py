"""The share of a render's error in the sensor's noise: known noise on a flat picture, and what is left out."""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from render.radiance import SpectralRadiance
from sensor.presets import low_noise
from studies.speed.points import NoiseReference, electrons, mean_error, share_map, yardstick

sys.path.insert(0, str(Path(__file__).resolve().parents[3] / "benchmarks"))

from bench_share import Shares, own_share_map, shares

NM = np.arange(390.0, 780.0, 20.0)
SIDE, CHANNELS = 96, 4
NOISE_E2 = 100.0
BOUND = 4.4  # standard errors; exceeded once in 100 000


def flat(deviation_e: float, seed: int = 0) -> tuple[NoiseReference, np.ndarray]:
    """Return references with noise of a known deviation around 1000 e-, and the truth."""
    truth = np.full((CHANNELS, SIDE, SIDE), 1000.0)
    noise = np.random.default_rng(seed).normal(0.0, deviation_e, (2, *truth.shape))
    inside = np.ones(truth.shape, dtype=bool)
    return NoiseReference(
        low_noise(), 0.01, (truth + noise[0], truth + noise[1]), np.full_like(truth, NOISE_E2), inside
    ), truth


def test_the_mean_is_the_known_noise_and_bias_whatever_the_references_noise() -> None:
    """Error e of 5 e- and 3 e- of bias: (25 + 9) / 100; the references' 8 e- (0.64) fall out.

    A term has the variance of (e + b - r1)(e + b - r2): with m2 = E(e + b)^2, Var (e + b)^2 + 2 m2 s^2 + s^4.
    """
    e, bias, s = 5.0, 3.0, 8.0
    yard, truth = flat(s)
    image = truth + bias + np.random.default_rng(1).normal(0.0, e, truth.shape)
    share = share_map(image, yard)[:, 1:-1, 1:-1]  # the edge's pixels count again in the pooling
    m2 = e**2 + bias**2
    standard_error = np.sqrt((2 * e**4 + 4 * bias**2 * e**2 + 2 * m2 * s**2 + s**4) / share.size) / NOISE_E2
    assert share.mean() == pytest.approx(m2 / NOISE_E2, abs=BOUND * standard_error)
    own = own_share_map(yard)[:, 1:-1, 1:-1]
    assert own.mean() == pytest.approx(s**2 / NOISE_E2, abs=BOUND * np.sqrt(2 / own.size) * s**2 / NOISE_E2)


def test_each_pixel_s_error_counts_against_its_own_noise() -> None:
    """A bright half whose error is a hundredth of its noise variance, and a dark half without error."""
    yard, truth = flat(0.0)
    yard.noise_e2[..., SIDE // 2 :] = 1e8
    image = truth.copy()
    image[..., SIDE // 2 :] += 1e3
    share = share_map(image, yard)
    assert share.mean() == pytest.approx(0.005, rel=1e-9)
    assert share.max() == pytest.approx(0.01, rel=1e-9)


def test_a_pixel_outside_counts_for_nothing_not_even_beside_it() -> None:
    yard, truth = flat(0.0)
    yard.inside[:, 10, 10] = False
    image = truth + 10.0
    image[:, 10, 10] = 1e9
    share = share_map(image, yard)
    assert np.isnan(share[:, 10, 10]).all()
    assert np.nanmax(np.abs(share - 1.0)) < 1e-12
    assert shares(share, yard.inside) == Shares(*[pytest.approx(1.0)] * 4)
    assert mean_error(image, yard) == pytest.approx((10.0, 1.0))


def test_exposure_noise_and_pixels_come_from_the_sensor() -> None:
    """An even picture is exposed to 80 % of the well in G; a channel over the well counts for nothing."""
    radiance = SpectralRadiance(np.full((4, 4, NM.size), 0.1), NM)
    sensor, lamps = low_noise(), np.zeros((4, 4), dtype=bool)
    lamps[0, 0] = True
    yard = yardstick((radiance, radiance), lamps, sensor)
    red, green, blue, white = electrons(radiance, sensor, yard.exposure_s)
    assert green == pytest.approx(0.8 * sensor.pixel.full_well_e)
    assert yard.inside.any(axis=(1, 2)).tolist() == [
        (plane < sensor.pixel.full_well_e).all() for plane in (red, green, blue, white)
    ]
    assert not yard.inside[:, 0, 0].any()
    pixel = sensor.pixel
    own = 0.8 * pixel.full_well_e
    own += (pixel.prnu * own) ** 2 + pixel.read_noise_e**2 + pixel.fixed_dark_e**2 + sensor.gain_e_per_dn**2 / 12
    assert yard.noise_e2[1] == pytest.approx(own)
    brighter = replace(radiance, values=radiance.values * 1.01)
    share = share_map(electrons(brighter, sensor, yard.exposure_s), yard)[1]
    assert np.nanmax(share) == pytest.approx((0.01 * green[0, 0]) ** 2 / own)
