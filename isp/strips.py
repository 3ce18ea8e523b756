"""Strips of a frame: what the kernel reads, laid out for it, a few rows at a time so that memory stays bounded.

A strip's arrays begin at frame row `top` and column `left`. What belongs to a patch's centre (samples, alpha, decay) is
stored where the patch begins. Nothing in a strip depends on where the strip begins or ends.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from isp.interpolation import certainty
from isp.lane_shape import TOGETHER, packet_rows, packet_width, whole_packets
from isp.planes import fill, judged_mosaic
from isp.settings import WINDOW, Settings
from isp.similarity import reliability, saturated_fraction, saturation_dn
from isp.tiles import Pattern, lane_size
from sensor.raw import RawImage

STRIP_BYTES = 1_200_000_000  # of all that a strip takes: three megapixels of RGBW
ALIGNMENT = 64  # bytes; Dr.Jit compiles another kernel for memory that isn't aligned, and refuses it packet loads

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
    white_dn : (n, w) float32 or None
        W's plane of them; None without W.
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
    white_dn: Array | None
    alpha: Array | None


def strip_rows(shape: tuple[int, int], pattern: Pattern, patch: int) -> int:
    """Rows of strips that take STRIP_BYTES or less, as even as whole lanes allow."""
    lane, cells = lane_size(pattern), pattern.size[0] * pattern.size[1]
    packed = cells * (2 * packet_width(lane[1], patch) + 3 * whole_packets(lane[1]))
    floats = 4 * cells + packed / pattern.size[1] + 4 * len(pattern.letters) + 8
    most, lanes = max(int(STRIP_BYTES / (4 * floats * shape[1])) // lane[0], 1), -(-shape[0] // lane[0])
    return -(-lanes // -(-lanes // most)) * lane[0]


def make_strip(
    raw: RawImage, rows: tuple[int, int], columns: tuple[int, int], pattern: Pattern, settings: Settings
) -> Strip:
    """Lay out room for all patches: Omega and half a patch around lanes that begin up to a tile early."""
    half, size, lane = settings.patch // 2, pattern.size, lane_size(pattern)
    around, pair = settings.reach + half, packet_rows(size[0])
    # Groups begin where lanes' patches around y do, whose first pixels are at the pattern's start.
    top, left = (part[0] - (step - 1) - around for part, step in zip((rows, columns), size, strict=True))
    top, left = top - (top + half - pattern.start[0]) % pair, left - (left + half - pattern.start[1]) % size[1]
    height = -(-(rows[1] + lane[0] + around + (TOGETHER - 1) * size[0] - top) // pair) * pair
    groups = -(-(columns[1] + lane[1] + around - left) // size[1]) + packet_width(lane[1], settings.patch)
    # Half a patch or window for their sums, and twice a tile for tents, from a row with the phase of the frame's first.
    margin = max(half, WINDOW // 2) + 2 * max(size)
    ends = top + height + margin, left + groups * size[1] + margin
    last = [min(end, length) for end, length in zip(ends, raw.shape, strict=True)]
    first = [
        max(min(start - margin, end - 2 * margin), 0) // step * step
        for start, end, step in zip((top, left), last, size, strict=True)
    ]
    part = replace(raw, dn=raw.dn[first[0] : last[0], first[1] : last[1]])
    dn = part.dn.astype(np.float32)
    white_dn = fill(dn, raw.cfa, "W") if pattern.white is not None else None
    alpha = None
    if white_dn is not None and float(white_dn.max()) >= saturation_dn(raw):
        alpha = saturated_fraction(part)
    judged = judged_mosaic(_electrons(part, dn), part, settings.distance)
    place = rows, columns, top, left, height, groups
    return Strip(pattern, settings, *place, part, first[0], first[1], dn, judged, white_dn, alpha)


def plane_groups(strip: Strip, slots: list[tuple[int, int]]) -> Array:
    """Planes h_i for `isp.kernel.Frame.h`: a letter's number and the cell at which groups begin, for each slot."""
    width = packet_width(lane_size(strip.pattern)[1], strip.settings.patch)
    result = _empty_groups(strip, len(slots), width)
    for number in {letter for letter, _ in slots}:
        plane = fill(strip.judged, strip.part.cfa, strip.pattern.letters[number])
        for target, (letter, cell) in zip(result, slots, strict=True):
            if letter == number:
                _group(plane, strip, 0, cell, None, target)
    return result


