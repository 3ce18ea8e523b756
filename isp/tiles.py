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

from isp.lane_shape import Cells, Judge, entry_length, noise_count, offsets_together, packet_rows, whole_packets
from isp.planes import Plane
from isp.settings import Settings
from isp.similarity import noise_distance
from isp.weighted_sums import NO_OFFSET
from sensor.cfa import Tile

# Pixels that a lane spans on a CPU: 8 x 4 at most, or one tile. Measured: more sharing than 4 x 4 (a tenth less time),
# and 12 x 4 or 8 x 8 gain nothing more.
LANE_ROWS, LANE_COLUMNS = 8, 4

Index = NDArray[np.int32]
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


@lru_cache(maxsize=16)
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
        The step in groups by its bits; then for `offsets_together`, one a tile below the other, log2 G(beta_d, sigma_d)
        of eqs. (2) and (4), NO_OFFSET beyond Omega, and the noise distances: W's plane by cell, or the plane of the
        letter at y and W's.
    counts : (list,) uint32
        Entries that hold; the rest is padding.
    """
    (down, across), reach = pattern.size, settings.reach
    noise, count = noise_by_class(tile, pattern, settings.patch, reach), noise_count(pattern.size, dense=dense)
    together, lists = offsets_together(dense=dense), []
    for shift in np.ndindex(down, across):
        first = first_offset(pattern, *shift)
        rows, columns = (
            np.array([d for d in range(-reach, reach + 1) if d % size == first[axis]])
            for axis, size in enumerate(pattern.size)
        )
        d = np.stack(np.meshgrid(rows[::together], columns, indexing="ij"), axis=-1).reshape(-1, 2)
        table = np.zeros((len(d), whole_packets(entry_length(pattern.size, together, dense=dense))), dtype=np.float32)
        lines = (d[:, 0] - first[0]) // packet_rows(down)
        steps = lines * groups + (d[:, 1] - first[1]) // across
        table[:, 0] = steps.astype(np.int32).view(np.float32)
        all_cells = down * across
        parts = [slice(all_cells)] if dense else [slice(k + all_cells, None, -all_cells) for k in range(all_cells)]
        copies = [table.copy() for _ in parts]
        for i in range(together):
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
    places = rows[0] + np.arange(down, dtype=np.int32) * height, np.arange(across, dtype=np.int32) * width
    tiles = np.meshgrid(*places, indexing="ij")
    some = np.full((down, across), pattern.white is None)
    whole = some
    if pattern.white is not None and alpha is not None:
        edges = []
        for first, size, back, length in zip(places, (height, width), pattern.size, shape, strict=True):
            edges.append((np.clip(first - back + 1 - reach, 0, length), np.clip(first + size + reach, 0, length)))
        area = np.outer(*(end - start for start, end in edges))
        counts = [_count(condition, first_row, *edges) for condition in (alpha > 0.0, alpha >= 1.0)]
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
        work[judge] = Work(*np.concatenate(parts, axis=1))
    return work


def _count(
    condition: NDArray[np.bool_], first_row: int, rows: tuple[Index, Index], columns: tuple[Index, Index]
) -> NDArray[np.int32]:
    """Pixels where the condition holds in each box between starts and ends of rows and columns, (row, column)."""
    near = [np.flatnonzero(condition.any(axis=axis)) for axis in (1, 0)]
    if not near[0].size:
        return np.zeros((len(rows[0]), len(columns[0])), np.int32)
    top, left = (int(places[0]) for places in near)
    kept = condition[top : near[0][-1] + 1, left : near[1][-1] + 1]
    lines = np.pad(kept, ((1, 0), (0, 0))).cumsum(0, dtype=np.int32)
    upper, lower = (np.clip(edge - first_row - top, 0, kept.shape[0]) for edge in rows)
    bands = np.pad(lines[lower] - lines[upper], ((0, 0), (1, 0))).cumsum(1, dtype=np.int32)
    before, behind = (np.clip(edge - left, 0, kept.shape[1]) for edge in columns)
    return np.asarray(bands[:, behind] - bands[:, before])


def _lanes(
    tiles: Sequence[Index], chosen: NDArray[np.bool_], cells: list[int], pattern: Pattern, end: tuple[int, int]
) -> list[Index]:
    """All classes' lanes in the chosen tiles, class by class, without those that hold no pixel to reconstruct."""
    parts = [np.empty((6, 0), np.int32)]
    places = *(place_of[chosen] for place_of in tiles), np.flatnonzero(chosen).astype(np.int32)
    for number, shift in enumerate(np.ndindex(*pattern.size)):
        kept = (places[0] < end[0] + shift[0]) & (places[1] < end[1] + shift[1])
        row, column, place = (place[kept] for place in places)
        for cell in cells:
            part = np.empty((6, len(row)), np.int32)
            part[0], part[1], part[2], part[3], part[4] = row - shift[0], column - shift[1], *shift, cell
            part[5] = place + number * chosen.size
            parts.append(part)
    return parts
