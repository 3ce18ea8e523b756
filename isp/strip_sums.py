"""One strip through the kernel: upload, run each group of lanes, and make the result of the sums."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from isp.kernel import Frame, Lanes, reconstruct_lanes
from isp.lane_shape import PACKET, Judge, Pixel, Shape, packet_rows
from isp.settings import Settings
from isp.strips import ALIGNMENT, Strip, aligned, centre_groups, decay, make_strip, plane_groups
from isp.tiles import Pattern, Work, first_offset, lane_size, list_offsets, sort_tiles, tile_grid
from isp.weighted_sums import HEADROOM, LEAST_WEIGHT, NO_SAMPLE, NOTHING
from render.jit import arrays, dr
from sensor.cfa import channels
from sensor.raw import RawImage


@dataclass(frozen=True)
class Sums:
    """Sums of all lanes of a strip in Dr.Jit arrays, [class, tile down, tile across, pixel]; pixels as `Shape.pixels`.

    Attributes
    ----------
    weight, value, square : Float
        In units of 2^largest; `square` is None where nobody asks for the noise.
    largest : Float
        Log2 of the unit.
    """

    weight: Any
    value: Any
    square: Any
    largest: Any


def reconstruct_rows(
    raw: RawImage, rows: tuple[int, int], pattern: Pattern, settings: Settings, *, noise: bool
) -> list[NDArray[np.float32]]:
    """Estimate [e-] and, where asked for, noise gain for some rows of the frame, (rows, w, channel) each.

    The first row is a whole number of lanes; apart from this the result doesn't depend on the rows chosen.
    """
    strip, sums = make_strip(raw, rows, (0, raw.shape[1]), pattern, settings), _empty_sums(raw, rows, pattern, noise)
    work = sort_tiles(raw.shape, rows, strip.alpha, strip.first_row, pattern, settings.reach)
    _run_all(raw, strip, {"white": work["white"]}, sums)
    others: dict[Judge, Work] = {judge: lanes for judge, lanes in work.items() if judge != "white" and len(lanes.row)}
    if others:
        # The bands' planes are laid out around those lanes alone: mostly few.
        lane, lanes = lane_size(pattern), list(others.values())
        near = (
            _around([w.row for w in lanes], lane[0], rows),
            _around([w.column for w in lanes], lane[1], strip.columns),
        )
        whole = near == (strip.rows, strip.columns)
        _run_all(raw, strip if whole else make_strip(raw, *near, pattern, settings), others, sums)
    results = finish(sums, raw, rows, pattern)
    return [values.numpy().reshape(rows[1] - rows[0], raw.shape[1], -1) for values in results]


def _around(places: list[NDArray[np.int32]], lane: int, whole: tuple[int, int]) -> tuple[int, int]:
    """First and past the last row, or column, of a strip that holds the lanes that begin at some places."""
    first = np.concatenate(places)
    return max(int(first.min()), whole[0]) // lane * lane, min(int(first.max()) + lane, whole[1])


def _run_all(raw: RawImage, strip: Strip, work: Mapping[Judge, Work], sums: Sums) -> None:
    """Load a strip and run the kernels of its lanes: W's alone, or the others."""
    work = {judge: lanes for judge, lanes in work.items() if len(lanes.row)}
    if not work:
        return
    frame, pattern, noise = load(raw, strip, set(work)), strip.pattern, sums.square is not None
    for judge, lanes in work.items():
        both, dense, size = judge == "both", judge == "white", lane_size(pattern)
        shape = Shape(pattern.size, *size, dense, strip.settings.patch, 1 + both, both, noise)
        _run(frame, _upload_lanes(lanes, strip, shape), shape, sums)


def load(raw: RawImage, strip: Strip, judges: set[Judge]) -> Frame:
    """Lay out and upload what the lanes read."""
    jit, pattern, dense = arrays(), strip.pattern, judges == {"white"}
    letters = [number for row in pattern.cells for number in row]
    cells = [0] if dense else list(range(len(letters)))
    slots = [] if dense else list(zip(letters, cells, strict=True))
    slots += [(white, cell) for white in [pattern.white] if white is not None for cell in cells if judges != {"band"}]
    entries, counts = list_offsets(raw.cfa, pattern, strip.settings, strip.groups, dense=dense)
    mixed = strip.alpha if "both" in judges else None
    rows_of_groups = strip.height // packet_rows(pattern.size[0])
    opaque = (
        dr.opaque(jit.UInt, number)
        for number in (entries.shape[1], *raw.shape, rows_of_groups * strip.groups, strip.groups)
    )
    return Frame(
        _upload(plane_groups(strip, slots)),
        _upload(centre_groups(strip.dn - np.float32(raw.black_dn), strip, cells, NO_SAMPLE)),
        None if mixed is None else _upload(centre_groups(mixed, strip, cells)),
        _upload(centre_groups(decay(strip), strip, [0])),
        _upload(entries),
        _upload(counts),
        *opaque,
    )


