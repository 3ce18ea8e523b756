"""Eqs. (1)-(5) for one group of tiles in Dr.Jit: one source for LLVM and CUDA.

A lane reconstructs one channel at a small grid of pixels that share a phase of the tile. All of them then use the same
offsets d = y - x (those that lead to a sample of that channel), the same planes and the same noise distances, so one
compiled kernel serves every phase, channel and colour filter array: what differs is read from a list, one entry an
offset. Neighbouring pixels' patches overlap, and the lane forms their common row sums once.

A plain gather costs as much as twenty multiply-adds on a CPU. Rows are therefore stored as packets: each pixel holds
the `PACKET` values that start there, which a lane loads with one instruction from any column.
"""

from dataclasses import dataclass
from typing import Any

from render.jit import arrays, dr

PACKET = 8  # floats a lane loads at once: one AVX register, and the most Dr.Jit takes on a CPU
ENTRY = 8  # floats of one list entry: row and column of d, log2 of the spatial weight, then B of each plane
NEVER = -1e30  # log weight of a pixel outside the frame; far under any real one (sigma >= 1e-3), and finite


@dataclass(frozen=True)
class Grid:
    """The pixels of one lane: `rows` x `columns` of them, one tile of `step` pixels apart, with patches of `patch`."""

    rows: int
    columns: int
    step: tuple[int, int]
    patch: int

    @property
    def height(self) -> int:
        """Rows that the patches of the lane's pixels cover together."""
        return self.step[0] * (self.rows - 1) + self.patch

    @property
    def width(self) -> int:
        """Columns that they cover."""
        return self.step[1] * (self.columns - 1) + self.patch


@dataclass(frozen=True)
class Frame:
    """Evaluated Dr.Jit arrays that all lanes read.

    Attributes
    ----------
    h : Float
        Planes in packets, [plane, row, column, PACKET], padded.
    samples : Float
        Per padded pixel, e of the `columns` pixels of a lane that starts there, then their alpha.
    entries : Float
        Lists of offsets, [list, entry, ENTRY].
    height, width, channels : UInt
        Shape of the result.
    rows, pitch : UInt
        Rows and columns of a padded plane.
    reach, length : UInt
        Largest offset along an axis, entries of a list.
    decay : Float
        log2(e) / (2 sigma_s^2).
    """

    h: Any
    samples: Any
    entries: Any
    height: Any
    width: Any
    channels: Any
    rows: Any
    pitch: Any
    reach: Any
    length: Any
    decay: Any


@dataclass(frozen=True)
class Lanes:
    """What each lane does.

    Attributes
    ----------
    row, column : UInt
        First pixel in the frame.
    corner : UInt
        First pixel of its patch in the padded planes.
    list, count : UInt
        List of offsets, and how many entries of it hold.
    planes : tuple of UInt
        The plane that judges similarity, or two of them (the band's own and W's) where alpha mixes them.
    """

    row: Any
    column: Any
    corner: Any
    list: Any
    count: Any
    planes: tuple[Any, ...]


def reconstruct_lanes(frame: Frame, lanes: Lanes, grid: Grid) -> list[tuple[Any, Any]]:
    """Estimate and noise gain at each pixel of the lanes' grids, row by row."""
    jit = arrays()
    lane_count = dr.width(lanes.row)
    margin = grid.patch // 2  # from the first pixel of a patch to its centre
    here = [_window(frame, plane, lanes.corner, grid) for plane in lanes.planes]

    def add_offset(k: Any, sums: list[tuple[Any, ...]]) -> tuple[Any, list[tuple[Any, ...]]]:
        entry = dr.gather(jit.ArrayXf, frame.entries, lanes.list * frame.length + k, shape=(ENTRY, lane_count))
        row, column = jit.Int(entry[0]), jit.Int(entry[1])
        moved = jit.UInt(jit.Int(lanes.corner) + row * jit.Int(frame.pitch) + column)
        distances = [
            _distances(window, _window(frame, plane, moved, grid), entry[3 + i], grid)
            for i, (plane, window) in enumerate(zip(lanes.planes, here, strict=True))
        ]
        inside = _inside(frame, jit.Int(lanes.row) + row, jit.Int(lanes.column) + column, grid)
        samples = _samples(frame, moved + margin * frame.pitch + margin, grid)
        updated = []
        for old, judged, (electrons, alpha), valid in zip(
            sums, zip(*distances, strict=True), samples, inside, strict=True
        ):
            log_weight = dr.fma(-frame.decay, _beta_squared(judged, alpha), entry[2])
            updated.append(_accumulate(old, dr.select(valid, log_weight, NEVER), electrons))
        return k + 1, updated

    start = [tuple(dr.full(jit.Float, v, lane_count) for v in (NEVER, 0.0, 0.0, 0.0))] * (grid.rows * grid.columns)
    _, sums = dr.while_loop((jit.UInt(0), start), lambda k, _: k < lanes.count, add_offset)
    return [(value / weight, square / dr.square(weight)) for _, weight, square, value in sums]


