"""Mean and variance of the DNs against the exact moments of Poisson, read noise, rounding and clipping together.

A frame of 512 x 512 pixels is compared within 4 standard errors, which come from the exact second and fourth moments:
each comparison would fail by chance with probability 6.3e-5, all of this file's (144) together with 9e-3 for fresh
keys. The keys are fixed.
"""

import numpy as np
import pytest
from loop import loop
from scipy import stats

from sensor.chip import PixelConfig
from sensor.config import LensConfig, SensorConfig
from sensor.device import Device
from sensor.readout import read_out

SHAPE = (512, 512)
MEANS_E = (0.3, 1.0, 10.0, 24.0, 26.0, 1000.0)  # 24 and 26 lie beside a known fault of another simulator at 25
GAINS = (0.31, 1.7, 4.0)  # electrons per DN: finer than an electron, and coarser


def camera(gain_e_per_dn, read_noise_e, bits=14, black_level_dn=60):
    well_e = gain_e_per_dn * (2**bits - 1 - black_level_dn)
    pixel = PixelConfig(2.2, 0.9, well_e, read_noise_e, dsnu_e=0.0, prnu=0.0)
    return SensorConfig(pixel, LensConfig(2.8), bits=bits, black_level_dn=black_level_dn)


def exact_probabilities(mean_e, sensor):
    """Probability of each DN: counts up to the well, noise, rounding at half DNs, clipping at both ends."""
    well_e, sigma, gain = sensor.pixel.full_well_e, sensor.pixel.read_noise_e, sensor.gain_e_per_dn
    counts = np.arange(stats.poisson.ppf(1e-13, mean_e), stats.poisson.isf(1e-13, mean_e) + 1)
    weights = stats.poisson.pmf(counts, mean_e)
    collected = np.minimum(counts, well_e)
    top = sensor.white_dn
    if sigma == 0:
        dn = np.clip(np.rint(collected / gain + sensor.black_dn), 0, top).astype(int)
        return np.bincount(dn, weights, minlength=top + 1) / weights.sum()
    edges_e = (np.arange(top) + 0.5 - sensor.black_dn) * gain  # under the first edge DN 0, above the last the top
    low, high = collected[0] - 9 * sigma, collected[-1] + 9 * sigma
    near = np.flatnonzero((edges_e > low) & (edges_e < high))
    below = np.zeros(top)  # probability to lie under each edge
    below[edges_e >= high] = 1.0
    below[near] = weights @ stats.norm.cdf((edges_e[near] - collected[:, None]) / sigma) / weights.sum()
    return np.diff(below, prepend=0.0, append=1.0)


def assert_moments(dn, probabilities):
    levels = np.arange(probabilities.size)
    mean = probabilities @ levels
    variance, fourth = (probabilities @ (levels - mean) ** power for power in (2, 4))
    n = dn.size
    assert abs(dn.mean() - mean) <= 4 * np.sqrt(variance / n)
    assert abs(dn.astype(float).var() - variance) <= 4 * np.sqrt((fourth - variance**2) / n)


def frame(mean_e, sensor, seed):
    device = Device(np.ones(SHAPE), np.zeros(SHAPE))
    return read_out(np.full(SHAPE, mean_e), sensor, device, 0.01, np.random.default_rng(seed)).dn


@pytest.mark.sample(10)
@pytest.mark.parametrize("read_noise_e", [0.0, 0.4, 3.0])
@pytest.mark.parametrize("gain_e_per_dn", GAINS)
@pytest.mark.parametrize("mean_e", MEANS_E)
def test_dns_have_the_exact_mean_and_variance(mean_e, gain_e_per_dn, read_noise_e):
    sensor = camera(gain_e_per_dn, read_noise_e)
    seed = int(mean_e * 1000) + int(gain_e_per_dn * 10) + int(read_noise_e * 100_000)
    assert_moments(frame(mean_e, sensor, seed), exact_probabilities(mean_e, sensor))


@loop("mean_e", [0.3, 1.0, 10.0, 24.0])
def test_clipping_at_0_without_a_pedestal_has_its_exact_moments_too(mean_e):
    sensor = camera(1.7, 3.0, black_level_dn=0.0)
    assert_moments(frame(mean_e, sensor, 11), exact_probabilities(mean_e, sensor))


@loop("read_noise_e", [0.0, 3.0])
@loop("mean_e", [90.0, 100.0, 110.0])
def test_a_well_that_clips_in_the_midst_of_the_distribution_has_its_exact_moments(mean_e, read_noise_e):
    pixel = PixelConfig(2.2, 0.9, 100.0, read_noise_e, dsnu_e=0.0, prnu=0.0)
    sensor = SensorConfig(pixel, LensConfig(2.8), bits=10, black_level_dn=60)
    assert_moments(frame(mean_e, sensor, 12), exact_probabilities(mean_e, sensor))
