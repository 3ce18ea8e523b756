"""Eqs. (1) to (5) for one thread's block of pixels, in Dr.Jit for LLVM and CUDA.

Here x is a pixel to reconstruct, and y = x + d the pixel of a sample. With a shared guide, a thread owns all x of its
block and reads one plane. Otherwise it owns those whose y lie at one cell of the tile, and reads the plane of the
channel there. Therefore one compiled kernel serves all phases and cells, and all mosaics with a tile of this size. Most
of the time is spent on loading, so that at y whole rows are loaded, each as a packet
(`isp.interleaved.kernel.layout`).
"""

from dataclasses import dataclass
from types import ModuleType

from isp.interleaved.kernel.accumulate import (
    HEADROOM,
    LEAST_WEIGHT,
    Sums,
    add_samples,
    mixed_squares,
    squared_distances,
    start_sums,
)
from isp.interleaved.kernel.layout import Inputs
from isp.interleaved.kernel.schedule import Guide, Threads
from rodcone.jit import Float, Int, Mask, UInt, dr


@dataclass(frozen=True)
class Shape:
    """Sizes and options for which a kernel is compiled.

    Attributes
    ----------
    tile, block : (int, int)
        Rows and columns of the CFA's tile, and of a block.
    patch : int
        Width of the patches.
    guide : {"shared", "channel", "mixed"}
        The guiding plane: one for all channels, that of the channel at y, or a mixture of that and W's by alpha.
    running : bool
        Whether sums are in units of the largest weight so far, rather than at a fixed scale.
    """

    tile: tuple[int, int]
    block: tuple[int, int]
    patch: int
    guide: Guide
    running: bool


@dataclass(frozen=True)
class KernelSums:
    """Results of a strip's threads, as Dr.Jit arrays [phase, row, column].

    In phase (a, b) the strip's pixel (r, c) is stored at row r + a and column c + b, so that blocks are aligned.

    Attributes
    ----------
    weight, unit : Float
        Sum of the weights in units of 2^unit.
    mean : Float
        Weighted mean of the samples.
    noise_gain : Float
        Sum of the squared weights over the squared sum of the weights.
    first_row, rows, columns : Int
        The strip's first row in the frame, and the number of rows and columns of a phase.
    """

    weight: Float
    unit: Float
    mean: Float
    noise_gain: Float
    first_row: Int
    rows: Int
    columns: Int


