"""Which band judges similarity, eq. (6), and what distance noise alone gives two equal patches."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from isp.planes import Plane, box_sums, fill, tent_weights
from sensor.cfa import Tile
from sensor.raw import RawImage


def saturated_fraction(raw: RawImage, patch: int) -> Plane:
    """Alpha of eq. (6): the share of saturated pixels in the patch of h_W around each pixel.

    A pixel of h_W counts as saturated where the W plane, filled from digital numbers, is at `raw.saturation_e` or
    above. Only pixels inside the frame count. A mosaic without W has 1 everywhere: each band judges itself.

    Returns
    -------
    (h, w) float64
        0 where W alone judges, 1 where the band alone does.
    """
    if "W" not in "".join(raw.cfa):
        return np.ones(raw.shape)
    return share_of_saturated(fill(raw.dn.astype(np.float32), raw.cfa, "W"), saturation_dn(raw), patch)


def share_of_saturated(white_dn: NDArray[Any], limit_dn: float, patch: int) -> Plane:
    """`saturated_fraction` of a W plane filled from digital numbers."""
    saturated = np.pad(white_dn >= limit_dn, patch // 2).astype(np.uint16)
    inside = [
        box_sums(np.pad(np.ones((1, size), np.uint16), ((0, 0), (patch // 2,) * 2)), (1, patch))
        for size in white_dn.shape
    ]
    # Small whole numbers: 0 and 1 are exact.
    return np.asarray(box_sums(saturated, (patch, patch)) / np.asarray(inside[0].T * inside[1], dtype=np.float64))


def saturation_dn(raw: RawImage) -> float:
    """Digital number from which a pixel counts as saturated."""
    return raw.saturation_e / raw.gain_e_per_dn + raw.black_dn


def reliability(judging_e: NDArray[Any], dark_noise_e: float, patch: int) -> NDArray[Any]:
    """How far similarity can be trusted at each pixel: r of `reliability_of_mean` for the patch around it.

    Parameters
    ----------
    judging_e : (h, w) float32 or float64
        W's plane, or the mosaic where it has no W [e-].
    dark_noise_e : float
        `RawImage.dark_noise_e` [e-].

    Returns
    -------
    (h, w) of the same type
        0 to 1. Beyond the border the patch goes on by reflection, as the patches h_i do.
    """
    mean_e = box_sums(np.pad(judging_e, patch // 2, mode="reflect"), (patch, patch)) / patch**2
    return reliability_of_mean(mean_e, dark_noise_e)


def reliability_of_mean(mean_e: NDArray[Any], dark_noise_e: float) -> NDArray[Any]:
    """The factor r = snr^2 / (1 + snr^2) on the exponent of the similarity weight, of a patch's mean.

    snr is the mean, 0 or more, over the noise of one sample there, sqrt(mean + dark_noise_e^2). Where it is far under
    1, patches differ by noise alone, and what is left is the distance weight.
    """
    signal_e = np.maximum(mean_e, 0.0)
    return np.asarray(signal_e**2 / (signal_e**2 + signal_e + dark_noise_e**2))


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
