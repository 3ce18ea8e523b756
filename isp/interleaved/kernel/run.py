"""The reconstruction of a frame, one strip after the other.

Kernels run beside Python. Therefore each strip is started before the one above it is finished: NumPy prepares it while
the kernels of that other strip still run.
"""

from dataclasses import dataclass, replace
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from isp.interleaved.kernel.accumulate import HEADROOM
from isp.interleaved.kernel.kernel import KernelSums, Shape, launch
from isp.interleaved.kernel.layout import Inputs, Span, cut_strip, lay_out, strip_rows
from isp.interleaved.kernel.schedule import Guide, Pattern, Threads, list_threads, make_pattern
from isp.settings import Settings
from rodcone.device_arrays import upload
from rodcone.jit import Float, Mask, UInt, arrays, dr
from sensor.raw import RawImage


@dataclass(frozen=True)
class Launch:
    """Running threads, and which of them must run again in units of the largest weight so far."""

    inputs: Inputs
    threads: Threads
    shape: Shape
    failed: Mask


@dataclass(frozen=True)
class StartedStrip:
    """A strip whose kernels run: its rows of the frame, the arrays of their sums, and the launches."""

    rows: Span
    sums: KernelSums
    launches: list[Launch]


def reconstruct_strips(
    raw: RawImage, settings: Settings, guide: NDArray[np.floating] | None
) -> list[NDArray[np.float32]]:
    """Return f_i(x) of eq. (1) [e-] and its noise gain, sum w^2 / (sum w)^2; each has the shape (h, w, channel).

    A `guide` (h, w) is the plane whose similarity weighs the samples of all channels. Without one, W's plane does that,
    and where W is saturated each channel's own plane, mixed by eq. (6).
    """
    jit = arrays()
    pattern = make_pattern(raw.cfa)
    height, width = raw.dn.shape
    shape = height, width, len(pattern.channels)
    results = [dr.empty(jit.Float, int(np.prod(shape))) for _ in range(2)]
    step = strip_rows((height, width), pattern, settings.patch)
    started = list[StartedStrip]()
    for first in range(0, height, step):
        started.append(_start(jit, raw, (first, min(first + step, height)), pattern, settings, guide))
        if len(started) > 1:
            _finish(jit, started.pop(0), raw, pattern, results)
    _finish(jit, started.pop(), raw, pattern, results)
    return [values.numpy().reshape(shape) for values in results]


def _start(
    jit: ModuleType, raw: RawImage, rows: Span, pattern: Pattern, settings: Settings, shared: NDArray[Any] | None
) -> StartedStrip:
    """Start the kernels of some rows of the frame; the first row is a whole number of blocks."""
    columns = (0, raw.dn.shape[1])
    launches = list[Launch]()
    strip = cut_strip(raw, rows, pattern, settings, shared)
    sums = _empty_sums(jit, rows, columns[1], pattern)
    work = list_threads(pattern, strip.shape, rows, strip.alpha, strip.origin[0], settings.reach)
    # Threads with a shared guide read only that plane. For the others, which are mostly few, all planes around them are
    # laid out.
    for guides in (["shared"], ["channel", "mixed"]):
        kinds: list[Guide] = [guide for guide in work if guide in guides and len(work[guide].row)]
        if not kinds:
            continue
        first_rows, first_columns = (
            np.concatenate([getattr(work[guide], name) for guide in kinds]) for name in ("row", "column")
        )
        region = (
            (max(int(first_rows.min()), rows[0]), min(int(first_rows.max()) + pattern.block[0], rows[1])),
            (max(int(first_columns.min()), 0), min(int(first_columns.max()) + pattern.block[1], columns[1])),
        )
        inputs = lay_out(jit, strip, region, pattern, settings, kinds[0])
        for guide in kinds:
            shape = Shape(tile=pattern.tile, block=pattern.block, patch=settings.patch, guide=guide, running=False)
            threads = Threads(**{name: upload(values) for name, values in vars(work[guide]).items()})
            failed = launch(jit, inputs, threads, shape, sums)
            launches.append(Launch(inputs=inputs, threads=threads, shape=shape, failed=failed))
    return StartedStrip(rows=rows, sums=sums, launches=launches)


