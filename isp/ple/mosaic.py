"""Preparation of a mosaic for piecewise linear estimation: sums over cells, samplings, and reflection at the frame.

Patches lie two pixels apart. In a tile of four pixels they begin at its first or third pixel, which are the tile's
*phases*; the channels of a patch's samples, its sampling, depend on the phase. Cells of 2x2 pixels may lack channels
too: they form a mosaic of cells, whose tile is two cells a side. Larger cells hold every channel.
"""

from dataclasses import dataclass
from itertools import product
from math import lcm
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from isp.ple.estimate import Scale
from isp.ple.overlap import STRIDE, border, padded
from isp.ple.prior import LETTERS, PATCH
from isp.ple.tables import Sampling
from isp.ple.units import transform
from rodcone.types import Singles
from sensor.cfa import Tile, channel_map, channels, mask
from sensor.raw import RawImage

SIDES = (1, 2, 4)  # heights and widths that a tile may have [pixels]
SCALES = 4  # largest number of levels of the pyramid above single pixels
CELLS = 4  # side of a coarse scale's patches [cells]
LEAST_CELLS = 5  # least side of the coarsest scale [cells]


@dataclass(frozen=True)
class Cells:
    """Sums of samples over square cells.

    Attributes
    ----------
    electrons : (h, w, channel) float32
        Of the mosaic's channels [e-]; 0 where a cell has no sample of a channel.
    full : (h, w, channel) bool
        Whether the sum includes a saturated W (`full_white`).
    presence : (row, column, channel) bool
        Which channels the cells of the first tile contain; the other cells repeat them.
    sampling : Sampling
        Sampling of patches of 4x4 cells.
    index : tuple of int
        Indices of the mosaic's channels among R, G, B and W.
    """

    electrons: Singles
    full: NDArray[np.bool_]
    presence: NDArray[np.bool_]
    sampling: Sampling
    index: tuple[int, ...]


