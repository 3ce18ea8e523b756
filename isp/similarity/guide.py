"""What guides the similarity at each pixel, W or the channel itself (eq. 6), and how far similarity can be trusted."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from isp.planes import BLOCK_ROWS, Plane, box_sums, fill
from isp.settings import WINDOW
from sensor.cfa import Tile
from sensor.raw import RawImage

SMALLEST_VARIANCE = 1e-30  # [e-^2]: no light on a sensor without noise has no SNR
MOST_SNR_SQUARED = 1e15  # far beyond where r is 1; its square fits single precision


def saturated_fraction(raw: RawImage, window: int = WINDOW) -> Plane:
    """Alpha of eq. (6): the share of saturated pixels in h_W around each pixel, over `window` pixels a side.

    A pixel of h_W counts as saturated where any sample that fills it is: between a full sample and another the filled
    value is too low. Only pixels inside the frame count. A mosaic without W has 1 everywhere: each channel is its own
    guide.

    Returns
    -------
    (h, w) float64
        0 where W alone guides, 1 where the channel alone does.
    """
    return fraction_of_full(raw.saturated, raw.cfa, window)


def fraction_of_full(full: NDArray[np.bool_], tile: Tile, window: int = WINDOW) -> Plane:
    """`saturated_fraction` of the mosaic's saturated samples, (h, w)."""
    if "W" not in "".join(tile):
        return np.ones(full.shape)
    alpha, box = np.zeros(full.shape), []
    if not full.any():
        return alpha
    # Around full samples alone: half a window and a tent to reach, and half a window to count the pixels in it.
    margin = window + 2 * max(len(tile), len(tile[0]))
    for axis, step in enumerate((len(tile), len(tile[0]))):
        lines = np.flatnonzero(full.any(axis=1 - axis))
        box.append(slice(max(int(lines[0]) - margin, 0) // step * step, int(lines[-1]) + margin + 1))
    saturated = fill(full[box[0], box[1]].astype(np.float32), tile, "W") > 0.0
    # Saturated pixels in the window over all of its pixels in the frame; small whole numbers: 0 and 1 are exact.
    half, count = window // 2, box_sums(np.pad(saturated, window // 2).astype(np.uint16), (window, window))
    pixels = [np.arange(size) for size in saturated.shape]
    rows, columns = (np.minimum(line + half, line[-1]) - np.maximum(line - half, 0) + 1 for line in pixels)
    alpha[box[0], box[1]] = count / np.outer(rows, columns)
    return alpha


def reliability(light_e: NDArray[Any], dark_noise_e: float, window: int) -> NDArray[Any]:
    """How far similarity can be trusted at each pixel: r of `reliability_of_mean` for the window around it.

    Parameters
    ----------
    light_e : (h, w) float32 or float64
        W's plane, or the mosaic where it has no W [e-].
    dark_noise_e : float
        `RawImage.dark_noise_e` [e-].

    Returns
    -------
    (h, w) of the same type
        0 to 1. Beyond the border the window goes on by reflection, as the patches h_i do.
    """
    padded, result = np.pad(light_e, window // 2, mode="reflect"), np.empty_like(light_e)
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
