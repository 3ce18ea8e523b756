"""Layout of a strip in memory for the kernel's loads. A strip is some rows of a frame, so that memory stays bounded.

            left                                                                     right
      top    +------------------------------------------------------------------------+
             |  halo: blocks begin up to tile - 1 early, y lie up to the reach away    |
    rows[0] -|     +--------+--------+--------+- - -+                                  |
             |     | block  | block  | block  |     |  blocks of phase (0, 0), 8 x 4   |
             |     |        |        |        |     |  pixels; those of phase (a, b)   |
             |     +--------+--------+--------+- - -+  begin a rows and b columns      |
             |     | x----------->y           |     |  early                           |
             |     |        | d = y - x       |     |                                  |
             |     +--------+--------+--------+- - -+                                  |
    rows[1] -|     :        :        :        :     :                                  |
             |  halo: the rest of the last blocks, the reach, patch - 1                |
    bottom   +------------------------------------------------------------------------+

    A row:      h0 h1 h2 h3 h4 h5 ...  of a plane,  s0 s1 s2 s3 s4 s5 ...  samples
    Packets:    |h0 h1 h2 h3 s0 s1 s2 s3|h2 h3 h4 h5 s2 s3 s4 s5| ...      (block 4 wide, patch 1, every 2nd column)

A packet holds all that a thread reads in a row of y: the plane under the patches of its block, and the block's samples.
If one plane guides all channels, a packet holds two rows (h of both, then s of both), which fill a line of the cache.
At x, which a thread reads once, planes are read pixel by pixel. The addresses, with `packet_step` = (down, across),
are:
    pixel   (row - top) * stride + column - left
    packet  (row - top) / down * row_packets + (column - left) / across

Planes are stored half a patch early, so that a pixel's address is where its patch begins. Beyond the frame they
continue by reflection for half a patch, and are OUTSIDE further on. Nothing in a strip depends on where it begins or
ends.
"""

from dataclasses import dataclass
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from isp.interleaved.brightest import brightest_allowed
from isp.interleaved.kernel.accumulate import LEAST_INVERSE_VARIANCE, OUTSIDE
from isp.interleaved.kernel.schedule import Guide, Pattern, list_offsets
from isp.interleaved.saturation import fraction_of_full
from isp.planes import fill
from isp.settings import Settings
from rodcone.device_arrays import aligned, upload
from rodcone.jit import Float, Int, UInt, dr
from sensor.raw import RawImage, full_at_sites

STRIP_BYTES = 300_000_000  # memory of a strip, 0.75 megapixels of RGBW; larger arrays would be allocated anew each time

Array = NDArray[Any]
Span = tuple[int, int]  # first of some rows or columns, and one past the last


@dataclass(frozen=True)
class Strip:
    """The part of a frame on which some of its rows depend, pixel by pixel.

    Attributes
    ----------
    shape : (int, int)
        Height and width of the whole frame [pixels].
    origin : (int, int)
        Row and column of the frame where the arrays begin, a whole number of tiles from its corner.
    samples : (h, w) float32
        Mosaic above black [DN].
    electrons : (h, w) float32
        Mosaic [e-], from which the paper's planes h_i are filled.
    guide : (h, w) float32 or None
        The plane from which all patches are read; None if each channel has its own.
    alpha : (h, w) float64 or None
        Eq. (6); None if it is 0 everywhere, or one plane guides all channels.
    brightest : (th, tw, h, w) float32
        Upper limit of the samples that count, by `isp.interleaved.brightest` [DN above black].
    """

    shape: tuple[int, int]
    origin: tuple[int, int]
    samples: Array
    electrons: Array
    guide: Array | None
    alpha: Array | None
    brightest: Array


@dataclass(frozen=True)
class Inputs:
    """Evaluated Dr.Jit arrays that all threads of a kernel read.

    Attributes
    ----------
    planes, brightest : Float
        Arrays that are read at x: planes h_i, or the shared one, [channel, row, column]; limits [phase, row, column].
    inverse_variance : Float
        log2(e) / (2 sigma_s^2), the factor on beta_s^2 of eq. (5).
    packets : Float
        Array that is read at y: [channel, row, packet, value].
    alpha : Float
        Packets of alpha, [row, packet, value]. None with a shared guide, or if alpha is 0 everywhere.
    entries, counts : Float, UInt
        Result of `isp.interleaved.kernel.schedule.list_offsets`.
    length : UInt
        Number of entries for which a list has room.
    packet_rows, packet_columns : int
        Result of `packet_step`.
    packet_values, alpha_values, entry_values : int
        Number of floats in a packet, in a packet of alpha, and in an entry.
    top, left : Int
        Row and column of the frame where the arrays begin.
    stride, row_packets, plane_size, plane_packets : UInt
        Number of pixels and of packets in a row, and in a plane.
    white : UInt
        Number of W's plane, or of the shared one.
    height, width : UInt
        Size of the whole frame.
    """

    planes: Float
    brightest: Float
    inverse_variance: Float
    packets: Float
    alpha: Float | None
    entries: Float
    counts: UInt
    length: UInt
    packet_rows: int
    packet_columns: int
    packet_values: int
    alpha_values: int
    entry_values: int
    top: Int
    left: Int
    stride: UInt
    row_packets: UInt
    plane_size: UInt
    plane_packets: UInt
    white: UInt
    height: UInt
    width: UInt


