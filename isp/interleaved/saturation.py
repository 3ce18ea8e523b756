"""Alpha of eq. (6), which chooses the plane that the paper's similarity compares: W's or the channel's own.

alpha(y) = saturated pixels in h_W(y) / all pixels in h_W(y)                                    (6)
"""

import numpy as np
from numpy.typing import NDArray

from isp.planes import box_sums, fill
from rodcone.types import Plane
from sensor.cfa import Tile
from sensor.raw import RawImage

WINDOW = 9  # side [pixels] of the window over which saturated pixels are counted; the paper counts the patch


def saturated_fraction(raw: RawImage, window: int = WINDOW) -> Plane:
    """Compute alpha of eq. (6): the share of saturated pixels in h_W over a window around each pixel.

    A pixel of h_W counts as saturated if any sample from which it is filled is saturated, because between a full sample
    and another one the filled value is too low. Only pixels inside the frame count. For a mosaic without W alpha is 1,
    because each channel is its own guide.

    Returns
    -------
    (h, w) float64
        Alpha: 0 where W alone guides, 1 where the channel alone does.
    """
    return fraction_of_full(raw.saturated, raw.cfa, window)


def fraction_of_full(full: NDArray[np.bool_], tile: Tile, window: int) -> Plane:
    """Compute `saturated_fraction` from the mosaic's saturated samples `full`; both have the shape (h, w)."""
    if "W" not in "".join(tile):
        return np.ones(full.shape)
    alpha = np.zeros(full.shape)
    box = []
    if not full.any():
        return alpha
    # Only the rectangle around full samples is computed, with a margin as wide as a window and the interpolation reach.
    margin = window + 2 * max(len(tile), len(tile[0]))
    for axis, step in enumerate((len(tile), len(tile[0]))):
        lines = np.flatnonzero(full.any(axis=1 - axis))
        box.append(slice(max(int(lines[0]) - margin, 0) // step * step, int(lines[-1]) + margin + 1))
    saturated = fill(full[box[0], box[1]].astype(np.float32), tile, "W") > 0.0
    # Numerator and denominator of eq. (6) are small whole numbers, so that 0 and 1 are exact.
    half = window // 2
    count = box_sums(np.pad(saturated, window // 2).astype(np.uint16), (window, window))
    pixels = [np.arange(size) for size in saturated.shape]
    rows, columns = (np.minimum(line + half, line[-1]) - np.maximum(line - half, 0) + 1 for line in pixels)
    alpha[box[0], box[1]] = count / np.outer(rows, columns)
    return alpha
