"""Which band judges similarity, eq. (6), and what distance noise alone gives two equal patches."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from isp.planes import BLOCK_ROWS, Plane, box_sums, fill, tent_weights
from isp.settings import WINDOW
from sensor.cfa import Tile
from sensor.raw import RawImage

SMALLEST_VARIANCE = 1e-30  # [e-^2]: no light on a sensor without noise has no SNR
MOST_SNR_SQUARED = 1e15  # far beyond where r is 1; its square fits single precision


def saturated_fraction(raw: RawImage, window: int = WINDOW) -> Plane:
    """Alpha of eq. (6): the share of saturated pixels in h_W around each pixel, over `window` pixels a side.

    A pixel of h_W counts as saturated where any sample that fills it is: between a full sample and another the filled
    value is too low. Only pixels inside the frame count. A mosaic without W has 1 everywhere: each band judges itself.

    Returns
    -------
    (h, w) float64
        0 where W alone judges, 1 where the band alone does.
    """
    if "W" not in "".join(raw.cfa):
        return np.ones(raw.shape)
    full, alpha, box = raw.dn >= saturation_dn(raw), np.zeros(raw.shape), []
    if not full.any():
        return alpha
    # Around full samples alone: half a window and a tent to reach, and half a window to count the pixels in it.
    margin = window + 2 * max(len(raw.cfa), len(raw.cfa[0]))
    for axis, step in enumerate((len(raw.cfa), len(raw.cfa[0]))):
        places = np.flatnonzero(full.any(axis=1 - axis))
        box.append(slice(max(int(places[0]) - margin, 0) // step * step, int(places[-1]) + margin + 1))
    near = full[box[0], box[1]].astype(np.float32)
    alpha[box[0], box[1]] = share_of_saturated(fill(near, raw.cfa, "W") > 0.0, window)
    return alpha


def share_of_saturated(saturated: NDArray[np.bool_], window: int) -> Plane:
    """`saturated_fraction` from the saturated pixels of h_W."""
    padded = np.pad(saturated, window // 2).astype(np.uint16)
    inside = [
        box_sums(np.pad(np.ones((1, size), np.uint16), ((0, 0), (window // 2,) * 2)), (1, window))
        for size in saturated.shape
    ]
    # Small whole numbers: 0 and 1 are exact.
    return np.asarray(box_sums(padded, (window, window)) / np.asarray(inside[0].T * inside[1], dtype=np.float64))


def saturation_dn(raw: RawImage) -> float:
    """Digital number from which a pixel counts as saturated."""
    return raw.saturation_e / raw.gain_e_per_dn + raw.black_dn


def reliability(judging_e: NDArray[Any], dark_noise_e: float, window: int) -> NDArray[Any]:
    """How far similarity can be trusted at each pixel: r of `reliability_of_mean` for the window around it.

    Parameters
    ----------
    judging_e : (h, w) float32 or float64
        W's plane, or the mosaic where it has no W [e-].
    dark_noise_e : float
        `RawImage.dark_noise_e` [e-].

    Returns
    -------
    (h, w) of the same type
        0 to 1. Beyond the border the window goes on by reflection, as the patches h_i do.
    """
    padded, result = np.pad(judging_e, window // 2, mode="reflect"), np.empty_like(judging_e)
    for first in range(0, len(result), BLOCK_ROWS):
        mean_e = box_sums(padded[first : first + BLOCK_ROWS + window - 1], (window, window)) / window**2
        result[first : first + BLOCK_ROWS] = reliability_of_mean(mean_e, dark_noise_e)
    return result


def reliability_of_mean(mean_e: NDArray[Any], dark_noise_e: float) -> NDArray[Any]:
    """The factor r = snr^4 / (1 + snr^4) on the exponent of the similarity weight.

    snr is the mean, 0 or more, over the noise of one sample there, sqrt(mean + dark_noise_e^2). Where it is far under
    1, patches differ by noise alone, and what is left is the distance weight. The fourth power, as the second takes up
    to 0.25 dB at an SNR of 1 to 3 (docs/decisions/0015).
    """
    signal_e = np.asarray(np.maximum(mean_e, 0.0))
    # In place: new memory costs more than what is computed in it.
    result = np.asarray(signal_e + dark_noise_e**2)
    np.maximum(result, SMALLEST_VARIANCE, out=result)
    np.divide(signal_e, result, out=result)
    result *= signal_e
    np.minimum(result, MOST_SNR_SQUARED, out=result)
    np.square(result, out=result)
    np.add(result, 1.0, out=signal_e)
    result /= signal_e
    return result


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
