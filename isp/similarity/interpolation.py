"""How far the distance of patches can be trusted where the planes h_i are interpolated.

Between two samples of a channel that differ, a plane holds a value that neither side has. The sample nearest to it wins
all weight, on another side in each colour, and edges get coloured fringes. So the similarity weight is told by how much
its distance may be wrong, and both sides count (docs/decisions/0025).
"""

from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from isp.planes import BLOCK_ROWS, Plane, box_sums, tent_weights
from sensor.cfa import Tile

NOISE_OVER_INTERPOLATION = 9.0  # best of 4.5, 9 and 18: so sigma_s = 3 and V add as variances, sigma_s^2 + V


def certainty(mosaic: NDArray[Any], tile: Tile, patch: int) -> NDArray[Any]:
    """The factor 1 / (1 + V(x) / 9) on the exponent of the similarity weight; parameters as `interpolation_variance`.

    Returns
    -------
    (h, w) of the same type
        0 to 1; 1 where planes aren't interpolated between different samples.
    """
    result = interpolation_variance(mosaic, tile, patch)
    result += NOISE_OVER_INTERPOLATION
    return np.asarray(np.divide(NOISE_OVER_INTERPOLATION, result, out=result))


def interpolation_variance(mosaic: NDArray[Any], tile: Tile, patch: int) -> NDArray[Any]:
    """V(x): the variance of the samples that fill a pixel, mean over the channels, summed over the patch around x.

    Taken from pairs of samples on opposite sides, as good as all of them and less work; less what noise alone makes of
    it.

    Parameters
    ----------
    mosaic : (h, w) float32 or float64
        In units of noise, as `isp.planes.guide_mosaic`; begins at the tile's first phase.
    tile : tuple of str
    patch : int
        Width of the patches.

    Returns
    -------
    (h, w) of the same type
        V(x) [noise variances], 0 or more. Pairs that the border cuts count as noise; patches go on by reflection.

    Notes
    -----
    0 everywhere in `quad_rgbw`, where no pixel lies between two samples of a channel that fill it; in `quad_bayer`
    green alone has pairs. Quads are developed by `isp.kriging` for that (docs/decisions/0048).
    """
    total, (height, width) = np.zeros_like(mosaic), mosaic.shape
    repeats = BLOCK_ROWS // len(tile) + 2, width // len(tile[0]) + 1
    for (row, column), weight in opposite_pairs(tile).items():
        # of half the change, squared
        across, shares = abs(column), np.tile((weight / 4.0).astype(mosaic.dtype), repeats)
        left, right = slice(None, max(width - 2 * across, 0)), slice(2 * across, None)
        before, behind = (left, right) if column >= 0 else (right, left)
        for first in range(row, height - row, BLOCK_ROWS):
            last = min(first + BLOCK_ROWS, height - row)
            change = mosaic[first + row : last + row, behind] - mosaic[first - row : last - row, before]
            change *= change
            change -= 2.0  # the noise of both, of unit variance
            phase, inside = first % len(tile), slice(across, max(width - across, across))
            change *= shares[phase : phase + last - first, :width][:, inside]
            total[first:last, inside] += change
    if patch > 1:
        total = box_sums(np.pad(total, patch // 2, mode="reflect"), (patch, patch))
    return np.asarray(np.maximum(total, 0.0, out=total))


@lru_cache(maxsize=16)
def opposite_pairs(tile: Tile) -> dict[tuple[int, int], Plane]:
    """Sites x + p and x - p that hold the same channel and fill x, by p: the pair's weight in V at each phase of x.

    Returns
    -------
    mapping of (row, column) to (th, tw) float64
        Of p and -p the one with the larger row, or column. The weights of a channel's pairs add up to 1 / channels, or
        to 0 where a pixel is one of its samples and isn't interpolated.
    """
    all_weights, pairs = tent_weights(tile), dict[tuple[int, int], Plane]()
    for weights in all_weights:
        radius = weights.shape[2] // 2
        both = np.where(weights[:, :, ::-1, ::-1] > 0.0, weights, 0.0)
        both[:, :, radius, radius] = 0.0
        total = both.sum((2, 3), keepdims=True) * len(all_weights)
        share = 2.0 * np.divide(both, total, out=np.zeros_like(both), where=total > 0.0)
        for row, column in (np.argwhere(share.any((0, 1))) - radius).tolist():
            if (row, column) > (0, 0):
                weight = share[:, :, row + radius, column + radius]
                pairs[row, column] = pairs[row, column] + weight if (row, column) in pairs else weight
    return pairs
