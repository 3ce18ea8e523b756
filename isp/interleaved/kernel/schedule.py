"""Division of the work between threads: blocks of pixels, phases of offsets, and the plane that guides.

A thread owns the pixels x of one block and goes through the offsets d = y - x of one phase, which are those that equal
(a, b) modulo the size of the CFA's tile. The blocks of phase (a, b) begin a rows and b columns early. Therefore their y
begin at the tile's first cell in every phase, and the y of the block's pixel (r, c) lies at cell (r mod th, c mod tw).
The channel at y is thus known when the kernel is compiled, and each pair (x, y) occurs once.
"""

from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from isp.settings import Settings
from sensor.cfa import Tile, channels

Guide = Literal["shared", "channel", "mixed"]
Index = NDArray[np.int32]

# A block has at most 8 x 4 pixels, or one tile. By measurement 8 x 4 takes a tenth less time than 4 x 4, because more
# is shared; 12 x 4 or 8 x 8 gain nothing more.
BLOCK_ROWS, BLOCK_COLUMNS = 8, 4


@dataclass(frozen=True)
class Pattern:
    """A CFA's tile in numbers, and the block of pixels that fits it.

    Attributes
    ----------
    cfa : tuple of str
    channels : tuple of str
        Channels in the order of `sensor.cfa.channels`.
    cells : tuple of int
        Number of the channel at each cell of the tile, row by row.
    white : int or None
        Number of W among the channels.
    tile, block : (int, int)
        Rows and columns of the tile, and of a block, which consists of whole tiles.
    """

    cfa: Tile
    channels: tuple[str, ...]
    cells: tuple[int, ...]
    white: int | None
    tile: tuple[int, int]
    block: tuple[int, int]


@dataclass(frozen=True)
class Threads:
    """Work of each thread, as NumPy arrays, or as Dr.Jit arrays once they are uploaded.

    Attributes
    ----------
    row, column : (n,) int32
        The thread's first pixel, which may lie outside the frame.
    cell : (n,) int32
        Cell of the tile at which the y of the thread's pixels lie; 0 with a shared guide, where it owns the whole
        block.
    plane : (n,) int32
        Number of the channel at that cell.
    phase : (n,) int32
        Number of its phase, a * tw + b.
    """

    row: Index
    column: Index
    cell: Index
    plane: Index
    phase: Index


