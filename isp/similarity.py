"""Which band judges similarity, eq. (6), and what distance noise alone gives two equal patches."""

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import convolve1d

from isp.planes import Plane, fill, tent_weights
from sensor.cfa import Tile
from sensor.raw import RawImage


def saturated_fraction(raw: RawImage, patch: int) -> Plane:
    """Alpha of eq. (6): the share of saturated pixels in the patch of h_W around each pixel.

    A pixel of h_W counts as saturated where the W plane, filled from electrons, is at `raw.saturation_e` or above. Only
    pixels inside the frame count. A mosaic without W has 1 everywhere: each band judges itself.

    Returns
    -------
    (h, w) float64
        0 where W alone judges, 1 where the band alone does.
    """
    if "W" not in "".join(raw.cfa):
        return np.ones(raw.shape)
    saturated = np.asarray(fill(raw.electrons, raw.cfa, "W") >= raw.saturation_e, dtype=np.float64)
    inside = np.ones(raw.shape)
    for axis in (0, 1):
        saturated = convolve1d(saturated, np.ones(patch), axis, mode="constant")
        inside = convolve1d(inside, np.ones(patch), axis, mode="constant")
    return saturated / inside  # both are small whole numbers, so 0 and 1 are exact


def noise_distance(tile: Tile, letter: str, patch: int, reach: int) -> NDArray[np.float64]:
    """Expected squared distance of two patches of a plane that holds white noise of unit variance and nothing else.

    With w(u, s) the weight of sample s in the filled pixel u, and C(u, d) = sum_s w(u, s) w(u + d, s),

        B(x, d) = sum_a C(x + a, 0) + C(x + a + d, 0) - 2 C(x + a, d),   a over the patch,

    exact on an endless mosaic, the covariance of overlapping patches included.

    Returns
    -------
    (th, tw, 2 reach + 1, 2 reach + 1) float64
        B by the phase of x in the tile and by the offset d = y - x, rows first.
    """
    covariance = _covariance(tent_weights(tile, letter), reach)
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
            here = weights[:, :, max(row, 0) : size + min(row, 0), max(column, 0) : size + min(column, 0)]
            there = other[:, :, max(-row, 0) : size + min(-row, 0), max(-column, 0) : size + min(-column, 0)]
            covariance[:, :, row + reach, column + reach] = (here * there).sum((2, 3))
    return covariance
