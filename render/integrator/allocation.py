"""Allocation of samples: how many more a pixel gets than the others, by its noise in a pilot render."""

import numpy as np
import scipy
from numpy.typing import NDArray

from rodcone.types import Floats, Planes

LEAST_SHARE = 4  # largest mean of the rates, so that a pixel of rate 1 gets at least a quarter of the mean samples
MOST_RATE = 64  # largest rate
POOL = 5  # side of the window [pixels] over which the pilot's noise is pooled
UNSEEN = 0.3  # share of the mean weight that every pixel gets, for the noise of rare paths that the pilot missed
FLOOR = 0.01  # share of the mean light that is added everywhere, for a sensor's dark noise
STEPS = 8  # steps from one power of two to the next in the search for the rates' common factor


def rates_of(scattered: Planes, seen: Planes) -> NDArray[np.uint32]:
    """Choose the pixels' rates, which are powers of two from 1 on, shape (h, w).

    A pixel's weight is Monte Carlo variance over mean, of the light group for which this ratio is largest. At every
    level and for every sensor it is proportional to the variance relative to that of shot noise. If samples are
    proportional to the weight's square root, the mean of that ratio over the picture is least.

    Parameters
    ----------
    scattered : (group, set, h, w) float32
        Radiance summed over bands at the scene's own power, without light that is seen directly, from several
        independent sets of samples.
    seen : (group, h, w) float32
        Light that is seen directly.
    """
    weight = np.zeros(seen.shape[1:])
    for sets, lamp in zip(scattered, seen, strict=True):
        variance = scipy.ndimage.uniform_filter(sets.var(axis=0, ddof=1, dtype=np.float64), POOL, mode="nearest")
        light = scipy.ndimage.uniform_filter(sets.mean(axis=0, dtype=np.float64), POOL, mode="nearest")
        floor = FLOOR * light.mean()
        if floor > 0:
            weight = np.maximum(weight, variance / (light + lamp + floor))
    return _powers_of_two(np.sqrt(weight + UNSEEN * weight.mean()))


def _powers_of_two(densities: Floats) -> NDArray[np.uint32]:
    """Round numbers, times a common factor, to powers of two from 1 on.

    The factor is the largest with which the mean of the powers doesn't exceed `LEAST_SHARE`.
    """
    if not densities.any():
        return np.ones(densities.shape, np.uint32)
    logarithm = np.log2(np.maximum(densities / densities.max(), 1e-30))
    most = int(np.log2(MOST_RATE))
    rates = np.ones(densities.shape, np.uint32)
    for shift in np.arange(0, min(most, -logarithm.min()) + 0.5 / STEPS, 1 / STEPS):
        larger = 1 << np.clip(np.floor(logarithm + shift + 0.5), 0, most).astype(np.uint32)
        if larger.mean() > LEAST_SHARE:
            break
        rates = larger
    return rates
