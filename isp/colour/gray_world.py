"""Gray World (Buchsbaum 1980): the gains that make a frame's channels alike in the mean."""

import numpy as np
from numpy.typing import NDArray

LEAST_STANDARD_ERRORS = 5.0  # a channel whose mean is less certain than this can't set its own gain


def gray_world(
    planes: NDArray[np.float64],
    usable: NDArray[np.bool_],
    standard_errors: NDArray[np.float64],
    neutral: NDArray[np.float64],
    green: int,
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Gains that make the mean of each channel equal to green's.

    Parameters
    ----------
    planes : (h, w, channel) float64
        The pipeline's own linear planes [e-].
    usable : (h, w) bool
        Pixels that count: the unsaturated ones.
    standard_errors : (channel,) float64
        Of each channel's mean [e-].
    neutral : (channel,) float64
        Calibrated response to a neutral, in any unit: serves where a mean is under five standard errors.
    green : int
        Index of the green channel; where it is too dark all gains are the calibrated ones.

    Returns
    -------
    (channel,) float64, (channel,) bool
        Factor on each channel, and whether Gray World set it; `neutral` did where not.
    """
    calibrated = neutral[green] / neutral
    if not usable.any():
        return calibrated, np.zeros(neutral.shape, dtype=bool)
    means = planes[usable].mean(axis=0)
    certain = (means >= LEAST_STANDARD_ERRORS * standard_errors) & (means > 0)
    certain &= bool(certain[green])
    return np.where(certain, means[green] / np.where(certain, means, 1.0), calibrated), certain
