"""Squared error of a picture, measured against two independent pictures that have no bias."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtrit

from rodcone.types import Floats

BLOCK = 16  # pixels on a side: errors of a denoiser are alike in neighbours
LEAST_BLOCKS = 4  # along the shorter side, smaller where they must be
LEVEL = 0.95


@dataclass(frozen=True)
class MeasuredError:
    """Mean squared error over a frame, its standard error, and the limit that it lies under with `LEVEL`, 0 or more."""

    mean: float
    standard_error: float
    upper: float


def measured_error(
    one: NDArray[np.floating], other: NDArray[np.floating], weight: NDArray[np.floating]
) -> MeasuredError:
    """Weighted mean square of a picture's error over the frame, bias and noise together.

    The mean product of its differences from two pictures is the mean of its squared error, whatever the noise of the
    two: that is independent of the picture's and of each other's, and has no mean. Its standard error is that of blocks
    of pixels, the limit Student's.

    Parameters
    ----------
    one, other : (..., h, w) array
        The picture less each of the two, in a measure that is linear in light.
    weight : (..., h, w) array
        Of each pixel's squared error, 0 where it doesn't count; the mean is over all pixels.

    Returns
    -------
    MeasuredError
        The mean may be negative, since it is an estimate; the limit isn't.
    """
    product = one.astype(np.float64) * other * weight
    planes = product.reshape(-1, *product.shape[-2:]).mean(axis=0)
    side = max(1, min(BLOCK, min(planes.shape) // LEAST_BLOCKS))
    sums, pixels = _block_sums(planes, side).ravel(), _block_sums(np.ones(planes.shape), side).ravel()
    mean = float(sums.sum() / planes.size)
    if sums.size == 1:
        return MeasuredError(mean, np.inf, np.inf)
    # Blocks at the edge are smaller: deviations from the mean of as many pixels.
    spread = float(np.square(sums - mean * pixels).sum())
    error = (spread * sums.size / (sums.size - 1)) ** 0.5 / planes.size
    return MeasuredError(mean, error, max(0.0, mean + float(stdtrit(sums.size - 1, LEVEL)) * error))


def _block_sums(planes: Floats, side: int) -> Floats:
    """Sums over blocks of so many pixels on a side."""
    rows, columns = (np.arange(0, length, side) for length in planes.shape)
    return np.asarray(np.add.reduceat(np.add.reduceat(planes, rows, axis=0), columns, axis=1))
