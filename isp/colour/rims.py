"""Rims of highlights: one edge for all colours, and lamps smaller than the tile without a colour.

Around a saturated place each colour guides itself (eq. (6)), and its edge falls between its own samples: on another
pixel in each colour. A patch of a few pixels then shows the mosaic's tile (docs/decisions/0051-unseen-light.md).
"""

import numpy as np

from isp.planes import BLOCK_ROWS, rows_at
from render.spectrum import Floats
from sensor.cfa import channels, colour_channels
from sensor.raw import RawImage

REACH = 2  # pixels; 1 and 3 leave more colour error
FROM_SIGMAS, FULLY_SIGMAS = 10.0, 20.0  # contrast of the faintest colour, in noise of a sample
FULL = 0.9  # of saturation, from which on there may be more light than was read
TINY_E = 1e-9  # where nothing differs


def even_rims(raw: RawImage, planes: Floats, gains: Floats, alpha: Floats) -> Floats:
    """Give all channels one share of light and dark where eq. (6) mixes.

    With l and h the least and the most of a channel f up to 2 pixels away along either axis, and c = (h - l) / (h + l),

        t = sum c^2 (f - l) / (h - l) / sum c^2, over the colours, for W is full there;    f' = l + t (h - l).

    A colour that is full nearby isn't lowered. With q the most that all pixels of some 2 x 2 in the window hold, a lamp
    fills 2 x 2 pixels as far as (q - l) / (h - l), the least of the colours', is 1. As far as it doesn't, and the pixel
    is over the dark around, its colour isn't known: it gets the mean of its balanced colours.

    This counts where the faintest colour's h - l is over 20 times the noise of a sample, under 10 times not at all.

    Parameters
    ----------
    planes : (h, w, channel) float64
        Of `isp.interleaved.reconstruct` [e-].
    gains : (channel,) float64
        White balance.
    alpha : (h, w) float64
        Of `isp.similarity.guide.saturated_fraction`; a rim is where it is neither 0 nor 1.

    Returns
    -------
    (h, w, channel) float64
        `planes` itself where there is no rim.
    """
    rims = (alpha > 0.0) & (alpha < 1.0)
    if not rims.any():
        return planes
    names, result = channels(raw.cfa), planes.copy()
    colours = [names.index(name) for name in colour_channels(raw.cfa)]
    for first in range(0, len(rims), BLOCK_ROWS):
        rows = slice(first, first + BLOCK_ROWS)
        columns = np.flatnonzero(rims[rows].any(axis=0))
        if columns.size == 0:
            continue
        at = rows, slice(int(columns[0]), int(columns[-1]) + 1)
        rim, around = rims[at], _with_surroundings(planes, at)
        window = [rows_at(values, rim) for values in (planes[at], *_extremes(around))]
        result[at][rim] = _evened(raw, *window, gains, colours)
    return result


def _with_surroundings(planes: Floats, at: tuple[slice, slice]) -> Floats:
    """Rows and columns of the planes and `REACH` around, the border's pixels again beyond it."""
    rows, columns = (
        np.clip(np.arange(part.start - REACH, min(part.stop, size) + REACH), 0, size - 1)
        for part, size in zip(at, planes.shape, strict=False)
    )
    return planes[rows[:, None], columns]


def _extremes(around: Floats) -> tuple[Floats, Floats, Floats]:
    """Least, most, and the most that all pixels of some 2 x 2 hold, in windows of 2 `REACH` + 1 pixels a side."""
    size = 2 * REACH + 1
    squares = _moving(np.minimum, around, 2)
    return (
        _moving(np.minimum, squares, size - 1),
        _moving(np.maximum, around, size),
        _moving(np.maximum, squares, size - 1),
    )


def _moving(extreme: np.ufunc, values: Floats, size: int) -> Floats:
    """Least or most of the windows of `size` pixels a side that lie in the array."""
    for _ in range(2):  # along the columns, then along the rows
        count = len(values) - size + 1
        values = extreme.reduce([values[i : i + count] for i in range(size)]).swapaxes(0, 1)
    return values


def _evened(
    raw: RawImage, values: Floats, least: Floats, most: Floats, filled: Floats, gains: Floats, colours: list[int]
) -> Floats:
    """Channels of `even_rims`, (pixel, channel), from those of the planes and of their windows."""
    step = np.maximum(most - least, TINY_E)
    # One share for all channels.
    contrast = np.square(step / np.maximum(most + least, TINY_E))[:, colours]
    shares = ((values - least) / step)[:, colours]
    share = np.sum(contrast * shares, axis=1, keepdims=True) / np.maximum(contrast.sum(axis=1, keepdims=True), TINY_E)
    evened = least + share * step
    full = most >= FULL * raw.saturation_e
    full[:, [i for i in range(full.shape[1]) if i not in colours]] = False
    np.maximum(evened, values, out=evened, where=full)

    # No colour where the lamp is smaller than 2 x 2 pixels.
    size = ((filled - least) / step)[:, colours].min(axis=1, keepdims=True)
    above = ((evened - least) / np.maximum(evened + least, TINY_E))[:, colours].max(axis=1, keepdims=True)
    grey = (evened * gains)[:, colours].mean(axis=1, keepdims=True) / gains
    evened += (1.0 - size) * np.square(np.clip(above, 0.0, 1.0)) * (grey - evened)

    noise = np.sqrt(np.maximum(most, 0.0) + raw.dark_noise_e**2)
    faintest = (step / noise)[:, colours].min(axis=1, keepdims=True)
    much = np.clip((faintest - FROM_SIGMAS) / (FULLY_SIGMAS - FROM_SIGMAS), 0.0, 1.0)
    return np.asarray(values + much * (evened - values))
