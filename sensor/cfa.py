"""Colour filter arrays: a tile of channels, one letter each, that repeats over the sensor.

Crosstalk mixes a tile's channels: a pixel hands the share c of its electrons to each of its four neighbours
(`sensor.readout.spread_charge`). So a site, which is a pixel of the tile, reads (1 - 4 c) of the light behind its own
filter, and c of that behind each neighbour's. In an even field the mean over a channel's sites is K e, where e are the
electrons behind each filter alone, and K is the matrix `channel_mixing`. A camera's maker calibrates neutral and colour
matrices for the channels K e, and development undoes the crosstalk first (`isp.crosstalk`).
"""

import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from rodcone.errors import InputError, unknown
from rodcone.types import Floats

Tile: TypeAlias = tuple[str, ...]

OWN = "own"  # in place of a mosaic's name, this means the camera's own mosaic
RGBW: Tile = ("RG", "BW")  # Parmar & Wandell 2009, Figure 2
BAYER: Tile = ("RG", "GB")


def quad(tile: Tile) -> Tile:
    """Return the tile of twice the height and width in which 2x2 pixels replace each of `tile`."""
    return tuple("".join(2 * channel for channel in row) for row in tile for _ in range(2))


_TILES = tomllib.loads(Path(__file__).with_name("mosaics.toml").read_text("utf-8"))
MOSAICS: Mapping[str, Tile] = MappingProxyType({name: tuple(rows) for name, rows in _TILES.items()})


def mosaics() -> tuple[str, ...]:
    """Return the names of the mosaics that `tile_of` knows.

    Examples
    --------
    >>> import rodcone
    >>> "rgbw" in rodcone.mosaics()
    True
    """
    return tuple(MOSAICS)


def tile_of(mosaic: str | Sequence[str]) -> Tile:
    """Return the tile of a mosaic given by a name of `MOSAICS`, or by its rows of channels, also as ``RG/BW``.

    Raises
    ------
    InputError
        For an unknown name, or rows that don't make a rectangle of letters.
    """
    if not isinstance(mosaic, str) or "/" in mosaic:
        return check_tile(mosaic.split("/") if isinstance(mosaic, str) else mosaic)
    if mosaic not in MOSAICS:
        bayer = f"bayer_{mosaic.lower()}"
        if bayer in MOSAICS:
            raise InputError(f"cfa: {mosaic!r} is unknown; allowed: {', '.join(sorted(MOSAICS))}; write {bayer!r}")
        raise unknown("cfa", mosaic, MOSAICS)
    return MOSAICS[mosaic]


def check_tile(tile: Sequence[str]) -> Tile:
    """Return `tile` as a tuple of rows, or raise `InputError` where it is not a rectangle of letters."""
    rows = tuple(tile) if isinstance(tile, Sequence) and not isinstance(tile, str) else ()
    if not rows or not all(isinstance(row, str) and row.isalpha() for row in rows):
        raise InputError(f"cfa: {tile!r} is not a tile; allowed: rows of letters such as {RGBW}; give a tuple of rows")
    if len({len(row) for row in rows}) != 1:
        raise InputError(f"cfa: rows of {rows!r} differ in length; allowed: a rectangle; pad or cut the rows")
    return rows


def channels(tile: Tile) -> tuple[str, ...]:
    """Return each channel of a tile once: R, G, B, W first in this order, then any others as they appear row by row."""
    present = dict.fromkeys("".join(tile))
    return tuple(name for name in "RGBW" if name in present) + tuple(name for name in present if name not in "RGBW")


def unit_channel(tile: Tile) -> str:
    """Return the channel that sets exposure, white balance and a picture's scale.

    It is G, else W, else the most frequent one. That is C in RCCB and RCCC, Y in RYYB, W in a camera without colours;
    of equally frequent ones it is the first.
    """
    names = channels(tile)
    sites = "".join(tile)
    return next((name for name in "GW" if name in names), max(names, key=sites.count))


def is_bayer(tile: Tile) -> bool:
    """Return whether a tile is one of Bayer's four phases: 2x2, green on a diagonal, red and blue once."""
    return tile in (("RG", "GB"), ("BG", "GR"), ("GR", "BG"), ("GB", "RG"))


def plain(tile: Tile) -> Tile:
    """Return the tile whose `quad` is `tile`, or `tile` itself if there is none."""
    half = tuple(row[::2] for row in tile[::2])
    return half if quad(half) == tile else tile


