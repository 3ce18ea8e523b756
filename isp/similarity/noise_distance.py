"""The distance that noise alone makes between two patches of the planes h_i."""

from functools import lru_cache

import numpy as np

from isp.planes import Plane, tent_weights
from sensor.cfa import Tile


@lru_cache(maxsize=16)
def noise_distances(tile: Tile, patch: int, reach: int) -> list[Plane]:
    """Expected squared distance of two patches of planes that hold white noise of unit variance and nothing else.

    With w(u, s) the weight of sample s in the filled pixel u, and C(u, d) = sum_s w(u, s) w(u + d, s),

        B(x, d) = sum_a C(x + a, 0) + C(x + a + d, 0) - 2 C(x + a, d),   a over the patch,

    exact on an endless mosaic, the covariance of overlapping patches included.

    Returns
    -------
    list of (th, tw, 2 reach + 1, 2 reach + 1) float64
        For each channel, in the order of `sensor.cfa.channels`: B by the phase of x in the tile and by the offset
        d = y - x, rows first.
    """
    return [_noise_distance(weights, patch, reach) for weights in tent_weights(tile)]


def _noise_distance(weights: Plane, patch: int, reach: int) -> Plane:
    covariance = _covariance(weights, reach)
    variance = covariance[:, :, reach, reach]
    terms = np.empty_like(covariance)
    for row in range(-reach, reach + 1):
        for column in range(-reach, reach + 1):
            other = np.roll(variance, (-row, -column), (0, 1))
            at = (slice(None), slice(None), row + reach, column + reach)
            terms[at] = variance + other - 2.0 * covariance[at]
    half = patch // 2
    steps = range(-half, half + 1)
    rows = sum(np.roll(terms, -step, 0) for step in steps)
    return np.asarray(sum(np.roll(rows, -step, 1) for step in steps))


def _covariance(weights: Plane, reach: int) -> Plane:
    """C(u, d) of `noise_distance` by phase of u and offset d; 0 where the tents don't overlap."""
    size = weights.shape[2]
    covariance = np.zeros((*weights.shape[:2], 2 * reach + 1, 2 * reach + 1))
    overlap = range(-min(size - 1, reach), min(size - 1, reach) + 1)
    for row in overlap:
        for column in overlap:
            # Site k of u's window is site k - d of the window of u + d.
            other = np.roll(weights, (-row, -column), (0, 1))
            at_u = weights[:, :, max(row, 0) : size + min(row, 0), max(column, 0) : size + min(column, 0)]
            at_ud = other[:, :, max(-row, 0) : size + min(-row, 0), max(-column, 0) : size + min(-column, 0)]
            covariance[:, :, row + reach, column + reach] = (at_u * at_ud).sum((2, 3))
    return covariance
