"""Gray World (Buchsbaum 1980): the gains that make a frame's channels alike in the mean."""

import numpy as np
from numpy.typing import NDArray

LEAST_STANDARD_ERRORS = 5.0  # a channel whose mean is less certain than this can't set its own gain


def gray_world(
    means: NDArray[np.float64], standard_errors: NDArray[np.float64], neutral: NDArray[np.float64], green: int
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Gains that make the mean of each channel equal to green's.

    Parameters
    ----------
    means : (channel,) float64
        Of the pipeline's own linear planes over the pixels that count, the unsaturated ones [e-].
    standard_errors : (channel,) float64
        Of each mean [e-].
    neutral : (channel,) float64
        Calibrated response to a neutral, in any unit: serves where a mean is under five standard errors.
    green : int
        Index of the green channel; where it is too dark all gains are the calibrated ones.

    Returns
    -------
    (channel,) float64, (channel,) bool
        Factor on each channel, and whether Gray World set it; `neutral` did where not.
    """
    certain = (means >= LEAST_STANDARD_ERRORS * standard_errors) & (means > 0)
    certain &= bool(certain[green])
    return np.where(certain, means[green] / np.where(certain, means, 1.0), neutral[green] / neutral), certain