def _empty_sums(jit: ModuleType, rows: Span, width: int, pattern: Pattern) -> KernelSums:
    """Allocate arrays for the results of the blocks of all phases, with the unit of the fixed scale."""
    # Whole blocks cover the strip and the tile - 1 rows and columns by which phases begin early.
    size = [
        -(-(length + tile - 1) // block) * block
        for length, tile, block in zip((rows[1] - rows[0], width), pattern.tile, pattern.block, strict=True)
    ]
    count = len(pattern.cells) * size[0] * size[1]
    return KernelSums(
        weight=dr.empty(jit.Float, count),
        unit=dr.full(jit.Float, -HEADROOM, count),
        mean=dr.empty(jit.Float, count),
        noise_gain=dr.empty(jit.Float, count),
        first_row=dr.opaque(jit.Int, rows[0]),
        rows=dr.opaque(jit.Int, size[0]),
        columns=dr.opaque(jit.Int, size[1]),
    )


def _finish(jit: ModuleType, started: StartedStrip, raw: RawImage, pattern: Pattern, results: list[Float]) -> None:
    """Write the estimate and noise gain of a strip into the frame's results, [row, column, channel]."""
    for one in started.launches:
        again: UInt = dr.compress(one.failed)  # this waits until the launch has finished
        if dr.width(again):
            threads = Threads(**{name: dr.gather(type(part), part, again) for name, part in vars(one.threads).items()})
            dr.eval(vars(threads))
            launch(jit, one.inputs, threads, replace(one.shape, running=True), started.sums)

    (down, across), (first, last), sums = pattern.tile, started.rows, started.sums
    width = dr.opaque(jit.Int, raw.dn.shape[1])
    gain_e_per_dn = dr.opaque(jit.Float, raw.gain_e_per_dn)
    pixel = dr.arange(jit.Int, (last - first) * raw.dn.shape[1])
    row, column = pixel // width, pixel % width
    stored = [sums.weight, sums.unit, sums.mean, sums.noise_gain]
    planes = list[list[Float]]()
    for channel in range(len(pattern.channels)):
        parts = []
        for cell in (cell for cell, number in enumerate(pattern.cells) if number == channel):
            # The y = x + d at a cell belong to phase (a, b) = cell - x, modulo the tile.
            a, b = (cell // across + down - row % down) % down, (cell % across + across - column % across) % across
            # Their sums are at [phase, row, column], (phase * rows + row + a) * columns + column + b.
            index = ((a * across + b) * sums.rows + row + a) * sums.columns + column + b
            parts.append([dr.gather(jit.Float, array, jit.UInt(index)) for array in stored])
        mean, noise_gain = _merge(parts)
        planes.append([mean * gain_e_per_dn, noise_gain])
    index = jit.UInt(pixel + dr.opaque(jit.Int, first * raw.dn.shape[1]))
    for result, values in zip(results, zip(*planes, strict=True), strict=True):
        dr.scatter(result, jit.ArrayXf([*values]), index, mode=dr.ReduceMode.NoConflicts)
    dr.eval(results)


def _merge(parts: list[list[Float]]) -> list[Float]:
    """Merge the means and noise gains of the samples at several cells, whose weights have different units."""
    if len(parts) == 1:
        return parts[0][2:]
    common = parts[0][1]
    for _, unit, *_ in parts[1:]:
        common = dr.maximum(common, unit)
    weights = [weight * dr.exp2(unit - common) for weight, unit, *_ in parts]
    total = sum(weights[1:], weights[0])
    shares = [weight / total for weight in weights]
    mean = sum(share * part[2] for share, part in zip(shares, parts, strict=True))
    return [mean, sum(dr.square(share) * part[3] for share, part in zip(shares, parts, strict=True))]
