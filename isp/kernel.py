"""Eqs. (1)-(5) for a group of tiles of pixels in Dr.Jit: one source for LLVM and CUDA.

A lane owns a dense tile of adjacent pixels x and goes through the offsets d = y - x of one class: those that lead from
its tile to one place in the tile of letters. The letter at y then depends on the pixel's place in the lane alone, so
each pair (x, y) is met once, and one compiled kernel serves all classes. Patches of neighbours overlap: the lane forms
the rows' sums of squared differences once (`isp.window_sums`).

Loading is what costs. Rows are therefore stored in groups, one at every column where patches around y may begin: each
holds all the values that a lane reads from there on, of one row or two, to be loaded with one instruction a lane.
"""

from dataclasses import dataclass
from typing import Any

from isp.lane_shape import HEAD, PACKET, Pixel, Shape, entry_size, packet_width, whole_packets
from isp.weighted_sums import HEADROOM, add_exactly, add_quickly, at_least, start_sums
from isp.window_sums import window_sums
from render.jit import arrays, dr


@dataclass(frozen=True)
class Frame:
    """Evaluated Dr.Jit arrays that all lanes read; rows and columns begin at the first patch (`isp.strips`).

    Attributes
    ----------
    h : Float
        Planes, [plane, row // packet_rows, group, row % packet_rows, `packet_width`].
    samples, alpha, decay : Float
        At patches' centres, [row // packet_rows, group, row % packet_rows, `whole_packets(columns)`]: samples; alpha,
        or None; log2(e) r(x) / (2 sigma_s^2).
    entries : Float
        Lists of offsets, [class, entry, `entry_size`].
    counts : UInt
        Entries of each list.
    length, height, width, plane_groups, groups : UInt
        Entries a list has room for; size of the whole frame; groups of a plane, and of a row.
    """

    h: Any
    samples: Any
    alpha: Any
    decay: Any
    entries: Any
    counts: Any
    length: Any
    height: Any
    width: Any
    plane_groups: Any
    groups: Any


@dataclass(frozen=True)
class Lanes:
    """What each lane does.

    Attributes
    ----------
    row, column : Int
        Its first pixel in the frame; may lie outside.
    window_row, window_column : UInt
        First pixel of its patches in the arrays.
    group : UInt
        Number of the group where its list's steps begin.
    list : UInt
        Class of offsets.
    line : UInt
        Where its first row of sums goes.
    """

    row: Any
    column: Any
    window_row: Any
    window_column: Any
    group: Any
    list: Any
    line: Any


def reconstruct_lanes(frame: Frame, lanes: Lanes, shape: Shape) -> list[tuple[Any, ...]]:
    """Sums of eqs. (1) and (3) at each pixel of the lanes, row by row.

    Returns
    -------
    list of (weight, value[, square][, largest])
        As `isp.weighted_sums.start_sums`: sums of w, of w times the sample, of w^2 where asked for.
    """
    jit, count, width = arrays(), dr.width(lanes.row), packet_width(shape.columns, shape.patch)
    here = {}
    for plane in shape.slots:
        rows, columns = _window(shape, plane)
        here[plane] = _load_here(frame, lanes, frame.h, shape.slots.index(plane), width, rows, columns, shape)
    around = range(shape.rows), range(shape.columns)
    decay = _load_here(frame, lanes, frame.decay, 0, whole_packets(shape.columns), *around, shape)
    first_entry, entries = lanes.list * frame.length, dr.gather(jit.UInt, frame.counts, lanes.list)

    add = add_exactly if shape.exact else add_quickly

    def add_offset(k: Any, sums: list[tuple[Any, ...]]) -> tuple[Any, list[tuple[Any, ...]]]:
        entry = _entry(frame, first_entry + k, shape)
        group = lanes.group + dr.reinterpret_array(jit.UInt, entry[0])
        distances = _distances(frame, group, here, entry, shape)
        samples = _samples(frame.samples, group, frame, shape)
        alpha = _samples(frame.alpha, group, frame, shape) if shape.judge == "both" else {}
        spatial = entry[3] if shape.exact else entry[3] + HEADROOM
        inside = _inside(frame, lanes, entry, shape) if shape.bordered else {}
        updated = []
        for pixel, old in zip(shape.pixels, sums, strict=True):
            squared = _beta_squared(distances[pixel], alpha.get(pixel))
            log_weight = dr.fma(-decay[pixel], squared, spatial)
            updated.append(add(old, log_weight, inside.get(pixel), samples[pixel]))
        return k + 1, updated

    start = start_sums(exact=shape.exact, noise=shape.noise)
    sums = [tuple(dr.full(jit.Float, value, count) for value in start) for _ in shape.pixels]
    _, sums = dr.while_loop((jit.UInt(0), sums), lambda k, _: k < entries, add_offset)
    return sums


def _window(shape: Shape, plane: int) -> tuple[range, range]:
    """Rows and columns under the patches that a plane judges."""
    rows, columns = shape.judged(plane)
    return range(rows[0], rows[-1] + shape.patch), range(columns[0], columns[-1] + shape.patch)


