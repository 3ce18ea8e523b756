"""The unbiased inverse against the transform's exact mean, by summing over Poisson and integrating over the normal."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from numpy.polynomial.hermite_e import hermegauss
from scipy.stats import poisson

from isp.anscombe import stabilise, stabilise_raw, unstabilise, unstabilise_raw, without_prnu
from sensor.capture import expose
from sensor.device import draw_device
from sensor.presets import preset

NODES, WEIGHTS = hermegauss(60)
WEIGHTS = WEIGHTS / WEIGHTS.sum()


def mean_of_transform(electrons: float, noise_e: float) -> float:
    """E[2 sqrt(max(N + noise + 3/8 + noise_e^2, 0))] for N of this Poisson mean."""
    counts = np.arange(poisson.ppf(1e-14, electrons), poisson.ppf(1 - 1e-14, electrons) + 1)
    inside = counts[:, None] + noise_e * NODES + 0.375 + noise_e**2
    return float(poisson.pmf(counts, electrons) @ (2 * np.sqrt(np.maximum(inside, 0.0)) @ WEIGHTS))


def test_the_mean_comes_back() -> None:
    # The closed form is an approximation, of the Gaussian noise's part above all. A thirtieth of one sample's noise is
    # what averaging a thousand samples leaves: no denoiser here sees the difference.
    for electrons, noise_e in product((0.5, 2.0, 10.0, 100.0, 1000.0), (0.0, 1.5, 5.0, 20.0)):
        error = float(unstabilise(np.array([mean_of_transform(electrons, noise_e)]), noise_e)[0]) - electrons
        assert abs(error) <= np.hypot(np.sqrt(electrons), noise_e) / np.sqrt(1000), (electrons, noise_e)


def test_the_algebraic_inverse_would_be_a_quarter_of_an_electron_low() -> None:
    stable = mean_of_transform(200.0, 0.0)
    assert stable**2 / 4 - 0.375 == pytest.approx(199.75, abs=2e-3)
    # the closed form's own term in 1 / root is still 0.011 e- here, and is most of what it is wrong by
    assert unstabilise(np.array([stable]), 0.0)[0] == pytest.approx(200.0, abs=0.011)


def test_the_transforms_least_value_is_no_light() -> None:
    assert unstabilise(np.array([2 * np.sqrt(0.375), 0.0]), 0.0) == pytest.approx([0.0, 0.0], abs=1e-12)


def test_the_pieces_of_merged_readings_meet_and_rise() -> None:
    sensor = preset("split_pixel")
    device = draw_device(sensor, (4, 4), np.random.default_rng(1))
    raw = expose(np.full((4, 4), 9.0), sensor, 0.01, device, np.random.default_rng(2))
    light = np.geomspace(0.1, 0.9 * raw.full_well_e, 20_001)
    stable = stabilise_raw(light, raw)
    assert (np.diff(stable) > 0).all()
    for step in raw.noise_steps:
        below, above = stabilise_raw(step.from_e * np.array([1 - 1e-9, 1 + 1e-9]), raw)
        assert above - below < 1e-5
    single = stabilise_raw(light.astype(np.float32), raw)
    assert single.dtype == np.float32
    np.testing.assert_allclose(single, stable, atol=2e-3)
    dark = light[light < raw.noise_steps[0].from_e]
    np.testing.assert_array_equal(stable[: dark.size], stabilise(dark, raw.dark_noise_e, raw.prnu))


@pytest.mark.sample(1)
@pytest.mark.parametrize("name", ["dual_gain", "split_pixel", "staggered"])
def test_the_mean_of_merged_readings_comes_back_in_every_range_of_light(name: str) -> None:
    """What a denoiser that averages stabilised samples gives, beside the mean of the samples themselves."""
    sensor, shape = preset(name), (256, 256)
    sensor = replace(sensor, pixel=replace(sensor.pixel, prnu=0.0))
    device = draw_device(sensor, shape, np.random.default_rng(1))
    for light in np.geomspace(20.0, 0.8 * sensor.pixel.full_well_e, 12):
        raw = expose(np.full(shape, light), sensor, 0.01, device, np.random.default_rng([2, int(light)]))
        plain = without_prnu(raw)
        stable = stabilise_raw(raw.electrons, plain)
        at_a_seam = min(abs(raw.electrons.mean() / step.from_e - 1) for step in raw.noise_steps) < 0.1
        # 1.7 % is three standard errors; the steps of the noise are within a third of a decibel, 3.9 %
        assert at_a_seam or abs(stable.std() - 1) < 0.039 + 0.017
        error_e = float(unstabilise_raw(np.array([stable.mean()]), plain)[0]) - raw.electrons.mean()
        assert at_a_seam or abs(error_e) < raw.electrons.std() / np.sqrt(1000)  # as of one reading
    # sample by sample: 3/8 - 1/8 e- before the first step, k / 4 beyond one
    levels = np.geomspace(50.0, 0.9 * raw.full_well_e, 5001)
    back = unstabilise_raw(stabilise_raw(levels, plain), plain)
    most = max(0.25, *(step.shot / 4 for step in plain.noise_steps))
    assert np.abs(back - levels).max() < 1.1 * most
