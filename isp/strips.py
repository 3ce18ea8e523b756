"""Strips of a frame: what the kernel reads, laid out for it, a few rows at a time so that memory stays bounded.

A strip's arrays begin at frame row `top` and column `left`. What belongs to a patch's centre (samples, alpha, decay) is
stored where the patch begins. Nothing in a strip depends on where the strip begins or ends.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from isp.interpolation import certainty
from isp.lane_shape import MOST_TOGETHER, packet_rows, row_parts, whole_packets
from isp.planes import fill, judged_mosaic
from isp.settings import WINDOW, Settings
from isp.similarity import reliability, saturated_fraction
from isp.tiles import Pattern, lane_size
from rodcone.jit import arrays
from sensor.raw import RawImage

STRIP_BYTES = 600_000_000  # of all that a strip takes: one and a half megapixels of RGBW
ALIGNMENT = 64  # bytes; Dr.Jit compiles another kernel for memory that isn't aligned, and refuses it packet loads
FAR = 1e13  # h_i where y lies outside the frame: ten thousand times as far as a billion electrons
LEAST_DECAY = np.float32(2e-24)  # times FAR^2 2^-200; times 25 squares of a billion electrons 2^-0.00005

Array = NDArray[Any]


@dataclass(frozen=True)
class Strip:
    """Some rows of a frame, and where their arrays lie.

    Attributes
    ----------
    pattern : Pattern
    settings : Settings
    rows, columns : (int, int)
        First and past the last row and column to reconstruct.
    top, left : int
        Row and column of the frame where the arrays begin; may be negative.
    height, groups : int
        Rows of the arrays, and groups of packets in a row.
    part : RawImage
        The part of the mosaic that the arrays depend on.
    first_row, first_column : int
        Where in the frame `part` begins.
    dn : (n, w) float32
        Its digital numbers.
    judged : (n, w) float32
        Its mosaic as patches are read from it (`isp.planes.judged_mosaic`).
    alpha : (n, w) float64 or None
        Eq. (6); None where it is 0 everywhere, or without W.
    """

    pattern: Pattern
    settings: Settings
    rows: tuple[int, int]
    columns: tuple[int, int]
    top: int
    left: int
    height: int
    groups: int
    part: RawImage
    first_row: int
    first_column: int
    dn: Array
    judged: Array
    alpha: Array | None


def strip_rows(shape: tuple[int, int], pattern: Pattern, patch: int) -> int:
    """Rows of strips that take STRIP_BYTES or less, as even as whole lanes allow."""
    lane, cells = lane_size(pattern), pattern.size[0] * pattern.size[1]
    planes = sum(width for _, width in row_parts(lane[1], patch, pattern.size[1]))
    packed = cells * (2 * planes + 3 * whole_packets(lane[1]))
    floats = 4 * cells + packed / pattern.size[1] + 4 * len(pattern.letters) + 8
    most, lanes = max(int(STRIP_BYTES / (4 * floats * shape[1])) // lane[0], 1), -(-shape[0] // lane[0])
    return -(-lanes // -(-lanes // most)) * lane[0]


def make_strip(
    raw: RawImage, rows: tuple[int, int], columns: tuple[int, int], pattern: Pattern, settings: Settings
) -> Strip:
    """Lay out room for all patches: Omega and half a patch around lanes that begin up to a tile early."""
    place, first, last = _room(raw.shape, rows, columns, pattern, settings)
    part = replace(raw, dn=raw.dn[first[0] : last[0], first[1] : last[1]])
    dn = part.dn.astype(np.float32)
    alpha = saturated_fraction(part) if pattern.white is not None else None
    if alpha is not None and not alpha.any():
        alpha = None
    judged = judged_mosaic(_electrons(part, dn), part, settings.distance)
    return Strip(pattern, settings, rows, columns, *place, part, *first, dn, judged, alpha)


def crop(strip: Strip, shape: tuple[int, int], rows: tuple[int, int], columns: tuple[int, int]) -> Strip:
    """Room for fewer rows and columns of a frame of some shape, with what the strip holds already."""
    (top, left, height, groups), first, last = _room(shape, rows, columns, strip.pattern, strip.settings)
    at = _within(strip, first, last)
    return replace(
        strip,
        rows=rows,
        columns=columns,
        top=top,
        left=left,
        height=height,
        groups=groups,
        part=replace(strip.part, dn=strip.part.dn[at]),
        first_row=first[0],
        first_column=first[1],
        dn=strip.dn[at],
        judged=strip.judged[at],
        alpha=None if strip.alpha is None else strip.alpha[at],
    )


def part_of(values: Array, strip: Strip, part: Strip) -> Array:
    """Of values at each pixel of a strip's part of the mosaic those that belong to a crop of it."""
    first = part.first_row, part.first_column
    return values[_within(strip, first, (first[0] + part.dn.shape[0], first[1] + part.dn.shape[1]))]


