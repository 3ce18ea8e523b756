"""Eqs. (1)-(5) for a group of tiles of pixels in Dr.Jit: one source for LLVM and CUDA.

A lane owns pixels x of a dense tile, all of them or those of one cell of the tile of letters, and goes through the
offsets d = y - x of one class: those that lead from its tile to one place in the tile of letters. The letter at y then
depends on the pixel's place in the lane alone, so each pair (x, y) is met once, and one compiled kernel serves all
classes and cells. Where W judges alone the letter at y doesn't matter, and a lane owns all pixels; where a band's own
plane judges, it owns those at whose y that band is sampled. Patches of neighbours overlap: the lane forms the rows'
sums of squared differences once (`isp.window_sums`).

Loading is what costs. Rows are therefore stored in groups, one at every column where patches around y may begin: each
holds all the values that a lane reads from there on, of one row or two, to be loaded with one instruction a lane. An
iteration of a lane that isn't dense goes through two offsets, one a tile below the other: they read mostly the same
rows.
"""

from dataclasses import dataclass
from typing import Any

from isp.lane_shape import PACKET, Pixel, Shape, entry_length, packet_rows, whole_packets
from isp.weighted_sums import HEADROOM, add_exactly, add_quickly, at_least, start_sums
from isp.window_sums import window_sums
from rodcone.jit import arrays, dr

ROOT_SCALE = 2.0**-32  # the product of two scaled distances is finite, whatever they are, and under 1e-19 no number


