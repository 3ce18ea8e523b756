"""Work for the kernel: lists of offsets, and lanes sorted by which planes judge similarity."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from isp.kernel import ENTRY, PACKET, Grid
from isp.planes import Plane
from isp.settings import Settings
from isp.similarity import noise_distance
from sensor.cfa import Tile, channels

LARGEST_GRID = 4  # pixels a side; more would not fit a CPU's first cache and takes long to compile
LARGEST_WINDOW = 11  # rows under the patches of one lane, likewise

Index = NDArray[np.uint32]


@dataclass(frozen=True)
class Offsets:
    """Lists of offsets that lead from a phase to the samples of a channel.

    Attributes
    ----------
    entries : (2 * channel * th * tw, length, ENTRY) float32
        One list a channel and phase, twice: with the noise distance of the band's own plane first, and of W's first.
    counts : (2 * channel * th * tw,) uint32
        Entries that hold; the rest is padding.
    """

    entries: NDArray[np.float32]
    counts: Index


def make_grid(tile: Tile, patch: int) -> Grid:
    """Shape of a lane's work: as many columns as one packet covers, and rows until the window is large."""
    step = (len(tile), len(tile[0]))
    columns = min(max((PACKET - patch) // step[1] + 1, 1), LARGEST_GRID)
    rows = min(max((LARGEST_WINDOW - patch) // step[0] + 1, 1), LARGEST_GRID)
    return Grid(rows, columns, step, patch)


def list_offsets(tile: Tile, settings: Settings) -> Offsets:
    """Every offset of Omega by channel and phase, with its spatial weight and its noise distances."""
    letters, reach = channels(tile), settings.reach
    cells = np.array([list(row) for row in tile])
    d = np.stack(np.meshgrid(*[np.arange(-reach, reach + 1)] * 2, indexing="ij"), axis=-1).reshape(-1, 2)
    noise = {letter: noise_distance(tile, letter, settings.patch, reach) for letter in letters}
    spatial = -np.log2(np.e) * (d**2).sum(1) / (2.0 * settings.sigma_d**2)  # log2 G(beta_d, sigma_d), eqs. (2), (4)
    lists = []
    for first_judge in ("band", "W"):
        for letter in letters:
            judges = (letter, "W" if "W" in letters else letter)
            for phase in np.ndindex(*cells.shape):
                tables = [noise[judge][phase].ravel() for judge in judges]
                table = np.column_stack((d, spatial, *(tables if first_judge == "band" else reversed(tables))))
                at = (d + phase) % cells.shape
                lists.append(table[cells[at[:, 0], at[:, 1]] == letter])
    counts = np.array([len(table) for table in lists], dtype=np.uint32)
    entries = np.zeros((len(lists), int(counts.max()), ENTRY), dtype=np.float32)
    for target, table in zip(entries, lists, strict=True):
        target[: len(table), : table.shape[1]] = table
    return Offsets(entries, counts)


@dataclass(frozen=True)
class Work:
    """Lanes that the kernel runs together, one number a lane.

    Attributes
    ----------
    row, column : (n,) uint32
        First pixel in the frame.
    channel : (n,) uint32
        Channel to reconstruct.
    list : (n,) uint32
        Which of `Offsets.entries`.
    planes : tuple of (n,) uint32
        The one plane that judges similarity, or two (the band's own, W's).
    """

    row: Index
    column: Index
    channel: Index
    list: Index
    planes: tuple[Index, ...]


def sort_work(alpha: Plane, tile: Tile, grid: Grid, reach: int) -> tuple[Work, Work]:
    """All lanes of a frame: those in which one plane judges, then those in which the band and W both do.

    Where no alpha > 0 is in reach of a lane, eq. (5) holds W's distance alone; where all alpha are 1, the band's own
    alone; and the channel W has no other. Exact, at half the work.
    """
    letters = channels(tile)
    white = letters.index("W") if "W" in letters else -1
    row, column, phase = _place((alpha.shape[0], alpha.shape[1]), grid)
    some, bright, whole = (
        _count_in_reach(condition, row, column, grid, reach)
        for condition in (alpha > 0.0, alpha >= 1.0, np.ones_like(alpha, dtype=bool))
    )
    own = np.arange(len(letters))[:, None]
    by_white = (some == 0) | (own == white)
    by_band = ~by_white & (bright == whole)

    def collect(chosen: NDArray[np.bool_], judges: int) -> Work:
        channel, lane = np.nonzero(chosen)
        first_is_white = by_white[channel, lane]
        number = (first_is_white * len(letters) + channel) * (grid.step[0] * grid.step[1]) + phase[lane]
        planes = (np.where(first_is_white, white, channel), np.full_like(channel, white))[:judges]
        parts = [part.astype(np.uint32) for part in (row[lane], column[lane], channel, number, *planes)]
        return Work(parts[0], parts[1], parts[2], parts[3], tuple(parts[4:]))

    return collect(by_white | by_band, 1), collect(~(by_white | by_band), 2)


def _place(shape: tuple[int, int], grid: Grid) -> tuple[NDArray[np.intp], ...]:
    """Row, column and phase of the first pixel of each lane, phase by phase."""
    (down, across), size = grid.step, (grid.step[0] * grid.rows, grid.step[1] * grid.columns)
    lanes = (-(-shape[0] // size[0]), -(-shape[1] // size[1]))
    phase_row, phase_column, i, j = np.indices((down, across, *lanes)).reshape(4, -1)
    row, column = phase_row + i * size[0], phase_column + j * size[1]
    inside = (row < shape[0]) & (column < shape[1])
    return row[inside], column[inside], (phase_row * across + phase_column)[inside]


def _count_in_reach(
    condition: NDArray[np.bool_], row: NDArray[np.intp], column: NDArray[np.intp], grid: Grid, reach: int
) -> NDArray[np.intp]:
    """Pixels of the frame within reach of each lane's pixels where the condition holds, from a summed-area table."""
    table = np.pad(condition, ((1, 0), (1, 0))).cumsum(0, dtype=np.intp).cumsum(1)
    top, left = np.maximum(row - reach, 0), np.maximum(column - reach, 0)
    bottom = np.minimum(row + grid.height - grid.patch + reach + 1, condition.shape[0])
    right = np.minimum(column + grid.width - grid.patch + reach + 1, condition.shape[1])
    return np.asarray(table[bottom, right] - table[top, right] - table[bottom, left] + table[top, left])
