"""Neutral highlights: colours are limited where one of them is full, and small full lamps become white.

A full sample is a lower bound of the light. Within a wide highlight, samples of every colour show its hue. A lamp of a
few pixels, however, may cover samples of only some colours. The planes of the other colours are then filled from the
dark around the lamp, so that it would get the colour of the samples that it happens to cover. Therefore a full pixel
becomes white, unless a sample of its lamp shows a colour. A sample belongs to the lamp if it is lit, or if it lies in a
rectangle with lit samples at two opposite corners that are at most a tile's side apart along either axis. In this way
the dark blue sites of a sodium lamp of 2x2 pixels belong to the lamp.
"""

from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

from isp.planes import box_sums, rows_at
from sensor.cfa import channel_map, mask
from sensor.raw import RawImage

# Limits as shares of `highlight_level`.
LIT = 0.25  # a brighter sample belongs to a lamp; samples beside a sharp lamp and in its halo are darker
FULL = 0.97  # a brighter sample counts as full, because shot noise and unequal gains may shift it by the rest


def saturated_nearby(raw: RawImage, channels: str, reach: int | None = None) -> NDArray[np.bool_]:
    """Mark pixels with a saturated sample of one of `channels` within `reach` pixels along either axis, (h, w).

    By default the reach is one pixel less than the tile's side.
    """
    return _nearby(raw.saturated & mask(raw.cfa, channels, raw.shape), _tile_side(raw) - 1 if reach is None else reach)


def highlight_level(raw: RawImage, gains: NDArray[np.float64]) -> float:
    """Return the balanced electrons at which the first colour is full: the smallest of the colours' balanced wells."""
    wells_e = {name: raw.noise_of(name).full_well_e for name in raw.colour_channels}
    return float(min(gains[raw.channels.index(name)] * well_e for name, well_e in wells_e.items()))


def clip_highlights(
    raw: RawImage, balanced: NDArray[np.float64], gains: NDArray[np.float64], reach: int | None = None
) -> NDArray[np.float64]:
    """Limit balanced colours to `highlight_level` near a saturated colour sample, and make white lamps neutral.

    Parameters
    ----------
    raw : RawImage
    balanced : (h, w, channel) float64
        Planes times gains [e-], of all channels or of the first ones in the order of `raw.channels`.
    gains : (channel,) float64
        White balance of each of `raw.channels`.
    reach : int, optional
        Reach of the filter that made the planes, as in `saturated_nearby`.

    Returns
    -------
    (h, w, channel) float64
        In a pixel of `white_lamps` every channel has the value of the brightest colour, and at least the level if the
        pixel's own sample is of a colour. If nothing is limited, the array itself is returned.
    """
    return Highlights.of(raw, gains, reach).held(balanced)


@dataclass(frozen=True)
class Highlights:
    """Places and level of a frame's highlights, by which strips of the frame can be limited one by one.

    Attributes
    ----------
    level : float
        `highlight_level`.
    colours : list of int
        Indices of the colours among the channels.
    clipped, white, own : (h, w) bool
        Pixels near a saturated colour sample, pixels of `white_lamps`, and sites of colours.
    """

    level: float
    colours: list[int]
    clipped: NDArray[np.bool_]
    white: NDArray[np.bool_]
    own: NDArray[np.bool_]

    @classmethod
    def of(cls, raw: RawImage, gains: NDArray[np.float64], reach: int | None = None) -> "Highlights":
        """Find a frame's highlights; the parameters are those of `clip_highlights`."""
        names = "".join(raw.colour_channels)
        clipped = saturated_nearby(raw, names, reach)
        white = white_lamps(raw, gains) if clipped.any() else clipped
        colours = [raw.channels.index(name) for name in names]
        return cls(highlight_level(raw, gains), colours, clipped, white, mask(raw.cfa, names, raw.shape))

    def held(self, balanced: NDArray[np.float64], rows: slice = slice(None)) -> NDArray[np.float64]:
        """Apply `clip_highlights` to some rows, (row, w, channel)."""
        clipped, white = self.clipped[rows], self.white[rows]
        if not clipped.any() and not white.any():
            return balanced
        limited = balanced.copy()
        limited[clipped] = np.minimum(rows_at(balanced, clipped), self.level)
        brightest = limited[white][:, self.colours].max(axis=-1)
        own = self.own[rows][white]
        limited[white] = np.where(own, np.maximum(brightest, self.level), brightest)[:, None]
        return limited


def white_lamps(raw: RawImage, gains: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Mark the full pixels of white lamps, shape (h, w).

    These are full pixels near a full colour sample (`saturated_nearby`), if no colour sample of the lamp that is as
    near lies below `FULL` times the level of highlights, which would show that the lamp has a colour.
    """
    colours = "".join(raw.colour_channels)
    full = raw.saturated
    level = highlight_level(raw, gains)
    near = saturated_nearby(raw, colours)
    sites = channel_map(raw.cfa, raw.shape)
    light = raw.electrons * np.select([sites == name for name in raw.channels], gains.tolist())
    side = _tile_side(raw)
    lamp = _enclosed(full | (light >= LIT * level), side)
    coloured = lamp & ~full & (light < FULL * level) & mask(raw.cfa, colours, raw.shape)
    return np.asarray(full & near & ~_nearby(coloured, side - 1))


def _enclosed(lit: NDArray[np.bool_], side: int) -> NDArray[np.bool_]:
    """Mark all rectangles that have two opposite lit corners, at most `side` pixels apart along either axis."""
    height, width = lit.shape
    result = lit.copy()
    for down, across in product(range(side + 1), range(-side, side + 1)):
        if (down == 0 and across <= 0) or down >= height or abs(across) >= width:
            continue
        left, right = max(-across, 0), width - max(across, 0)
        both = lit[: height - down, left:right] & lit[down:, left + across : right + across]
        if both.any():
            for i, j in product(range(down + 1), range(min(across, 0), max(across, 0) + 1)):
                result[i : height - down + i, left + j : right + j] |= both
    return result


def _nearby(hit: NDArray[np.bool_], reach: int) -> NDArray[np.bool_]:
    """Mark pixels with a hit within `reach` pixels along either axis."""
    if not hit.any():
        return hit
    return box_sums(np.pad(hit, reach).astype(np.uint16), (2 * reach + 1, 2 * reach + 1)) > 0


def _tile_side(raw: RawImage) -> int:
    return max(len(raw.cfa), len(raw.cfa[0]))