def is_rgbw(tile: Tile) -> bool:
    """Return whether a tile is 2x2 with R, G, B and W once each."""
    return len(tile) == 2 and len(tile[0]) == 2 and sorted("".join(tile)) == list("BGRW")


def channel_map(tile: Tile, shape: tuple[int, int]) -> NDArray[np.str_]:
    """Return the channel of each pixel of a mosaic of this shape."""
    return _repeated(np.array([list(row) for row in tile]), shape)


def mask(tile: Tile, channel: str, shape: tuple[int, int]) -> NDArray[np.bool_]:
    """Return where a mosaic of this shape samples `channel`, or any channel of several letters: S_i of eq. (1).

    Examples
    --------
    >>> import rodcone
    >>> rodcone.mask(("GR", "BW"), "W", (2, 4)).astype(int)
    array([[0, 0, 0, 0],
           [0, 1, 0, 1]])
    """
    return _repeated(np.isin([list(row) for row in tile], list(channel)), shape)


def _repeated(cells: NDArray[Any], shape: tuple[int, int]) -> NDArray[Any]:
    repeats = (-(-shape[0] // cells.shape[0]), -(-shape[1] // cells.shape[1]))
    return np.tile(cells, repeats)[: shape[0], : shape[1]]


def block_sums(values: NDArray[Any]) -> NDArray[Any]:
    """Sum 2x2 pixels: shape (..., h, w) becomes (..., h / 2, w / 2)."""
    rows = values[..., ::2, :] + values[..., 1::2, :]
    return np.asarray(rows[..., ::2] + rows[..., 1::2])


def check_covers(tile: Tile, shape: tuple[int, ...]) -> None:
    """Raise `InputError` unless a frame of `shape` is 2-D and holds a whole tile."""
    height, width = len(tile), len(tile[0])
    if len(shape) != 2 or shape[0] < height or shape[1] < width:
        raise InputError(
            f"mosaic: shape {tuple(shape)} doesn't fit the tile {tile}; allowed: (h, w) of at least {height}x{width}; "
            "pass one raw frame that holds a whole tile"
        )


def site_mixing(tile: Tile, crosstalk: float, light_shares: Mapping[str, float] | None = None) -> Floats:
    """Return the electrons that each site of a tile reads in an even field, over those behind each channel's filter.

    Parameters
    ----------
    tile : tuple of str
    crosstalk : float
        Share of a pixel's electrons that goes to each of its four neighbours, 0 to 0.25.
    light_shares : mapping of str to float, optional
        For channels with a neutral density, the share of the light that it lets through. The reading of such a site is
        divided by this share, as a raw image's electrons are.

    Returns
    -------
    (row, column, channel) float64
        Channels in the order of `sensor.cfa.channels`. Without densities they sum to 1 for each site.
    """
    names = channels(tile)
    sites = np.array([list(row) for row in tile])[..., None] == np.array(names)
    behind = sites * np.array([(light_shares or {}).get(name, 1.0) for name in names])
    neighbours = sum(np.roll(behind, step, axis) for step in (1, -1) for axis in (0, 1))
    return np.asarray(((1 - 4 * crosstalk) * behind + crosstalk * neighbours) / behind.sum(axis=2, keepdims=True))


def channel_mixing(tile: Tile, crosstalk: float, light_shares: Mapping[str, float] | None = None) -> Floats:
    """Return `site_mixing` averaged over each channel's sites: K, shape (channel that reads, channel of the light)."""
    at_sites = site_mixing(tile, crosstalk, light_shares)
    names = channels(tile)
    sites = np.array([list(row) for row in tile])
    return np.stack([at_sites[sites == name].mean(axis=0) for name in names])


def unmixed(mixing: Floats, electrons: Sequence[float] | Floats) -> Floats:
    """Return the electrons behind each filter alone, from those that the channels read of an even field.

    Results are at least a ten-thousandth of the reading. If all charge goes to the neighbours, two channels may read
    the same, and K has no inverse; of all fields that fit, the result is then the one with the least squares.
    """
    read_e = np.asarray(electrons, dtype=np.float64)
    return np.asarray(np.maximum(np.linalg.lstsq(mixing, read_e, rcond=1e-9)[0], 1e-4 * read_e))
