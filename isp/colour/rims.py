"""Rims of highlights: one edge for all colours, and lamps smaller than the tile without a colour.

Around a saturated place each colour guides itself (eq. (6)), and its edge falls between its own samples: on another
pixel in each colour. A patch of a few pixels then shows the mosaic's tile (docs/decisions/0051-unseen-light.md).
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from isp.planes import BLOCK_ROWS, rows_at
from render.spectrum import Floats
from sensor.cfa import channels, colour_channels
from sensor.raw import RawImage

REACH = 2  # pixels; 1 and 3 leave more colour error
FROM_SIGMAS, FULLY_SIGMAS = 10.0, 20.0  # contrast of the faintest colour, in noise of a sample
FROM_SHARE, FULLY_SHARE = 0.5, 0.8  # contrast of the light over the colours' together: 1 where they rise together
FULL = 0.9  # of saturation, from which on there may be more light than was read
Values = NDArray[np.float32]

TINY_E = 1e-9  # where nothing differs


def even_rims(raw: RawImage, planes: Floats, gains: Floats, alpha: Floats) -> None:
    """Give all channels one share of light and dark where eq. (6) mixes, in place.

    With l and h the least and the most of a channel f up to 2 pixels away along either axis, and c = (h - l) / (h + l),

        t = sum c^2 (f - l) / (h - l) / sum c^2, over the colours, for W is full there;    f' = l + t (h - l).

    A colour that is full nearby isn't lowered. With q the most that all pixels of some 2 x 2 in the window hold, a lamp
    fills 2 x 2 pixels as far as (q - l) / (h - l), the least of the colours', is 1. As far as it doesn't, and the pixel
    is over the dark around, its colour isn't known: it gets the mean of its balanced colours.

    This counts where the faintest colour's h - l is over 20 times the noise of a sample, under 10 times not at all; and
    where the colours rise together, as between red and green they don't: where h - l of the sum of balanced colours is
    over 0.8 of the sum of theirs, under 0.5 not at all.

    Parameters
    ----------
    planes : (h, w, channel) float64
        Of `isp.interleaved.reconstruct` [e-].
    gains : (channel,) float64
        White balance.
    alpha : (h, w) float64
        Of `isp.similarity.guide.saturated_fraction`; a rim is where it is neither 0 nor 1.
    """
    rims = (alpha > 0.0) & (alpha < 1.0)
    if not rims.any():
        return
    names, evened = channels(raw.cfa), []
    colours = [names.index(name) for name in colour_channels(raw.cfa)]
    for first in range(0, len(rims), BLOCK_ROWS):
        columns = np.flatnonzero(rims[first : first + BLOCK_ROWS].any(axis=0))
        if columns.size == 0:
            continue
        at = slice(first, first + BLOCK_ROWS), slice(int(columns[0]), int(columns[-1]) + 1)
        around = _with_surroundings(planes, at)
        window = _extremes(around)
        seen = rims[at] & (_least_contrast(raw, *window[:2], colours) > FROM_SIGMAS)
        if seen.any():
            light = around[..., colours] @ gains[colours, None].astype(np.float32)
            rise = _moving(np.maximum, light, 2 * REACH + 1) - _moving(np.minimum, light, 2 * REACH + 1)
            of_window = [rows_at(x, seen).astype(np.float64) for x in (*window, rise)]
            evened.append((at, seen, _evened(raw, rows_at(planes[at], seen), of_window, gains, colours)))
    for at, seen, values in evened:  # now that no window needs what was there
        planes[at][seen] = values


def _with_surroundings(planes: Floats, at: tuple[slice, slice]) -> Values:
    """Rows and columns of the planes and `REACH` around, the border's pixels again beyond it."""
    rows, columns = (
        np.clip(np.arange(part.start - REACH, min(part.stop, size) + REACH), 0, size - 1)
        for part, size in zip(at, planes.shape, strict=False)
    )
    return np.asarray(planes[rows[0] : rows[-1] + 1].astype(np.float32)[(rows - rows[0])[:, None], columns])


def _extremes(around: Values) -> tuple[Values, Values, Values]:
    """Least, most, and the most that all pixels of some 2 x 2 hold, in windows of 2 `REACH` + 1 pixels a side."""
    size = 2 * REACH + 1
    squares = _moving(np.minimum, around, 2)
    return (
        _moving(np.minimum, squares, size - 1),
        _moving(np.maximum, around, size),
        _moving(np.maximum, squares, size - 1),
    )


def _moving(extreme: np.ufunc, values: Values, size: int) -> Values:
    """Least or most of the windows of `size` pixels a side that lie in an array (h, w, channel)."""
    channel_count = values.shape[2]
    lines = values.reshape(len(values), -1)  # a column further is `channel_count` values further
    for axis, pace in ((0, 1), (1, channel_count)):
        lines = np.moveaxis(lines, axis, 0)
        reach = 1  # pixels of the window so far
        while reach < size:
            step = min(reach, size - reach)
            lines, reach = extreme(lines[: len(lines) - step * pace], lines[step * pace :]), reach + step
        lines = np.moveaxis(lines, 0, axis)
    return lines.reshape(len(lines), -1, channel_count)


def _least_contrast(raw: RawImage, least: NDArray[Any], most: NDArray[Any], colours: list[int]) -> NDArray[Any]:
    """Contrast of the faintest colour, over the noise of a sample in the light."""
    ratios = [
        (most[..., i] - least[..., i]) / np.sqrt(np.maximum(most[..., i], 0.0) + np.float32(raw.dark_noise_e**2))
        for i in colours
    ]
    return np.asarray(np.minimum.reduce(ratios))


def _evened(raw: RawImage, values: Floats, window: list[Floats], gains: Floats, colours: list[int]) -> Floats:
    """Channels of `even_rims`, (pixel, channel), from those of the planes; `window`: l, h, q, and the light's h - l."""
    least, most, filled, rise = window
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

    faintest = _least_contrast(raw, least, most, colours)[:, None]
    much = np.minimum((faintest - FROM_SIGMAS) / (FULLY_SIGMAS - FROM_SIGMAS), 1.0)
    together = rise / (step * gains)[:, colours].sum(axis=1, keepdims=True)
    much *= np.clip((together - FROM_SHARE) / (FULLY_SHARE - FROM_SHARE), 0.0, 1.0)
    return np.asarray(values + much * (evened - values))