def _window(frame: Frame, plane: Any, corner: Any, grid: Grid) -> list[list[Any]]:
    """Rows of the part of a plane that the patches of the lane's pixels cover."""
    return [_row(frame, plane, corner + i * frame.pitch, grid) for i in range(grid.height)]


def _row(frame: Frame, plane: Any, start: Any, grid: Grid) -> list[Any]:
    """`grid.width` values of a plane from padded pixel `start` on."""
    index, values = plane * (frame.rows * frame.pitch) + start, []
    for offset in range(0, grid.width, PACKET):
        values += _packet(frame.h, index + offset, PACKET)
    return values[: grid.width]


def _packet(source: Any, index: Any, size: int) -> list[Any]:
    packet = dr.gather(arrays().ArrayXf, source, index, shape=(size, dr.width(index)))
    return [packet[i] for i in range(size)]


def _distances(here: list[list[Any]], there: list[list[Any]], noise: Any, grid: Grid) -> list[Any]:
    """Squared distance of each pixel's patch in two windows, less what noise alone makes, 0 or more."""
    down, across = grid.step
    row_sums = []
    for row, moved in zip(here, there, strict=True):
        differences = [x - y for x, y in zip(row, moved, strict=True)]
        row_sums.append([_sum_of_squares(differences[c * across :][: grid.patch]) for c in range(grid.columns)])
    totals = [
        sum((row_sums[r * down + i][c] for i in range(1, grid.patch)), row_sums[r * down][c])
        for r in range(grid.rows)
        for c in range(grid.columns)
    ]
    return [dr.maximum(total - noise, 0.0) for total in totals]


def _sum_of_squares(values: list[Any]) -> Any:
    total = dr.square(values[0])
    for value in values[1:]:
        total = dr.fma(value, value, total)
    return total


def _inside(frame: Frame, row: Any, column: Any, grid: Grid) -> list[Any]:
    """Whether each y lies in the frame: Omega ends at its border."""
    jit = arrays()  # unsigned, a negative coordinate is a large one
    rows = [jit.UInt(row + r * grid.step[0]) < frame.height for r in range(grid.rows)]
    columns = [jit.UInt(column + c * grid.step[1]) < frame.width for c in range(grid.columns)]
    return [r & c for r in rows for c in columns]


def _samples(frame: Frame, start: Any, grid: Grid) -> list[tuple[Any, Any]]:
    """Electrons and alpha at each y."""
    pixels = []
    for r in range(grid.rows):
        packet = _packet(frame.samples, start + (r * grid.step[0]) * frame.pitch, samples_size(grid))
        pixels += [(packet[c], packet[grid.columns + c]) for c in range(grid.columns)]
    return pixels


def samples_size(grid: Grid) -> int:
    """Floats that `Frame.samples` holds for one pixel: a power of two, as packets are."""
    return int(2 ** (2 * grid.columns - 1).bit_length())


def _beta_squared(judged: tuple[Any, ...], alpha: Any) -> Any:
    """Square of eq. (5): expanded, it needs one square root."""
    if len(judged) == 1:
        return judged[0]
    band, white = judged
    rest = 1.0 - alpha
    cross = 2.0 * alpha * rest * dr.sqrt(band * white)
    return dr.fma(dr.square(alpha), band, dr.fma(dr.square(rest), white, cross))


def _accumulate(sums: tuple[Any, ...], log_weight: Any, electrons: Any) -> tuple[Any, ...]:
    """Add one sample to the sums of eqs. (1) and (3); the largest weight stays 1, so W_y is never 0."""
    largest, weight, square, value = sums
    ahead = log_weight - largest
    smaller = dr.exp2(-dr.abs(ahead))  # one exponential: of the two weights the larger is 1
    is_larger = ahead > 0.0
    old, new = dr.select(is_larger, smaller, 1.0), dr.select(is_larger, 1.0, smaller)
    return (
        dr.maximum(largest, log_weight),
        dr.fma(weight, old, new),
        dr.fma(square, dr.square(old), dr.square(new)),
        dr.fma(value, old, new * electrons),
    )
