"""Probabilities of a frame's numbers by the exact laws of Poisson, read noise, rounding and clipping together."""

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from sensor.config import SensorConfig


def exact_probabilities(mean_e: float, sensor: SensorConfig) -> NDArray[np.float64]:
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


def assert_moments(dn: NDArray[Any], probabilities: NDArray[np.float64]) -> None:
    """Mean and variance lie within 4 standard errors of the exact ones: false-alarm rate 6.3e-5 each."""
    levels = np.arange(probabilities.size)
    mean = probabilities @ levels
    variance, fourth = (probabilities @ (levels - mean) ** power for power in (2, 4))
    n = dn.size
    assert abs(dn.mean() - mean) <= 4 * np.sqrt(variance / n)
    assert abs(dn.astype(float).var() - variance) <= 4 * np.sqrt((fourth - variance**2) / n)