def packet_width(count: int) -> int:
    """Round `count` up to a power of two up to 8, or to a multiple of 8, because an AVX register holds 8 floats."""
    return int(2 ** (count - 1).bit_length()) if count <= 8 else -(-count // 8) * 8


def strip_rows(shape: tuple[int, int], pattern: Pattern, patch: int) -> int:
    """Return the height of strips that take at most STRIP_BYTES and are as even as whole blocks allow."""
    channels = len(pattern.channels)
    block = pattern.block
    # Planes and packets, packets of alpha, limits and three sums per cell of the tile, results, and the strip itself.
    floats = channels * (packet_width(2 * block[1] + patch - 1) + 1) + packet_width(block[1])
    floats += 5 * len(pattern.cells) + 2 * channels + 10
    most = max(int(STRIP_BYTES / (4 * floats * shape[1])) // block[0], 1)
    blocks = -(-shape[0] // block[0])
    return -(-blocks // -(-blocks // most)) * block[0]


def cut_strip(raw: RawImage, rows: Span, pattern: Pattern, settings: Settings, guide: Array | None) -> Strip:
    """Cut out the part of a frame on which some rows depend; without a `guide` each channel has the paper's plane."""
    shape = raw.dn.shape
    part = _surroundings(shape, halo((rows, (0, shape[1])), pattern, settings), pattern, settings)
    dn = raw.dn[part]
    black, gain = np.float32(raw.black_dn), np.float32(raw.gain_e_per_dn)
    alpha = None
    if guide is None:
        full = full_at_sites(raw, dn)
        alpha = fraction_of_full(full, raw.cfa, settings.patch) if pattern.white is None or full.any() else None
    dn = dn.astype(np.float32)
    samples = dn - black
    electrons = (dn - black) * gain
    bounds = brightest_allowed(electrons, raw, settings)
    return Strip(
        shape=(shape[0], shape[1]),
        origin=(part[0].start, part[1].start),
        samples=samples,
        electrons=electrons,
        guide=None if guide is None else guide[part],
        alpha=alpha,
        brightest=np.divide(bounds, gain, out=bounds),
    )


def halo(region: tuple[Span, Span], pattern: Pattern, settings: Settings) -> tuple[Span, Span]:
    """Return the rows (top, bottom) and columns (left, right) of a region's arrays; they may lie beyond the frame.

    Blocks begin up to tile - 1 before the region and end up to block - 1 after it, and their y are up to the reach
    away. The arrays begin with a whole tile. Planes are stored half a patch early, so that patches end up to patch - 1
    later.
    """
    spans = list[Span]()
    for (first, last), tile, block in zip(region, pattern.tile, pattern.block, strict=True):
        start = (first - (tile - 1) - settings.reach) // tile * tile
        end = last + (block - 1) + settings.reach + (settings.patch - 1)
        spans.append((start, end + -(end - start) % tile))
    return spans[0], spans[1]


def lay_out(
    jit: ModuleType, strip: Strip, region: tuple[Span, Span], pattern: Pattern, settings: Settings, guide: Guide
) -> Inputs:
    """Fill planes, make packets and upload all that the threads of a region of the strip read."""
    (top, bottom), (left, right) = spans = halo(region, pattern, settings)
    # Find the part of the strip that counts, and where the arrays begin in it.
    part = _surroundings(strip.shape, spans, pattern, settings)
    box = tuple(slice(at.start - first, at.stop - first) for at, first in zip(part, strip.origin, strict=True))
    start, size = (top - part[0].start, left - part[1].start), (bottom - top, right - left)
    half = settings.patch // 2
    block = pattern.block[1]
    names = pattern.channels if guide != "shared" else ["W"]  # channels whose planes are laid out
    samples = _window(strip.samples[box], start, (size[0], size[1] + block), 0, 0.0)

    # A packet holds one or two rows of a plane under the patches of a block, then as many rows of the block's samples.
    down, across = packet_step(pattern, guide)
    row_packets = size[1] // across
    under = block + settings.patch - 1
    planes = aligned((len(names), *size), np.float32)
    packets = aligned((len(names), size[0] // down, row_packets, packet_width(down * (under + block))), np.float32)
    for name, plane, target in zip(names, planes, packets, strict=True):
        filled = fill(strip.electrons[box], pattern.cfa, name) if strip.guide is None else strip.guide[box]
        wide = _window(filled, (start[0] - half, start[1] - half), (size[0], size[1] + under), half, OUTSIDE)
        plane[:] = wide[:, : size[1]]
        for k in range(down):
            _put_packets(target[..., k * under : (k + 1) * under], wide[k::down], across)
            first = down * under + k * block
            _put_packets(target[..., first : first + block], samples[k::down], across)
    alpha = None
    if guide != "shared" and strip.alpha is not None:
        alpha = aligned((size[0], row_packets, packet_width(block)), np.float32)
        _put_packets(alpha[..., :block], _window(strip.alpha[box], start, (size[0], size[1] + block), 0, 0.0), across)

    offsets, counts = list_offsets(pattern, settings, guide)
    entries = np.zeros((*offsets.shape[:2], packet_width(offsets.shape[2] - 1)), np.float32)
    steps = offsets[..., 0] // down * row_packets + offsets[..., 1] // across  # packets from x to y
    entries[..., 0] = steps.astype(np.int32).view(np.float32)
    entries[..., 1] = offsets[..., 2]
    brightest = aligned((len(pattern.cells), *size), np.float32)
    for phase, target in zip(np.ndindex(pattern.tile), brightest, strict=True):
        _window(strip.brightest[phase][box], start, size, 0, 0.0, target)
    read = {"planes": planes, "packets": packets, "brightest": brightest, "entries": entries, "counts": counts}
    read |= {} if alpha is None else {"alpha": alpha}
    numbers = {
        "length": entries.shape[1],
        "stride": size[1],
        "row_packets": row_packets,
        "plane_size": size[0] * size[1],
        "plane_packets": packets.shape[1] * row_packets,
        "white": names.index("W") if "W" in names else 0,
    } | dict(zip(("height", "width"), strip.shape, strict=True))
    return Inputs(
        **{"alpha": None} | {name: upload(values) for name, values in read.items()},
        inverse_variance=dr.opaque(jit.Float, max(np.log2(np.e) / (2.0 * settings.sigma_s**2), LEAST_INVERSE_VARIANCE)),
        **{name: dr.opaque(jit.UInt, number) for name, number in numbers.items()},
        **{name: dr.opaque(jit.Int, number) for name, number in (("top", top), ("left", left))},
        packet_rows=down,
        packet_columns=across,
        packet_values=packets.shape[3],
        alpha_values=packet_width(block),
        entry_values=entries.shape[2],
    )


def packet_step(pattern: Pattern, guide: Guide) -> tuple[int, int]:
    """Return the number of rows in a packet, and of columns from one packet to the next.

    With a shared guide all y of a block begin at the tile's first column, and if the tile's height is even, at an even
    row. Two rows of planes and samples then fill one line of the cache.
    """
    return (2 if pattern.tile[0] % 2 == 0 else 1, pattern.tile[1]) if guide == "shared" else (1, 1)


def _surroundings(
    shape: tuple[int, ...], spans: tuple[Span, Span], pattern: Pattern, settings: Settings
) -> tuple[slice, slice]:
    """Extend rows and columns by those on which they depend: half a patch for sums, and twice a tile for tents."""
    margin = settings.patch // 2 + 2 * max(pattern.tile)
    rows, columns = (
        slice(max(first - margin, 0) // size * size, min(last + margin, length))
        for (first, last), size, length in zip(spans, pattern.tile, shape, strict=True)  # begins with a whole tile
    )
    return rows, columns


def _window(values: Array, start: Span, size: Span, reflected: int, outside: float, to: Array | None = None) -> Array:
    """Copy a window that may begin or end beyond the border, where values are reflected and then `outside`."""
    source = np.pad(values, reflected, mode="reflect") if reflected else values
    result = np.empty(size, np.float32) if to is None else to
    into, out_of = list[slice](), list[slice]()
    for first, count, length in zip(start, source.shape, size, strict=True):
        shift = first + reflected  # result[i] = source[i + shift]
        low = max(-shift, 0)
        high = max(min(count - shift, length), low)
        into.append(slice(low, high))
        out_of.append(slice(low + shift, high + shift))
    result[: into[0].start], result[into[0].stop :] = outside, outside
    result[into[0], : into[1].start], result[into[0], into[1].stop :] = outside, outside
    result[into[0], into[1]] = source[out_of[0], out_of[1]]
    return result


def _put_packets(target: Array, rows: Array, step: int) -> None:
    """Set target[i, p, k] = rows[i, step * p + k] for a few rows at a time, so that they stay in the cache."""
    for first in range(0, len(target), 16):
        part, source = target[first : first + 16], rows[first : first + 16]
        for k in range(target.shape[2]):
            part[..., k] = source[:, k : k + step * target.shape[1] : step]
