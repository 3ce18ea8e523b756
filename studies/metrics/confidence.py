"""The confidence interval of a mean over seeds."""

import numpy as np
import scipy

from rodcone.types import Floats


def half_width(samples: Floats, confidence: float = 0.95) -> Floats:
    """Return half the width of the mean's confidence interval over the last axis, the seeds; NaN for one seed.

    It is Student's t s / sqrt(n) with n - 1 degrees of freedom, where s is the sample's standard deviation. That is
    exact for normally distributed figures, and close for means of many pixels, which are nearly normal.

    Parameters
    ----------
    samples : (..., seed) float64
        One figure per seed, independent of each other.
    confidence : float
        Share of such intervals that contain the true mean; most papers state 0.95.
    """
    count = samples.shape[-1]
    if count == 1:
        return np.full(samples.shape[:-1], np.nan)
    quantile = -float(scipy.special.stdtrit(count - 1, (1 - confidence) / 2))
    return np.asarray(quantile * samples.std(axis=-1, ddof=1) / np.sqrt(count))