def make_pattern(cfa: Tile) -> Pattern:
    """Describe a tile by numbers, and choose blocks of whole tiles."""
    names = channels(cfa)
    tile = (len(cfa), len(cfa[0]))
    return Pattern(
        cfa=cfa,
        channels=names,
        cells=tuple(names.index(channel) for channel in "".join(cfa)),
        white=names.index("W") if "W" in names else None,
        tile=tile,
        block=(tile[0] * max(BLOCK_ROWS // tile[0], 1), tile[1] * max(BLOCK_COLUMNS // tile[1], 1)),
    )


@lru_cache(maxsize=4)  # two cameras, each with a shared guide and with one per channel
def list_offsets(pattern: Pattern, settings: Settings, guide: Guide) -> tuple[NDArray[np.float32], NDArray[np.uint32]]:
    """List the offsets of Omega, one list for each phase.

    Returns
    -------
    entries : (list, length, values) float32
        Row and column of the offset, and log2 G(beta_d, sigma_d) of eqs. (2) and (4).
    counts : (list,) uint32
        Number of valid entries in each list; the rest is padding.
    """
    down = pattern.tile[0]
    reach = settings.reach
    lists = []
    line = np.arange(-reach, reach + 1)
    for phase in np.ndindex(pattern.tile):
        rows, columns = (line[line % size == first] for size, first in zip(pattern.tile, phase, strict=True))
        row, column = (offset.ravel() for offset in np.meshgrid(rows, columns, indexing="ij"))
        if guide != "shared":
            # Two rows of offsets alternate, because they read mostly the same packets.
            order = np.lexsort((row, column, (row - row[0]) // (2 * down)))
            row, column = row[order], column[order]
        log_spatial = -np.log2(np.e) * (row**2 + column**2) / (2.0 * settings.sigma_d**2)
        lists.append(np.stack([row, column, log_spatial], axis=-1))
    counts = np.array([len(table) for table in lists], dtype=np.uint32)
    entries = np.zeros((len(lists), int(counts.max()), lists[0].shape[1]), dtype=np.float32)
    for target, table in zip(entries, lists, strict=True):
        target[: len(table)] = table
    entries.flags.writeable = counts.flags.writeable = False  # because they are cached
    return entries, counts


def list_threads(
    pattern: Pattern,
    shape: tuple[int, int],
    rows: tuple[int, int],
    alpha: NDArray[np.float64] | None,
    first_row: int,
    reach: int,
) -> dict[Guide, Threads]:
    """List the threads that reconstruct some rows of a frame, by their guides.

    If no alpha > 0 is in a block's reach, eq. (5) has one distance for all channels, that of W. If all alpha are 1, it
    has only the channel's own distance, and so it has wherever that channel is W. The results are exact with less work.

    Parameters
    ----------
    shape : (int, int)
        Height and width of the frame [pixels].
    rows : (int, int)
        First row to reconstruct, a whole number of blocks, and one past the last.
    alpha : (n, w) array or None
        Eq. (6) from row `first_row` of the frame on, as far as it is in reach; None if it is 0 everywhere, or one plane
        guides all channels.
    """
    # First rows and columns of the blocks that cover the rows in phase (0, 0), and in the phases that begin earlier.
    ends = rows[1] + pattern.tile[0] - 1, shape[1] + pattern.tile[1] - 1
    lines = [
        np.arange(first, end, step, dtype=np.int32)
        for first, end, step in zip((rows[0], 0), ends, pattern.block, strict=True)
    ]
    any_full = all_full = np.zeros((len(lines[0]), len(lines[1])), bool)
    if alpha is not None:
        # In any phase a block reaches at most [first - (tile - 1) - reach, first + block + reach).
        rows_of, columns_of = (
            np.clip([line - size + 1 - reach - first, line + block + reach - first], 0, length)
            for line, size, block, first, length in zip(
                lines, pattern.tile, pattern.block, (first_row, 0), alpha.shape, strict=True
            )
        )
        any_full = _any_in_boxes(alpha > 0.0, rows_of, columns_of)
        all_full = ~_any_in_boxes(alpha < 1.0, rows_of, columns_of)
    white = [cell for cell, channel in enumerate(pattern.cells) if channel == pattern.white]
    colours = [cell for cell, channel in enumerate(pattern.cells) if channel != pattern.white]
    shares: dict[Guide, list[tuple[NDArray[np.bool_], list[int]]]] = {
        "shared": [(~any_full, [0])],
        "channel": [(any_full & all_full, colours), (any_full, white)],
        "mixed": [(any_full & ~all_full, colours)],
    }
    return {guide: _threads(pattern, lines, share, ends, guide) for guide, share in shares.items()}


def _any_in_boxes(marked: NDArray[np.bool_], rows: NDArray[Any], columns: NDArray[Any]) -> NDArray[np.bool_]:
    """Return whether each box, from rows[0][i], columns[0][j] up to rows[1][i], columns[1][j], holds a mark."""
    for ends in (rows, columns):  # with a transpose after each: combining whole rows is forty times faster than sums
        marked = np.array([np.logical_or.reduce(marked[first:last]) for first, last in ends.T]).T.copy()
    return marked


def _threads(
    pattern: Pattern,
    lines: list[Index],
    shares: list[tuple[NDArray[np.bool_], list[int]]],
    ends: tuple[int, int],
    guide: Guide,
) -> Threads:
    """List the threads of chosen blocks and cells, by lines of blocks, without those that have no pixel."""
    down, across = pattern.tile
    parts = [np.empty((5, 0), np.int32)]
    for chosen, cells in shares:
        first = [line[at] for line, at in zip(lines, np.nonzero(chosen), strict=True)]
        for number, phase in enumerate(np.ndindex(pattern.tile)):
            row, column = first[0] - phase[0], first[1] - phase[1]
            kept = (row < ends[0] - down + 1) & (column < ends[1] - across + 1)
            for cell in cells:
                # A thread's first pixel is the first one of its block whose y lies at the cell.
                part = np.empty((5, np.count_nonzero(kept)), np.int32)
                part[0], part[1] = row[kept] + cell // across, column[kept] + cell % across
                part[2], part[3] = cell, pattern.cells[cell]
                part[4] = number
                parts.append(part)
    together = np.concatenate(parts, axis=1)
    # All phases of a line of blocks follow each other, so that what they read is still in the cache.
    line = (together[0] + together[4] // across) // pattern.block[0]
    row, column, cell_of, plane, phases = together[:, np.argsort(line, kind="stable")]
    return Threads(row=row, column=column, cell=cell_of, plane=plane, phase=phases)
