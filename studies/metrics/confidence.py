"""Mean over seeds, and the interval that holds the true mean with a stated confidence."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from rodcone.errors import InputError, require_range

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class SeedMean:
    """Mean of a figure over seeds, and its confidence interval.

    Attributes
    ----------
    mean, low, high : float
        In the figure's own unit; the interval is `low` to `high`.
    count : int
        Number of seeds.
    """

    mean: float
    low: float
    high: float
    count: int


def mean_with_confidence(values: Sequence[float] | NDArray[np.floating], confidence: float = 0.95) -> SeedMean:
    """Mean with Student's interval: mean -+ t s / sqrt(n), t of n - 1 degrees of freedom, s the sample's deviation.

    It is exact for normally distributed figures, and close for means of many pixels, which are nearly normal.

    Parameters
    ----------
    values : (seed,) array_like
        One figure a seed, independent of each other.
    confidence : float
        Share of such intervals that hold the true mean; most papers state 0.95.

    Raises
    ------
    InputError
        For fewer than two values, which have no scatter, or a value that isn't finite.
    """
    require_range("confidence", confidence, 0.01, 0.999999, "give a share: 95 % is 0.95")
    sample = np.asarray(values, dtype=np.float64)
    if sample.ndim != 1 or sample.size < 2:
        raise InputError(f"values: shape {sample.shape} is not allowed; give two seeds or more, one figure each")
    if not np.isfinite(sample).all():
        raise InputError(f"values: {sample[~np.isfinite(sample)][0]} is not allowed; give finite figures")
    half, mean = float(half_width(sample, confidence)), float(sample.mean())
    return SeedMean(mean, mean - half, mean + half, sample.size)


def half_width(samples: Floats, confidence: float = 0.95) -> Floats:
    """Half the width of the mean's interval (Student's t) over the last axis, the seeds; NaN for one seed."""
    count = samples.shape[-1]
    if count == 1:
        return np.full(samples.shape[:-1], np.nan)
    quantile = float(scipy.stats.t.isf((1 - confidence) / 2, count - 1))
    return np.asarray(quantile * samples.std(axis=-1, ddof=1) / np.sqrt(count))