def launch(jit: ModuleType, inputs: Inputs, threads: Threads, shape: Shape, sums: KernelSums) -> Mask:
    """Start the threads; return which of them hold a pixel whose sums are too small for the fixed scale."""
    patch = shape.patch
    across = shape.tile[1]
    count = dr.width(threads.row)
    dense = shape.guide == "shared"
    rows, columns = (range(0, n, 1 if dense else step) for n, step in zip(shape.block, shape.tile, strict=True))
    # Pixels are ordered row by row, because instructions follow the order in which sums are evaluated. Each row of
    # patches is then loaded when the first pixel needs it.
    pixels = [(r, c) for r in rows for c in columns]
    window = sorted({r + i for r in rows for i in range(patch)})  # rows under the patches
    # Columns that a packet of the plane covers, and columns that a packet of samples covers.
    under = shape.block[1] + patch - 1
    block = shape.block[1]

    # Compute addresses.
    x_row, x_column = threads.row - inputs.top, threads.column - inputs.left
    x = jit.UInt(x_row) * inputs.stride + jit.UInt(x_column)  # pixel
    x_plane = jit.UInt(threads.plane)
    planes = {"shared": [inputs.white], "channel": [x_plane], "mixed": [x_plane, inputs.white]}[shape.guide]
    first_packets = [plane * inputs.plane_packets for plane in planes]
    pair, step = inputs.packet_rows, inputs.packet_columns
    lines = sorted({i // pair for i in window})  # rows of packets
    below = {line: line * inputs.row_packets for line in lines}
    # Address of x in packets, as for y: (row + a) / pair, (column + b) / step for phase (a, b), whole numbers
    a, b = threads.phase // across % pair, threads.phase % step
    x_packet = jit.UInt(x_row + a) // pair * inputs.row_packets + jit.UInt(x_column + b) // step
    offsets = jit.UInt(threads.phase)  # one list per phase
    first_entry = offsets * inputs.length
    entries = dr.gather(jit.UInt, inputs.counts, offsets)

    # Load once what the thread reads at x.
    patches_at_x = [
        {
            i: [
                dr.gather(jit.Float, inputs.planes, plane * inputs.plane_size + x + i * inputs.stride + j)
                for j in range(under)
            ]
            for i in window
        }
        for plane in planes
    ]
    bound = jit.UInt(threads.phase) * inputs.plane_size + x
    brightest = [dr.gather(jit.Float, inputs.brightest, bound + r * inputs.stride + c) for r, c in pixels]

    def load(source: Float, packet: UInt, size: int, needed: int) -> list[Float]:
        """Load the first values of a packet, 8 at a time; part k of packet p has the number p * (size / 8) + k."""
        part = min(size, 8)
        values = list[Float]()
        for k in range(-(-needed // part)):
            index = packet * (size // part) + k
            values.extend(dr.gather(jit.ArrayXf, source, index, shape=(part, count)))
        return values[:needed]

    def add_offset(k: UInt, totals: list[Sums]) -> tuple[UInt, list[Sums]]:
        """Add the samples at y = x + d for offset k of the list."""
        steps, log_spatial = load(inputs.entries, first_entry + k, inputs.entry_values, 2)
        y = x_packet + dr.reinterpret_array(jit.UInt, steps)  # number of its packet
        distances = list[list[Float]]()
        samples = dict[int, list[Float]]()
        for n, (first_packet, patches) in enumerate(zip(first_packets, patches_at_x, strict=True)):
            patches_at_y = {}
            for line in lines:
                own_rows = range(line * pair, (line + 1) * pair)
                # The packets of every plane contain the samples.
                needed = pair * (under + block) if n == 0 and any(i in rows for i in own_rows) else pair * under
                values = load(inputs.packets, first_packet + y + below[line], inputs.packet_values, needed)
                for j, i in enumerate(own_rows):
                    patches_at_y[i] = values[j * under : (j + 1) * under]
                    samples.setdefault(i, values[pair * under + j * block :][:block])
            distances.append(squared_distances(patches, patches_at_y, pixels, patch))
        beta_squared = distances[0]
        if shape.guide == "mixed":
            alpha = {r: load(inputs.alpha, y + below[r], inputs.alpha_values, block) for r in rows}
            beta_squared = mixed_squares(distances[0], distances[1], [alpha[r][c] for r, c in pixels])
        if not shape.running:
            log_spatial = log_spatial + HEADROOM
        log_weights = [dr.fma(-inputs.inverse_variance, beta, log_spatial) for beta in beta_squared]
        values = [samples[r][c] for r, c in pixels]
        return k + 1, add_samples(totals, log_weights, values, brightest, running=shape.running)

    start = [tuple(dr.full(jit.Float, value, count) for value in start_sums(shape.running))] * len(pixels)
    _, totals = dr.while_loop((jit.UInt(0), start), lambda k, _: k < entries, add_offset)

    # Results are evaluated in the order in which they are stored, so that a pixel's sample is used as soon as it is
    # loaded. If all weights were stored before the means, the samples of the whole block would wait in memory.
    targets = _store(jit, totals, pixels, threads, shape, sums)
    failed = dr.zeros(jit.Bool, count)
    if not shape.running:
        dr.scatter(failed, _failed(jit, totals, pixels, threads, inputs), dr.arange(jit.UInt, count))
    dr.eval(targets, failed)  # all at once, so that the loop runs once
    return failed


def _failed(
    jit: ModuleType, totals: list[Sums], pixels: list[tuple[int, int]], threads: Threads, inputs: Inputs
) -> Mask:
    """Mark threads that hold a pixel of the frame with too small a sum.

    Pixels of other strips count as well, so that the result doesn't depend on how the frame is divided.
    """
    failed = dr.full(jit.Bool, False, dr.width(threads.row))
    for (r, c), (weight, *_) in zip(pixels, totals, strict=True):
        # A pixel is in the frame if its unsigned row and column are small, because negative numbers become large.
        inside = (jit.UInt(threads.row + r) < inputs.height) & (jit.UInt(threads.column + c) < inputs.width)
        failed |= inside & (weight < LEAST_WEIGHT)
    return failed


def _store(
    jit: ModuleType, totals: list[Sums], pixels: list[tuple[int, int]], threads: Threads, shape: Shape, sums: KernelSums
) -> list[Float]:
    """Store the loop's sums; return the arrays that hold them, which aren't evaluated yet."""
    targets = [sums.weight, sums.mean, sums.noise_gain] + [sums.unit] * shape.running
    stored = [
        (weight, value / weight, square / dr.square(weight), *largest) for weight, value, square, *largest in totals
    ]
    # The pixel (row + a, column + b) is stored at [phase, row, column], (phase * rows + row) * columns + column.
    row = threads.row - sums.first_row + threads.phase // shape.tile[1]
    column = threads.column + threads.phase % shape.tile[1]
    first = (threads.phase * sums.rows + row) * sums.columns + column
    # As many values are stored at once as the largest power of two that divides a row of the block.
    packet = shape.block[1] & -shape.block[1] if shape.guide == "shared" else 1
    for i in range(0, len(pixels), packet):
        index = jit.UInt(first + pixels[i][0] * sums.columns + pixels[i][1]) // packet
        for target, *values in zip(targets, *stored[i : i + packet], strict=True):
            dr.scatter(target, jit.ArrayXf(values), index, mode=dr.ReduceMode.NoConflicts)
    return targets
