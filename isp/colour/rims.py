"""Rims of highlights: one edge for all colours.

Around a saturated place each colour guides itself (eq. (6)), and its edge falls between its own samples: on another
pixel in each colour. A patch of a few pixels then shows the mosaic's tile. There a pixel lies between the light and the
dark of its surroundings by one share for all channels (docs/decisions/0051-light-that-w-does-not-see.md).
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from isp.planes import BLOCK_ROWS, rows_at
from sensor.cfa import channels
from sensor.raw import RawImage

TINY = 1e-9  # of electrons: a plane without contrast keeps its value
REACH = 2  # pixels: of 1, 2 and 3 the best
FULL = 0.9  # of the full well, from which on a colour may be higher than it reads
FROM_SIGMAS, FULLY_SIGMAS = 10.0, 20.0  # contrast of the faintest colour, in noise of a sample


def even_rims(raw: RawImage, planes: NDArray[Any], alpha: NDArray[np.float64]) -> NDArray[Any]:
    """Give all channels one share of light and dark where eq. (6) mixes.

    With l and h the least and the most of channel i up to 2 pixels away along either axis,

        t = sum_j w_j (f_j - l_j) / (h_j - l_j),   w_j ~ ((h_j - l_j) / (h_j + l_j))^2,   f_i' = l_i + t (h_i - l_i),

    j over the colours: W is full there. A colour that is full nearby isn't lowered. Where the faintest colour's contrast h - l is 10 to 20 times the noise of a
    sample, f goes over into f'.

    Parameters
    ----------
    planes : (h, w, channel) array
        Of `isp.interleaved.reconstruct` [e-].
    alpha : (h, w) float64
        Of `isp.similarity.guide.saturated_fraction`; 0 < alpha < 1 is a rim.

    Returns
    -------
    (h, w, channel) of the same type
        `planes` itself where there is no rim.
    """
    rim = (alpha > 0.0) & (alpha < 1.0)
    if not rim.any():
        return planes
    white, result = channels(raw.cfa).index("W"), planes.copy()
    padded = np.pad(planes, ((REACH, REACH), (REACH, REACH), (0, 0)), mode="edge")
    for first in range(0, len(rim), BLOCK_ROWS):
        own = rim[first : first + BLOCK_ROWS]
        columns = np.flatnonzero(own.any(axis=0))
        if columns.size == 0:
            continue
        across = slice(int(columns[0]), int(columns[-1]) + 1)
        own, at = own[:, across], (slice(first, first + BLOCK_ROWS), across)
        around = padded[first : first + len(own) + 2 * REACH, across.start : across.stop + 2 * REACH]
        result[at][own] = _evened(raw, *(rows_at(x, own) for x in (planes[at], *_extremes(around))), white)
    return result


def _extremes(around: NDArray[Any]) -> tuple[NDArray[Any], NDArray[Any]]:
    """Least and most of each channel in windows of 2 `REACH` + 1 pixels a side."""
    results = []
    for extreme in (np.minimum, np.maximum):
        values = around
        for _ in range(2):  # along the rows, then along the columns
            count = len(values) - 2 * REACH
            values = extreme.reduce([values[i : i + count] for i in range(2 * REACH + 1)]).swapaxes(0, 1)
        results.append(values)
    return results[0], results[1]


def _evened(
    raw: RawImage, values: NDArray[Any], least: NDArray[Any], most: NDArray[Any], white: int
) -> NDArray[np.float64]:
    """Channels (pixel, channel) at one share between their least and most, as far as the contrast is beyond noise."""
    step = most - least
    weights = np.square(step / np.maximum(most + least, TINY))
    weights[:, white] = 0.0
    share = np.sum(weights * (values - least) / np.maximum(step, TINY), axis=1) / np.maximum(weights.sum(axis=1), TINY)
    evened = least + share[:, None] * step
    full = most >= FULL * raw.saturation_e
    full[:, white] = False
    np.maximum(evened, values, out=evened, where=full)
    faintest = np.delete(step / np.sqrt(np.maximum(most, 0.0) + raw.dark_noise_e**2), white, axis=1).min(axis=1)
    much = np.clip((faintest - FROM_SIGMAS) / (FULLY_SIGMAS - FROM_SIGMAS), 0.0, 1.0)[:, None]
    return np.asarray(values + much * (evened - values))