def _load_here(
    frame: Frame, lanes: Lanes, source: Any, slot: int, width: int, rows: range, columns: range, shape: Shape
) -> dict[Pixel, Any]:
    """Values around x: lanes may begin between groups, so the values that follow are loaded too, and shifted."""
    pair, across = shape.packet_rows, shape.across
    group = slot * frame.plane_groups + lanes.window_row // pair * frame.groups + lanes.window_column // across
    more = range(rows.start, rows.stop + pair - 1)
    first, second = (_load_rows(source, group + i, more, width, width, frame, shape) for i in (0, 1))
    lines = {i: first[i] + second[i][width - across :] for i in more}
    values = {}
    for i in rows:
        line = lines[i]
        for shift in range(1, pair):
            chosen = lanes.window_row % pair == shift
            line = [dr.select(chosen, new, old) for new, old in zip(lines[i + shift], line, strict=True)]
        for j in columns:
            values[i, j] = line[j]
            for shift in range(1, across):
                values[i, j] = dr.select(lanes.window_column % across == shift, line[j + shift], values[i, j])
    return values


def _load_rows(
    source: Any, group: Any, rows: range, needed: int, width: int, frame: Frame, shape: Shape
) -> dict[int, list[Any]]:
    """First `needed` values of some rows from a group on: one packet for all rows of a group, or one each."""
    pair, values = shape.packet_rows, {}
    for i in range(rows.start // pair, (rows.stop - 1) // pair + 1):
        lines = [r for r in range(i * pair, i * pair + pair) if r in rows]
        first = group + i * frame.groups
        if len(lines) == pair and pair * width <= 2 * PACKET:
            together = _load(source, first, pair * width, 0, pair * width)
            values.update({r: together[k * width :][:needed] for k, r in enumerate(lines)})
        else:
            values.update({r: _load(source, first, pair * width, r % pair * width, needed) for r in lines})
    return values


def _load(source: Any, group: Any, size: int, offset: int, needed: int) -> list[Any]:
    """`needed` values of a group of `size`, from `offset` on, in as few packets as there are."""
    values: list[Any] = []
    while len(values) < needed:
        packet = size if size <= 2 * PACKET and needed == size else min(PACKET, whole_packets(needed - len(values)))
        place = group * (size // packet) + (offset + len(values)) // packet
        loaded = dr.gather(arrays().ArrayXf, source, place, shape=(packet, dr.width(place)))
        values += [loaded[i] for i in range(packet)]
    return values[:needed]


def _entry(frame: Frame, number: Any, shape: Shape) -> list[Any]:
    """Head of a list's entry and the noise distances that the judges need."""
    needed = HEAD + shape.cell_count * (1 if shape.judge == "white" else 2)
    return _load(frame.entries, number, entry_size(shape.cell_count), 0, needed)


def _distances(
    frame: Frame, group: Any, here: dict[int, dict[Pixel, Any]], entry: list[Any], shape: Shape
) -> dict[Pixel, list[Any]]:
    """Squared distances of each pixel's patch by its judges, less what noise alone makes, 0 or more."""
    results: dict[Pixel, list[Any]] = {pixel: [] for pixel in shape.pixels}
    width = packet_width(shape.columns, shape.patch)
    for slot, (plane, values) in enumerate(here.items()):
        rows, columns = shape.judged(plane)
        lines, places = _window(shape, plane)
        there = _load_rows(frame.h, group + slot * frame.plane_groups, lines, places.stop, width, frame, shape)
        row_sums = {}
        for i in lines:
            # y - x, not x - y: the x stay in memory, and a processor subtracts memory from a register.
            change = {j: there[i][j] - values[i, j] for j in places}
            row_sums[i] = window_sums(change, columns, shape.patch, dr.square, lambda total, v: dr.fma(v, v, total))
        for k, column in enumerate(columns):
            line = {i: sums[k] for i, sums in row_sums.items()}
            totals = window_sums(line, rows, shape.patch, lambda v: v, lambda total, v: total + v)
            for row, total in zip(rows, totals, strict=True):
                if plane in shape.judges((row, column)):
                    own = 0 if shape.judge != "band" and plane == shape.white else shape.cell_count
                    noise = entry[HEAD + own + shape.cell((row, column))]
                    results[row, column].append(at_least(total - noise, 0.0))
    return results


def _samples(source: Any, group: Any, frame: Frame, shape: Shape) -> dict[Pixel, Any]:
    """Samples (or alpha) at each y."""
    rows = range(shape.rows)
    lines = _load_rows(source, group, rows, shape.columns, whole_packets(shape.columns), frame, shape)
    return {(r, c): lines[r][c] for r, c in shape.pixels}


def _inside(frame: Frame, lanes: Lanes, entry: list[Any], shape: Shape) -> dict[Pixel, Any]:
    """Whether each y lies in the frame: Omega ends at its border."""
    jit = arrays()
    # Unsigned, a negative coordinate is a large one.
    row = jit.UInt(lanes.row) + dr.reinterpret_array(jit.UInt, entry[1])
    column = jit.UInt(lanes.column) + dr.reinterpret_array(jit.UInt, entry[2])
    rows = [row + r < frame.height for r in range(shape.rows)]
    columns = [column + c < frame.width for c in range(shape.columns)]
    return {(r, c): rows[r] & columns[c] for r, c in shape.pixels}


def _beta_squared(distances: list[Any], alpha: Any) -> Any:
    """Square of eq. (5), expanded: exactly one distance where alpha is 0 or 1."""
    if len(distances) == 1:
        return distances[0]
    white, band = distances
    rest = 1.0 - alpha
    cross = 2.0 * alpha * rest * dr.sqrt(band) * dr.sqrt(white)
    return dr.fma(dr.square(alpha), band, dr.fma(dr.square(rest), white, cross))