def pyramid(raw: RawImage, white_e: ArrayLike, electrons: Singles, full: NDArray[np.bool_]) -> list[Cells]:
    """Sum the mosaic over cells of 2x2, 4x4, ... pixels; return these levels, the finest first.

    Parameters
    ----------
    raw : RawImage
    white_e : (4,) array_like
        Electrons that R, G, B and W collect from a white surface, relative to G.
    electrons : (h, w) float32
        `site_electrons` of the raw image, which are divided by k of `counted_noise`; so is ``white_e``.
    full : (h, w) bool
        `full_white` of the raw image.
    """
    names = channels(raw.cfa)
    index = tuple(LETTERS.index(name) for name in names)
    down, across = (lcm(side, 2) // 2 for side in (len(raw.cfa), len(raw.cfa[0])))
    letters = channel_map(raw.cfa, (2 * down, 2 * across)).reshape(down, 2, across, 2)
    tally = np.stack([(letters == name).sum(axis=(1, 3)) for name in names], axis=-1)
    # One `Sampling` serves all patches only if all cells sum equally many samples of a channel. That number is the one
    # of the cell with the fewest, among cells with any. sums[1] holds the surplus samples, for the larger cells.
    fewest = np.where(tally > 0, tally, 4).min(axis=(0, 1))
    height, width = (length // 2 for length in raw.shape)
    shape = (1 + int(np.any(tally > fewest)), height, width, len(names))
    sums: Singles = np.zeros(shape, np.float32)
    fulls: NDArray[np.bool_] = np.zeros(shape, bool)
    for (a, b), (c, name) in product(np.ndindex(down, across), enumerate(names)):
        sites = [
            (slice(2 * a + i, 2 * height, 2 * down), slice(2 * b + j, 2 * width, 2 * across))
            for i, j in product((0, 1), (0, 1))
            if letters[a, i, b, j] == name
        ]
        for number, site in enumerate(sites):
            cells = (int(number >= fewest[c]), slice(a, None, down), slice(b, None, across), c)
            sums[cells] += electrons[site]
            fulls[cells] |= full[site]
    # Samples of R, G, B and W that a cell of 2x2 pixels sums, and one of 4x4
    in_2x2, in_larger = np.ones(4), np.ones(4)
    in_2x2[list(index)], in_larger[list(index)] = fewest, 4 * tally.mean(axis=(0, 1))
    finest = _cell_sampling(raw, white_e, in_2x2, tally > 0, index)
    levels = [Cells(sums[0], fulls[0], tally > 0, finest, index)]
    sums, fulls = (sums[0], fulls[0]) if len(sums) == 1 else (sums.sum(axis=0), np.asarray(fulls.any(axis=0)))
    # Larger cells hold every channel, and all of its samples.
    every = np.ones((1, 1, len(names)), bool)
    while len(levels) < SCALES and min(sums.shape[:2]) // 2 >= LEAST_CELLS:
        height, width = (length // 2 for length in sums.shape[:2])
        fours = (height, 2, width, 2, len(names))
        sums = sums[: 2 * height, : 2 * width].reshape(fours).sum(axis=(1, 3))
        fulls = np.asarray(fulls[: 2 * height, : 2 * width].reshape(fours).any(axis=(1, 3)))
        levels.append(Cells(sums, fulls, every, _cell_sampling(raw, white_e, in_larger, every, index), index))
        in_larger = np.where(np.isin(np.arange(4), index), 4 * in_larger, in_larger)
    return levels


def _cell_sampling(
    raw: RawImage, white_e: ArrayLike, counts: NDArray[np.float64], presence: NDArray[np.bool_], index: tuple[int, ...]
) -> Sampling:
    rows = [4 * place + channel for place, row in enumerate(_first_patch(presence)) for channel in np.array(index)[row]]
    return _sampling(raw, white_e, counts, CELLS, tuple(map(int, rows)))


def _first_patch(presence: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return which channels the cells of a patch contain, shape (cell, channel), from the tile's first cell on."""
    down, across, count = presence.shape
    return np.tile(presence, (CELLS // down, CELLS // across, 1)).reshape(-1, count)


def _sampling(
    raw: RawImage, white_e: ArrayLike, counts: NDArray[np.float64], size: int, rows: tuple[int, ...]
) -> Sampling:
    # Tables are kept under these numbers, which have six digits so that exposures of different times share tables. PRNU
    # stays that of one sample, although independent gains even out in a sum: coarse cells count as a little too noisy.
    gains, dark_e = (
        tuple(float(f"{value:.6g}") for value in values)
        for values in (np.asarray(white_e) * counts, counted_noise(raw)[1] * np.sqrt(counts))
    )
    return Sampling(size=size, rows=rows, gains=gains, dark_e=dark_e, prnu=raw.prnu)


def counted_noise(raw: RawImage) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the noise of R, G, B and W: the variance k per electron of light, and the dark noise in counted electrons.

    Counted electrons are a sample's electrons divided by k, so that their shot noise is Poisson's. k is 1 unless a
    sample was scaled, because its reading had only a share of the light or of the time.
    """
    noise = [raw.noise_of(name) for name in LETTERS]
    return np.array([x.shot for x in noise]), np.array([x.dark_noise_e / x.shot for x in noise])


def site_electrons(raw: RawImage) -> Singles:
    """Return the counted electrons of a mosaic's sites (`counted_noise`), (h, w) float32."""
    electrons = raw.electrons.astype(np.float32)
    counted = electrons / np.float32(raw.plain_noise.shot)
    for noise in (raw.noise_of(apart.channel) for apart in raw.channel_noise):
        at = mask(raw.cfa, noise.channel, raw.shape)
        counted[at] = electrons[at] / np.float32(noise.shot)
    return counted


def full_white(raw: RawImage) -> NDArray[np.bool_]:
    """Return where W is saturated in a mosaic with G, which saturates much later; nowhere in a mosaic without G."""
    return np.asarray(raw.saturated & (channel_map(raw.cfa, raw.shape) == "W") & ("W" not in raw.colour_channels))


def scale_of_cells(cells: Cells) -> Scale:
    """Convert sums over cells to units of noise, for `isp.ple.estimate`."""
    stable = [
        transform(plane, cells.sampling.dark_e[channel])
        for plane, channel in zip(np.moveaxis(cells.electrons, -1, 0), cells.index, strict=True)
    ]
    presence = _first_patch(cells.presence).ravel()
    return Scale(
        shape=cells.full.shape[:2],
        samples=padded(np.stack(stable, axis=-1), CELLS),
        full=padded(cells.full, CELLS),
        samplings=((cells.sampling,),),
        columns=None if presence.all() else np.flatnonzero(presence),
    )


def scale_of_pixels(raw: RawImage, white_e: ArrayLike, electrons: Singles, full: NDArray[np.bool_]) -> Scale:
    """Convert samples to units of noise, with a sampling for each phase of the tile; parameters as in `pyramid`."""
    down, across = (len(raw.cfa), len(raw.cfa[0]))
    beyond = PATCH - STRIDE  # rows and columns of the first patch that lie outside the frame
    samplings = tuple(
        tuple(
            _sampling(raw, white_e, np.ones(4), PATCH, _sites(raw.cfa, top - beyond, left - beyond))
            for left in range(0, lcm(across, STRIDE), STRIDE)
        )
        for top in range(0, lcm(down, STRIDE), STRIDE)
    )
    plain = raw.plain_noise
    samples = transform(electrons, float(plain.dark_noise_e / plain.shot))  # NumPy's own float would make them float64
    for noise in (raw.noise_of(apart.channel) for apart in raw.channel_noise):
        at = mask(raw.cfa, noise.channel, raw.shape)
        samples[at] = transform(electrons[at], noise.dark_noise_e / noise.shot)
    samples, full = pad_mosaic(raw.cfa, samples, full)
    return Scale(raw.shape, samples, full, samplings)


def _sites(tile: Tile, top: int, left: int) -> tuple[int, ...]:
    """Return the indices of a patch's samples in its vector; the patch's first pixel lies at (top, left)."""
    return tuple(
        4 * (PATCH * y + x) + LETTERS.index(tile[(top + y) % len(tile)][(left + x) % len(tile[0])])
        for y in range(PATCH)
        for x in range(PATCH)
    )


def pad_mosaic(tile: Tile, *samples: NDArray[Any]) -> tuple[NDArray[Any], ...]:
    """Continue samples (h, w) of a mosaic beyond the frame by reflection, with the tile continued too.

    Where the reflected pixel has another channel, the nearest pixel beside it with the right one takes its place.
    """
    wide = tuple(padded(plane, PATCH) for plane in samples)
    if max(len(tile), len(tile[0])) <= 2:  # reflection keeps the phase of a tile of two pixels
        return wide
    shape = samples[0].shape
    sides = [border(length, PATCH) for length in shape]
    letters = np.array([[LETTERS.index(name) for name in row] for row in tile], dtype=np.int8)
    rows, columns = (np.arange(length) - side[0] for length, side in zip(wide[0].shape, sides, strict=True))
    wide_letters = letters[rows[:, None] % len(tile), columns % len(tile[0])]
    frame_letters = wide_letters[sides[0][0] :, sides[1][0] :][: shape[0], : shape[1]]
    gaps = np.nonzero(padded(frame_letters, PATCH) != wide_letters)
    y, x = (
        np.pad(np.arange(length), side, mode="reflect")[at] for length, side, at in zip(shape, sides, gaps, strict=True)
    )
    offsets = product(range(-SIDES[-1] + 1, SIDES[-1]), repeat=2)
    for dy, dx in sorted(offsets, key=lambda offset: (offset[0] ** 2 + offset[1] ** 2, offset)):
        inside = (y + dy >= 0) & (y + dy < shape[0]) & (x + dx >= 0) & (x + dx < shape[1])
        fits = inside & (frame_letters[np.where(inside, y + dy, 0), np.where(inside, x + dx, 0)] == wide_letters[gaps])
        for to, plane in zip(wide, samples, strict=True):
            to[gaps[0][fits], gaps[1][fits]] = plane[y[fits] + dy, x[fits] + dx]
        gaps = (gaps[0][~fits], gaps[1][~fits])
        y, x = y[~fits], x[~fits]
    return wide