@dataclass(frozen=True)
class Frame:
    """Evaluated Dr.Jit arrays that all lanes read; rows and columns begin at the first patch (`isp.strips`).

    Attributes
    ----------
    h : list of Float
        Planes, [slot, row // packet_rows, group, row % packet_rows, width], for each of `row_parts`: W's one for dense
        lanes; for the others a slot for the band sampled at each cell, then W's for each, moved by the cell's place.
    samples, alpha : Float
        At patches' centres, [cell, row // packet_rows, group, row % packet_rows, `whole_packets(columns)`], moved by
        the cell's place: samples and alpha, 0 outside the frame; alpha may be None.
    decay : Float
        `isp.strips.decay` at patches' centres: the factor on beta_s^2; for the first cell alone.
    entries : Float
        Lists of offsets, [list, entry, `whole_packets(entry_length)`].
    counts : UInt
        Entries of each list.
    length, height, width, plane_groups, groups : UInt
        Entries a list has room for; size of the whole frame; groups of a plane, and of a row.
    """

    h: list[Any]
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
    cell : UInt
        Slot of its own band's plane, samples and alpha: 0 where dense.
    list : UInt
        List of offsets.
    place : UInt
        Where its first sum goes.
    """

    row: Any
    column: Any
    window_row: Any
    window_column: Any
    group: Any
    cell: Any
    list: Any
    place: Any


def reconstruct_lanes(frame: Frame, lanes: Lanes, shape: Shape) -> dict[Pixel, tuple[Any, ...]]:
    """Sums of eqs. (1) and (3) at each of the lanes' pixels, row by row.

    Instructions come in the order in which sums are evaluated: in this one a row of patches is loaded when the first
    pixel needs it, and a seventh fewer values go through memory.

    Returns
    -------
    mapping of pixel to (weight, value[, square][, largest])
        As `isp.weighted_sums.start_sums`: sums of w, of w times the sample, of w^2 where asked for.
    """
    jit, count, pixels = arrays(), dr.width(lanes.row), sorted(shape.pixels)
    own = lanes.cell * frame.plane_groups
    slots = [own, own + shape.tile[0] * shape.tile[1] * frame.plane_groups][: shape.judges]
    place, width = (lanes.window_row, lanes.window_column), whole_packets(shape.columns)
    here = [_planes_here(slot, place, frame, shape) for slot in slots]
    place = place[0] + lanes.cell // shape.tile[1], place[1] + lanes.cell % shape.tile[1]
    decay = _load_here(frame.decay, jit.UInt(0), place, width, *shape.places, frame, shape)
    first_entry, entries = lanes.list * frame.length, dr.gather(jit.UInt, frame.counts, lanes.list)
    length, add = (
        entry_length(shape.tile, shape.together, dense=shape.dense),
        add_exactly if shape.exact else add_quickly,
    )

    def add_offsets(k: Any, sums: list[tuple[Any, ...]]) -> tuple[Any, list[tuple[Any, ...]]]:
        entry = _load(frame.entries, first_entry + k, whole_packets(length), 0, length)
        group = lanes.group + dr.reinterpret_array(jit.UInt, entry[0])
        there = [_planes_there(slot + group, frame, shape) for slot in slots]
        centres = [frame.samples] + [frame.alpha] * (shape.judges == 2)
        rows = _rows_together(shape.places[0], shape)
        samples, *alpha = (
            _load_rows(array, own + group, rows, shape.places[1][-1] + 1, width, frame, shape) for array in centres
        )
        for i in range(shape.together):
            first = 1 + i * (1 + shape.noises)
            spatial = entry[first] if shape.exact else entry[first] + HEADROOM
            noise, below = entry[first + 1 : first + 1 + shape.noises], i * shape.tile[0]
            distances = [
                _distances(near, far, below, noise, judge, shape)
                for judge, (near, far) in enumerate(zip(here, there, strict=True))
            ]
            updated = []
            for (r, c), old in zip(pixels, sums, strict=True):
                squared = _beta_squared([d[r, c] for d in distances], [a[r + below][c] for a in alpha])
                log_weight = dr.fma(-decay[r, c], squared, spatial)
                updated.append(add(old, log_weight, samples[r + below][c]))
            sums = updated
        return k + 1, sums

    start = start_sums(exact=shape.exact, noise=shape.noise)
    sums = [tuple(dr.full(jit.Float, value, count) for value in start) for _ in pixels]
    _, sums = dr.while_loop((jit.UInt(0), sums), lambda k, _: k < entries, add_offsets)
    return dict(zip(pixels, sums, strict=True))


def _rows_together(rows: range, shape: Shape) -> list[int]:
    """Rows that one of the offsets of an iteration reads."""
    return sorted({r + i * shape.tile[0] for r in rows for i in range(shape.together)})


def _planes_here(slot: Any, place: tuple[Any, Any], frame: Frame, shape: Shape) -> dict[Pixel, Any]:
    """Values of a plane under the patches around x, part by part of a row."""
    values = {}
    for source, (first, width, count) in zip(frame.h, shape.row_parts, strict=False):
        part = _load_here(source, slot, place, width, shape.window[0], range(count), frame, shape)
        values.update({(i, first + j): value for (i, j), value in part.items()})
    return values


def _planes_there(group: Any, frame: Frame, shape: Shape) -> dict[int, list[Any]]:
    """Values of a plane under the patches around y, row by row."""
    rows, values = _rows_together(shape.window[0], shape), dict[int, list[Any]]()
    for source, (_, width, count) in zip(frame.h, shape.row_parts, strict=False):
        for i, part in _load_rows(source, group, rows, count, width, frame, shape).items():
            values[i] = values.get(i, []) + part
    return values


def _load_here(
    source: Any, slot: Any, place: tuple[Any, Any], width: int, rows: range, columns: range, frame: Frame, shape: Shape
) -> dict[Pixel, Any]:
    """Values around x: lanes may begin between groups, so some values that follow are loaded too, and shifted."""
    pair, across = packet_rows(shape.tile[0]), shape.tile[1]
    group, values = slot * pair + place[1] // across * pair, {}
    shifts = [place[1] % across == shift for shift in range(1, across)]
    needed = columns[-1] + across
    for i in rows:
        row = place[0] + i
        first = group + row // pair * (frame.groups * pair) + row % pair
        line = _load(source, first, width, 0, min(needed, width))
        if needed > width:
            tail = whole_packets(across)
            line += _load(source, first + pair, width, width - tail, tail)[tail - across :]
        for j in columns:
            values[i, j] = line[j]
            for shift, chosen in enumerate(shifts, 1):
                values[i, j] = dr.select(chosen, line[j + shift], values[i, j])
    return values


def _load_rows(
    source: Any, group: Any, rows: list[int], needed: int, width: int, frame: Frame, shape: Shape
) -> dict[int, list[Any]]:
    """First `needed` values of some rows from a group on: one packet for all rows of a group, or one each."""
    pair, values = packet_rows(shape.tile[0]), {}
    for i in sorted({r // pair for r in rows}):
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


def _distances(
    here: dict[Pixel, Any], there: dict[int, list[Any]], below: int, noise: list[Any], judge: int, shape: Shape
) -> dict[Pixel, Any]:
    """Squared distance of each pixel's patch in one plane, less what noise alone makes, 0 or more."""
    (rows, columns), (lines, places), row_sums, results = shape.places, shape.window, {}, {}
    for i in lines:
        # y - x, not x - y: the x stay in memory, and a processor subtracts memory from a register.
        change = {j: there[i + below][j] - here[i, j] for j in places}
        row_sums[i] = window_sums(change, columns, shape.patch, dr.square, lambda total, v: dr.fma(v, v, total))
    for k, column in enumerate(columns):
        line = {i: sums[k] for i, sums in row_sums.items()}
        totals = window_sums(line, rows, shape.patch, lambda v: v, lambda total, v: total + v)
        for row, total in zip(rows, totals, strict=True):
            results[row, column] = at_least(total - noise[shape.noise_number((row, column), judge)], 0.0)
    return results


def _beta_squared(distances: list[Any], alpha: list[Any]) -> Any:
    """Square of eq. (5), expanded: exactly one distance where alpha is 0 or 1. One root serves for both."""
    if len(distances) == 1:
        return distances[0]
    (band, white), (share,) = distances, alpha
    rest = 1.0 - share
    root = dr.sqrt(band * ROOT_SCALE * (white * ROOT_SCALE))
    cross = share * rest * (2.0 / ROOT_SCALE) * root
    return dr.fma(dr.square(share), band, dr.fma(dr.square(rest), white, cross))
