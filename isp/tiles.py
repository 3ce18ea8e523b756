"""What the kernel's lanes go through: the tile of letters in numbers, classes of offsets, and which lanes there are.

Lanes lie so that the pixels y of a lane begin at the same cell of the tile whatever the class, so those of class k
begin `k // tw` rows and `k % tw` columns before a whole number of lanes.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from isp.lane_shape import TOGETHER, Cells, Judge, entry_length, noise_count, packet_rows, whole_packets
from isp.planes import Plane
from isp.settings import Settings
from isp.similarity import noise_distance
from isp.weighted_sums import NO_OFFSET
from sensor.cfa import Tile

# Pixels that a lane spans on a CPU: 8 x 4 at most, or one tile. Measured: more sharing than 4 x 4 (a tenth less time),
# and 12 x 4 or 8 x 8 gain nothing more.
LANE_ROWS, LANE_COLUMNS = 8, 4

Index = NDArray[np.int32]
Places = NDArray[np.intp]
Number = TypeVar("Number", int, Index)


@dataclass(frozen=True)
class Pattern:
    """A tile of letters by number, turned so that as many tiles as possible are alike.

    Attributes
    ----------
    cells : tuple of tuple of int
        Number of the letter at each cell; numbers rise in the order in which they appear.
    white : int or None
        W's number; the largest that a turn can give it.
    letters : tuple of str
        By number.
    start : pair of int
        Row and column of the tile where `cells` begin.
    """

    cells: Cells
    white: int | None
    letters: tuple[str, ...]
    start: tuple[int, int]

    @property
    def size(self) -> tuple[int, int]:
        """Rows and columns of the tile."""
        return len(self.cells), len(self.cells[0])


def number_tile(tile: Tile) -> Pattern:
    """Pattern of a tile: all its turns (other phases of the same mosaic) give the same `cells` and `white`."""
    grid = np.array([list(row) for row in tile])
    patterns = []
    for start in np.ndindex(*grid.shape):
        turned = np.roll(grid, (-start[0], -start[1]), (0, 1))
        letters = tuple(dict.fromkeys(turned.ravel().tolist()))
        cells = tuple(tuple(letters.index(letter) for letter in row) for row in turned.tolist())
        white = letters.index("W") if "W" in letters else None
        patterns.append(Pattern(cells, white, letters, (start[0], start[1])))
    return min(patterns, key=lambda pattern: (pattern.cells, -(pattern.white or 0), pattern.start))


def lane_size(pattern: Pattern) -> tuple[int, int]:
    """Rows and columns that a lane spans: whole tiles."""
    down, across = pattern.size
    return down * max(LANE_ROWS // down, 1), across * max(LANE_COLUMNS // across, 1)


def list_offsets(
    tile: Tile, pattern: Pattern, settings: Settings, groups: int, *, dense: bool
) -> tuple[NDArray[np.float32], NDArray[np.uint32]]:
    """Every offset of Omega by class.

    Parameters
    ----------
    groups : int
        Groups of packets in a row (`isp.strips`).
    dense : bool
        Whether for dense lanes, a list a class, or for those of one cell at y, a list a class and cell.

    Returns
    -------
    entries : (list, length, whole_packets(entry_length)) float32
        The step in groups by its bits; then for TOGETHER offsets, one a tile below the other, log2 G(beta_d, sigma_d)
        of eqs. (2) and (4), NO_OFFSET beyond Omega, and the noise distances: W's plane by cell, or the plane of the
        letter at y and W's.
    counts : (list,) uint32
        Entries that hold; the rest is padding.
    """
    (down, across), reach = pattern.size, settings.reach
    noise, count = noise_by_class(tile, pattern, settings.patch, reach), noise_count(pattern.size, dense=dense)
    lists = []
    for shift in np.ndindex(down, across):
        first = first_offset(pattern, *shift)
        rows, columns = (
            np.array([d for d in range(-reach, reach + 1) if d % size == first[axis]])
            for axis, size in enumerate(pattern.size)
        )
        d = np.stack(np.meshgrid(rows[::TOGETHER], columns, indexing="ij"), axis=-1).reshape(-1, 2)
        table = np.zeros((len(d), whole_packets(entry_length(pattern.size, dense=dense))), dtype=np.float32)
        lines = (d[:, 0] - first[0]) // packet_rows(down)
        steps = lines * groups + (d[:, 1] - first[1]) // across
        table[:, 0] = steps.astype(np.int32).view(np.float32)
        all_cells = down * across
        parts = [slice(all_cells)] if dense else [slice(k + all_cells, None, -all_cells) for k in range(all_cells)]
        copies = [table.copy() for _ in parts]
        for i in range(TOGETHER):
            row, at = d[:, 0] + i * down, 1 + i * (1 + count)
            log_weight = -np.log2(np.e) * (row**2 + d[:, 1] ** 2) / (2.0 * settings.sigma_d**2)
            for target, part in zip(copies, parts, strict=True):
                target[:, at] = np.where(row <= reach, log_weight, NO_OFFSET)
                if settings.distance == "noise":
                    distances = noise[shift][part][:, np.minimum(row, reach) + reach, d[:, 1] + reach]
                    target[:, at + 1 : at + 1 + count] = distances.T
        lists += copies
    counts = np.array([len(table) for table in lists], dtype=np.uint32)
    entries = np.zeros((len(lists), int(counts.max()), lists[0].shape[1]), dtype=np.float32)
    for target, table in zip(entries, lists, strict=True):
        target[: len(table)] = table
    return entries, counts


def first_offset(pattern: Pattern, shift_row: Number, shift_column: Number) -> tuple[Number, Number]:
    """Smallest offset of a class that is not negative, along rows and columns."""
    (down, across), (row, column) = pattern.size, pattern.start
    return (row + shift_row) % down, (column + shift_column) % across


@lru_cache(maxsize=16)
def noise_by_class(tile: Tile, pattern: Pattern, patch: int, reach: int) -> Plane:
    """Noise distances for the cells at y of every class.

    Returns
    -------
    (th, tw, 2 * th * tw, 2 reach + 1, 2 reach + 1) float64
        By class, cell (first W's plane, then the band's own) and offset.
    """
    (down, across), white = pattern.size, pattern.white
    tables = [noise_distance(tile, letter, patch, reach) for letter in pattern.letters]
    result = np.zeros((down, across, 2 * down * across, 2 * reach + 1, 2 * reach + 1))
    for shift in np.ndindex(down, across):
        for number, cell in enumerate(np.ndindex(down, across)):
            phase = (cell[0] - shift[0]) % down, (cell[1] - shift[1]) % across
            if white is not None:
                result[shift][number] = tables[white][phase]
            result[shift][down * across + number] = tables[pattern.cells[cell[0]][cell[1]]][phase]
    return result


@dataclass(frozen=True)
class Work:
    """Lanes that one kernel runs, a number a lane.

    Attributes
    ----------
    row, column : (n,) int32
        First pixel that it spans in the frame; -1 or less where the class begins before it.
    shift_row, shift_column : (n,) int32
        Class.
    cell : (n,) int32
        Number of the cell whose pixels it owns; 0 where it owns them all.
    tile : (n,) int32
        Its number among the tiles of all classes (`tile_grid`).
    """

    row: Index
    column: Index
    shift_row: Index
    shift_column: Index
    cell: Index
    tile: Index


def tile_grid(width: int, rows: tuple[int, int], pattern: Pattern) -> tuple[int, int]:
    """Tiles of lanes down and across that cover some rows of a frame in every class."""
    size = lane_size(pattern)
    return (rows[1] - rows[0] + size[0]) // size[0] + 1, width // size[1] + 2


def sort_tiles(
    shape: tuple[int, int], rows: tuple[int, int], alpha: Plane | None, first_row: int, pattern: Pattern, reach: int
) -> dict[Judge, Work]:
    """Lanes for some rows of a frame by what judges in them.

    Where no alpha > 0 is in reach of a tile, eq. (5) holds W's distance alone; where all alpha are 1, the band's own
    alone, as it does wherever that band is W. Exact, at a part of the work.

    Parameters
    ----------
    shape : (int, int)
        Height and width of the frame [pixels].
    rows : (int, int)
        First and past the last row to reconstruct; the first is a whole number of lanes.
    alpha : (n, w) array or None
        Eq. (6) from row `first_row` of the frame on, as far as it is in reach; None where all are 0.
    """
    height, width = lane_size(pattern)
    down, across = tile_grid(shape[1], rows, pattern)
    tiles = np.meshgrid(rows[0] + np.arange(down) * height, np.arange(across) * width, indexing="ij")
    some = np.full((down, across), pattern.white is None)
    whole = some
    if pattern.white is not None and alpha is not None:
        before = np.array([size - 1 for size in pattern.size])
        top, left = (place - back - reach for place, back in zip(tiles, before, strict=True))
        bottom, right = (place + size + reach for place, size in zip(tiles, (height, width), strict=True))
        box = [np.clip(edge, 0, shape[0]) for edge in (top, bottom)]
        box += [np.clip(edge, 0, shape[1]) for edge in (left, right)]
        area = (box[1] - box[0]) * (box[3] - box[2])
        counts = [_count(condition, first_row, *box) for condition in (alpha > 0.0, alpha >= 1.0)]
        some, whole = counts[0] > 0, counts[1] == area
    numbers = [number for row in pattern.cells for number in row]
    white = [k for k, number in enumerate(numbers) if number == pattern.white]
    colours = [k for k in range(len(numbers)) if k not in white]
    kinds: dict[Judge, list[tuple[NDArray[np.bool_], list[int]]]] = {
        "white": [(~some, [0])],
        "band": [(some & whole, colours), (some, white)],
        "both": [(some & ~whole, colours)],
    }
    work: dict[Judge, Work] = {}
    for judge, groups in kinds.items():
        parts = [part for group in groups for part in _lanes(tiles, *group, pattern, (rows[1], shape[1]))]
        work[judge] = Work(*np.concatenate(parts, axis=1).astype(np.int32))
    return work


def _count(
    condition: NDArray[np.bool_], first_row: int, top: Places, bottom: Places, left: Places, right: Places
) -> Places:
    """Pixels where the condition holds in each box of a grid: rows by the first index, columns by the second."""
    rows = np.flatnonzero(condition.any(axis=1))
    if not rows.size:
        return np.zeros_like(top)
    kept = condition[rows[0] : rows[-1] + 1]
    lines = np.pad(kept, ((1, 0), (0, 0))).cumsum(0, dtype=np.int32)
    upper, lower = (np.clip(edge[:, 0] - first_row - rows[0], 0, len(kept)) for edge in (top, bottom))
    bands = np.pad(lines[lower] - lines[upper], ((0, 0), (1, 0))).cumsum(1, dtype=np.int32)
    return np.asarray(bands[:, right[0]] - bands[:, left[0]], dtype=np.intp)


def _lanes(
    tiles: Sequence[Places], chosen: NDArray[np.bool_], cells: list[int], pattern: Pattern, end: tuple[int, int]
) -> list[Places]:
    """All classes' lanes in the chosen tiles, class by class, without those that hold no pixel to reconstruct."""
    place, parts = np.flatnonzero(chosen), [np.empty((6, 0), np.intp)]
    for number, shift in enumerate(np.ndindex(*pattern.size)):
        row, column = (place_of[chosen] - back for place_of, back in zip(tiles, shift, strict=True))
        kept = (row < end[0]) & (column < end[1])
        for cell in cells:
            constant = (np.full_like(row, value) for value in (*shift, cell))
            parts.append(np.stack([row, column, *constant, number * chosen.size + place])[:, kept])
    return parts