def _upload(values: NDArray[Any]) -> Any:
    """Evaluated Dr.Jit array of the same type, in aligned memory."""
    jit = arrays()
    kinds = {"f": jit.Float, "u": jit.UInt, "i": jit.Int}
    if values.ctypes.data % ALIGNMENT:
        memory = aligned(values.shape, values.dtype)
        memory[:] = values
        values = memory
    return kinds[values.dtype.kind](values.ravel())


def _upload_lanes(work: Work, strip: Strip, shape: Shape) -> Lanes:
    half, (down, across), pair = strip.settings.patch // 2, shape.tile, packet_rows(shape.tile[0])
    row, column = work.row - half - strip.top, work.column - half - strip.left
    first = first_offset(strip.pattern, work.shift_row, work.shift_column)
    group = (row + first[0]) // pair * strip.groups + (column + first[1]) // across
    number, count = work.shift_row * across + work.shift_column, shape.rows * shape.columns
    offsets = number if shape.dense else number * (down * across) + work.cell
    place = work.tile * count + work.cell * (count // (down * across))
    parts = (part.astype(np.uint32) for part in (row, column, group, work.cell, offsets, place))
    own = work.row + work.cell // across, work.column + work.cell % across
    return Lanes(*(_upload(part) for part in (*own, *parts)))


def _empty_sums(raw: RawImage, rows: tuple[int, int], pattern: Pattern, noise: bool) -> Sums:
    jit = arrays()
    tiles = int(np.prod(tile_grid(raw.shape[1], rows, pattern))) * int(np.prod(pattern.size))
    size_of_all = tiles * int(np.prod(lane_size(pattern))) + PACKET  # the last ones stay empty
    full = [dr.full(jit.Float, value, size_of_all) for value in (0.0, 0.0, 0.0, -HEADROOM)]
    weight, value, square, largest = full
    return Sums(weight, value, square if noise else None, largest)


def _run(frame: Frame, lanes: Lanes, shape: Shape, sums: Sums) -> None:
    """Reconstruct a group of lanes and put their sums in place; those that need it once more, exactly."""
    pixels = reconstruct_lanes(frame, lanes, shape)
    failed = dr.full(arrays().Bool, False, dr.width(lanes.row))
    if not shape.exact:
        inside = _inside(frame, lanes, shape)
        for pixel, (weight, *_) in pixels.items():
            failed |= inside[pixel] & (weight < LEAST_WEIGHT)
    dr.eval(pixels, failed)  # a scatter straight from the loop would repeat the loop for each array
    _put([pixels[pixel] for pixel in shape.pixels], lanes, shape, sums)
    chosen: Any = dr.compress(failed)
    if dr.width(chosen):
        again = Lanes(**{name: dr.gather(type(part), part, chosen) for name, part in vars(lanes).items()})
        dr.eval(vars(again))
        _run(frame, again, replace(shape, exact=True), sums)


def _inside(frame: Frame, lanes: Lanes, shape: Shape) -> dict[Pixel, Any]:
    """Whether each pixel of a lane lies in the frame; those of other strips too, for all strips to decide alike."""
    unsigned = arrays().UInt
    # Unsigned, a negative coordinate is a large one.
    rows = {r: unsigned(lanes.row + r) < frame.height for r in shape.places[0]}
    columns = {c: unsigned(lanes.column + c) < frame.width for c in shape.places[1]}
    return {(r, c): rows[r] & columns[c] for r, c in shape.pixels}


def _put(pixels: list[tuple[Any, ...]], lanes: Lanes, shape: Shape, sums: Sums) -> None:
    """Store sums, a packet at once: a lane's lie side by side."""
    jit, count = arrays(), len(pixels)
    packet = min(PACKET, count & -count)  # the largest power of two that divides it
    targets = [sums.weight, sums.value] + [sums.square] * shape.noise + [sums.largest] * shape.exact
    for number, target in enumerate(targets):
        for first in range(0, count, packet):
            values = jit.ArrayXf([pixel[number] for pixel in pixels[first : first + packet]])
            place = lanes.place // packet + first // packet
            dr.scatter(target, values, place, mode=dr.ReduceMode.NoConflicts)
    dr.eval(targets)


def finish(sums: Sums, raw: RawImage, rows: tuple[int, int], pattern: Pattern) -> list[Any]:
    """f_i(x) of eq. (1) [e-], and sum w^2 / (sum w)^2 where squares were summed, [row, column, channel] each."""
    jit, by_row, by_column = arrays(), *_places(raw, rows, pattern)
    letters, layers, width = by_row.shape[0], by_row.shape[1], raw.shape[1]
    index = dr.arange(jit.UInt, (rows[1] - rows[0]) * width * letters)
    pixel, letter = _divide(index, letters)
    row, column = _divide(pixel, width)
    tables = [(_upload(table), dr.opaque(jit.UInt, table.shape[2])) for table in (by_row, by_column)]
    parts = []
    for layer in range(layers):
        line = letter * layers + layer
        (rows_at, row_count), (columns_at, column_count) = tables
        place = dr.gather(jit.UInt, rows_at, line * row_count + row)
        place += dr.gather(jit.UInt, columns_at, line * column_count + column)
        arrays_at = [sums.weight, sums.value, sums.largest] + [sums.square] * (sums.square is not None)
        parts.append([dr.gather(jit.Float, array, place) for array in arrays_at])
    weight, value, *square = _merge(parts)
    results = [value / weight * dr.opaque(jit.Float, raw.gain_e_per_dn), *(s / dr.square(weight) for s in square)]
    dr.eval(results)
    return results


def _merge(parts: list[list[Any]]) -> list[Any]:
    """Add up weight, value[, square] of several layers in units of their own."""
    units = [dr.select(weight > 0.0, largest, NOTHING) for weight, _, largest, *_ in parts]
    common = units[0]
    for unit in units[1:]:
        common = dr.maximum(common, unit)
    scales = [dr.exp2(unit - common) for unit in units]
    totals = [
        [weight * s, value * s, *(x * s * s for x in square)]
        for (weight, value, _, *square), s in zip(parts, scales, strict=True)
    ]
    result = totals[0]
    for more in totals[1:]:
        result = [total + part for total, part in zip(result, more, strict=True)]
    return result


def _divide(number: Any, divisor: int) -> tuple[Any, Any]:
    """Quotient and rest; exact, for half a step to the next whole number is far above the rounding of 2^32/divisor."""
    jit = arrays()
    inverse, whole = dr.opaque(jit.Float64, 1.0 / divisor), dr.opaque(jit.UInt, divisor)
    quotient = jit.UInt((jit.Float64(number) + 0.5) * inverse)
    return quotient, number - quotient * whole


def _places(raw: RawImage, rows: tuple[int, int], pattern: Pattern) -> tuple[NDArray[np.uint32], NDArray[np.uint32]]:
    """Where `Sums` hold each letter's sums: a part by row and one by column, [channel, layer, place], to be added.

    A letter has a layer for each of its cells; where it has fewer than another, they lead to sums that stay empty.
    """
    (down, across), size = pattern.size, lane_size(pattern)
    grid, count = tile_grid(raw.shape[1], rows, pattern), size[0] * size[1]
    by_cell, by_column = count // (down * across), size[0] // down
    cells, order = np.array(pattern.cells), channels(raw.cfa)
    own = [np.argwhere(cells == pattern.letters.index(letter)) for letter in order]
    layers = max(len(places) for places in own)
    by_class = grid[0] * grid[1] * count
    tables = [np.empty((len(order), layers, n), np.uint32) for n in (rows[1] - rows[0], raw.shape[1])]
    row, column = np.arange(*rows), np.arange(raw.shape[1])
    for channel, places in enumerate(own):
        for layer in range(layers):
            if layer >= len(places):
                tables[0][channel, layer], tables[1][channel, layer] = down * across * by_class, 0
                continue
            cell = places[layer]
            back = (cell[0] - row) % down, (cell[1] - column) % across
            tile_row, r = np.divmod(row - rows[0] + back[0], size[0])
            tile_column, c = np.divmod(column + back[1], size[1])
            in_row, in_column = r % down * across * by_cell + r // down, c % across * by_cell + c // across * by_column
            tables[0][channel, layer] = back[0] * across * by_class + tile_row * grid[1] * count + in_row
            tables[1][channel, layer] = back[1] * by_class + tile_column * count + in_column
    return tables[0], tables[1]