def _within(strip: Strip, first: tuple[int, int], last: tuple[int, int]) -> tuple[slice, slice]:
    """Where rows and columns of the frame lie in the strip's part of the mosaic."""
    row, column = strip.first_row, strip.first_column
    return slice(first[0] - row, last[0] - row), slice(first[1] - column, last[1] - column)


def _room(
    shape: tuple[int, int], rows: tuple[int, int], columns: tuple[int, int], pattern: Pattern, settings: Settings
) -> tuple[tuple[int, int, int, int], tuple[int, int], tuple[int, int]]:
    """First row and column, rows and groups of a strip's arrays; where its part of the mosaic begins and ends."""
    half, size, lane = settings.patch // 2, pattern.size, lane_size(pattern)
    around, pair = settings.reach + half, packet_rows(size[0])
    # Groups begin where lanes' patches around y do, whose first pixels are at the pattern's start.
    top, left = (part[0] - (step - 1) - around for part, step in zip((rows, columns), size, strict=True))
    top, left = top - (top + half - pattern.start[0]) % pair, left - (left + half - pattern.start[1]) % size[1]
    height = -(-(rows[1] + lane[0] + around + (MOST_TOGETHER - 1) * size[0] - top) // pair) * pair
    groups = -(-(columns[1] + lane[1] + around - left) // size[1]) + lane[1] + settings.patch
    # Half a patch or window for their sums, and twice a tile for tents, from a row with the phase of the frame's first.
    margin = max(half, WINDOW // 2) + 2 * max(size)
    last = min(top + height + margin, shape[0]), min(left + groups * size[1] + margin, shape[1])
    row, column = (
        max(min(start - margin, end - 2 * margin), 0) // step * step
        for start, end, step in zip((top, left), last, size, strict=True)
    )
    return (top, left, height, groups), (row, column), last


def plane_groups(strip: Strip, slots: list[tuple[int, int]]) -> list[Array]:
    """Planes h_i for `isp.kernel.Frame.h`: a letter's number and the cell at which groups begin, for each slot.

    Patches read them by reflection up to half a patch beyond the frame; further on they are FAR.
    """
    pattern, patch = strip.pattern, strip.settings.patch
    parts = row_parts(lane_size(pattern)[1], patch, pattern.size[1])
    results = [_empty_groups(strip, len(slots), width) for _, width in parts]
    for number in {letter for letter, _ in slots}:
        plane = fill(strip.judged, strip.part.cfa, pattern.letters[number])
        for k, (letter, cell) in enumerate(slots):
            for result, (first, _) in zip(results, parts, strict=True):
                if letter == number:
                    _group(plane, strip, (0, first), cell, patch // 2, FAR, result[k])
    return results


def centre_groups(values: Array, strip: Strip, cells: list[int]) -> Array:
    """Values at patches' centres for `isp.kernel.Frame`, groups beginning at each of some cells; 0 beyond the frame."""
    result = _empty_groups(strip, len(cells), whole_packets(lane_size(strip.pattern)[1]))
    for target, cell in zip(result, cells, strict=True):
        _group(values, strip, (strip.settings.patch // 2,) * 2, cell, 0, 0.0, target)
    return result


def decay(strip: Strip) -> Array:
    """log2(e) r(x) c(x) / (2 sigma_s^2) at each pixel of the strip's part: `reliability` times `certainty`.

    LEAST_DECAY or more, for what is FAR to count as nothing even where similarity is not trusted at all.
    """
    factor = np.float32(np.log2(np.e) / (2.0 * strip.settings.sigma_s**2))
    if strip.settings.distance == "raw":
        return np.full(strip.dn.shape, max(factor, LEAST_DECAY), np.float32)
    judging_dn = strip.dn if strip.pattern.white is None else fill(strip.dn, strip.part.cfa, "W")
    result = reliability(_electrons(strip.part, judging_dn), strip.part.dark_noise_e, WINDOW)
    result *= certainty(strip.judged, strip.part.cfa, strip.settings.patch)
    result *= factor
    return np.asarray(np.maximum(result, LEAST_DECAY, out=result))


def _electrons(raw: RawImage, dn: Array) -> Array:
    return np.asarray((dn - np.float32(raw.black_dn)) * np.float32(raw.gain_e_per_dn))


def _empty_groups(strip: Strip, count: int, width: int) -> Array:
    pair = packet_rows(strip.pattern.size[0])
    return aligned((count, strip.height // pair, strip.groups, pair, width), np.float32)


def _group(
    values: Array, strip: Strip, shift: tuple[int, int], cell: int, most: int, outside: float, target: Array
) -> None:
    """Fill groups with a part of the frame, reflected up to `most` beyond its border; `outside` further on."""
    across, (_, groups, pair, width) = strip.pattern.size[1], target.shape
    first = (
        strip.top + shift[0] + cell // across - strip.first_row,
        strip.left + shift[1] + cell % across - strip.first_column,
    )
    spread = _spread(values, first, (strip.height, groups * across + width), most, outside)
    # A group's values of one row as one item: they lie side by side in both arrays, and one copy is made of each.
    item, line = np.dtype((np.void, 4 * width)), spread.strides[0]
    windows = np.ndarray((strip.height // pair, groups, pair), item, spread, 0, (pair * line, 4 * across, line))
    target.view(item)[..., 0] = windows


def _spread(values: Array, first: tuple[int, int], count: tuple[int, int], most: int, outside: float) -> Array:
    """`count` rows and columns of an array from `first` on, as `_group` wants them."""
    result, sources = np.full(count, outside, np.float32), []
    within, inside, own = list[slice](), list[slice](), list[slice]()
    for start, number, size in zip(first, count, values.shape, strict=True):
        # A packet may begin beyond a narrow frame: none of its places is inside then.
        begin = max(start, -most)
        end = max(min(start + number, size + most), begin)
        low = max(begin, 0)
        high = max(min(end, size), low)
        places = np.pad(np.arange(size), most, mode="reflect" if size > 1 else "edge")
        within.append(slice(begin - start, end - start))
        inside.append(slice(low - begin, high - begin))
        own.append(slice(low, high))
        sources.append(places[begin + most : end + most])
    target, (rows, columns) = result[within[0], within[1]], sources
    target[inside[0], inside[1]] = values[own[0], own[1]]
    for beside in (slice(inside[0].start), slice(inside[0].stop, None)):
        target[beside, inside[1]] = values[rows[beside], own[1]]
    for beside in (slice(inside[1].start), slice(inside[1].stop, None)):
        target[:, beside] = values[rows[:, None], columns[beside]]
    return result


def aligned(shape: tuple[int, ...], kind: Any) -> Array:
    """Empty array that Dr.Jit takes as it is."""
    size = int(np.prod(shape)) * np.dtype(kind).itemsize
    memory = np.empty(size + ALIGNMENT, dtype=np.uint8)
    start = -memory.ctypes.data % ALIGNMENT
    return np.asarray(memory[start : start + size].view(kind).reshape(shape))


def upload(values: NDArray[Any]) -> Any:
    """Evaluated Dr.Jit array of the same type, in aligned memory."""
    jit = arrays()
    kinds = {"f": jit.Float, "u": jit.UInt, "i": jit.Int}
    if values.ctypes.data % ALIGNMENT:
        memory = aligned(values.shape, values.dtype)
        memory[:] = values
        values = memory
    return kinds[values.dtype.kind](values.ravel())