def centre_groups(values: Array, strip: Strip, cells: list[int], outside: float | None = None) -> Array:
    """Values at patches' centres for `isp.kernel.Frame`, groups beginning at each of some cells."""
    result = _empty_groups(strip, len(cells), whole_packets(lane_size(strip.pattern)[1]))
    for target, cell in zip(result, cells, strict=True):
        _group(values, strip, strip.settings.patch // 2, cell, outside, target)
    return result


def decay(strip: Strip) -> Array:
    """log2(e) r(x) c(x) / (2 sigma_s^2) at each pixel of the strip's part: `reliability` times `certainty`."""
    factor = np.float32(np.log2(np.e) / (2.0 * strip.settings.sigma_s**2))
    if strip.settings.distance == "raw":
        return np.full(strip.dn.shape, factor)
    judging_dn = strip.dn if strip.white_dn is None else strip.white_dn
    reliable = reliability(_electrons(strip.part, judging_dn), strip.part.dark_noise_e, WINDOW)
    return np.asarray(reliable * certainty(strip.judged, strip.part.cfa, strip.settings.patch) * factor)


def _electrons(raw: RawImage, dn: Array) -> Array:
    return np.asarray((dn - np.float32(raw.black_dn)) * np.float32(raw.gain_e_per_dn))


def _empty_groups(strip: Strip, count: int, width: int) -> Array:
    pair = packet_rows(strip.pattern.size[0])
    return aligned((count, strip.height // pair, strip.groups, pair, width), np.float32)


def _group(values: Array, strip: Strip, shift: int, cell: int, outside: float | None, target: Array) -> None:
    """Fill groups with a part of the frame, beyond whose border stands `outside`, or its reflection for patches."""
    half, across, (_, groups, pair, width) = strip.settings.patch // 2, strip.pattern.size[1], target.shape
    first = (
        strip.top + shift + cell // across - strip.first_row,
        strip.left + shift + cell % across - strip.first_column,
    )
    count = strip.height, groups * across + width
    rows, columns = (_reflected(*line, half) for line in zip(first, count, values.shape, strict=True))
    before, start = max(-first[1], 0), max(first[1], 0)
    size = min(values.shape[1] - start, len(columns) - before)
    spread = np.empty((len(rows), len(columns)), np.float32)
    spread[:, before : before + size] = values[rows, start : start + size]
    for beside in (slice(before), slice(before + size, None)):
        spread[:, beside] = values[rows[:, None], columns[beside]]
    if outside is not None:
        spread[: max(-first[0], 0)] = spread[max(len(values) - first[0], 0) :] = outside
        spread[:, :before] = spread[:, before + size :] = outside
    windows = np.lib.stride_tricks.sliding_window_view(spread, width, axis=1)[:, ::across][:, :groups]
    target[:] = windows.reshape(-1, pair, groups, width).swapaxes(1, 2)


def _reflected(first: int, count: int, size: int, most: int) -> NDArray[np.intp]:
    """Places 0 to size - 1 for `count` places from `first` on; reflected up to `most` beyond, then the last."""
    places = np.pad(np.arange(size), most, mode="reflect" if size > 1 else "edge")
    return np.asarray(places[np.clip(np.arange(first, first + count) + most, 0, len(places) - 1)])


def aligned(shape: tuple[int, ...], kind: Any) -> Array:
    """Empty array that Dr.Jit takes as it is."""
    size = int(np.prod(shape)) * np.dtype(kind).itemsize
    memory = np.empty(size + ALIGNMENT, dtype=np.uint8)
    start = -memory.ctypes.data % ALIGNMENT
    return np.asarray(memory[start : start + size].view(kind).reshape(shape))
