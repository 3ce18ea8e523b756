"""One strip through the kernel: upload, run each group of lanes, and make the result of the sums.

Kernels run beside Python. So a strip is started, and ended when the next one has been: what NumPy does to prepare it is
hidden behind the kernels of the one before.
"""

from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from isp.kernel import Frame, Lanes, reconstruct_lanes
from isp.lane_shape import Judge, Pixel, Shape, packet_rows
from isp.lane_sums import Sums, empty_sums, finish, put
from isp.settings import Settings
from isp.strips import Strip, centre_groups, crop, decay, make_strip, part_of, plane_groups, upload
from isp.tiles import Pattern, Work, first_offset, lane_size, list_offsets, sort_tiles
from isp.weighted_sums import LEAST_WEIGHT
from rodcone.jit import arrays, dr
from sensor.raw import RawImage


@dataclass(frozen=True)
class Run:
    """Lanes that a kernel goes through, which may not have ended yet.

    Attributes
    ----------
    frame : Frame
    lanes : Lanes
    shape : Shape
    failed : Bool
        Lanes whose sums are too small for the quick form.
    """

    frame: Frame
    lanes: Lanes
    shape: Shape
    failed: Any


@dataclass(frozen=True)
class Started:
    """A strip whose kernels run: the frame's rows first and past the last, where their sums go, and the runs."""

    rows: tuple[int, int]
    sums: Sums
    runs: list[Run]


def start_rows(raw: RawImage, rows: tuple[int, int], pattern: Pattern, settings: Settings, *, noise: bool) -> Started:
    """Start to reconstruct some rows of the frame.

    The first row is a whole number of lanes; apart from this the result doesn't depend on the rows chosen.
    """
    strip, sums = make_strip(raw, rows, (0, raw.shape[1]), pattern, settings), empty_sums(raw, rows, pattern, noise)
    with ThreadPoolExecutor(1) as beside:  # NumPy lets two threads work, and no kernel does yet
        decays = beside.submit(decay, strip)
        work = sort_tiles(raw.shape, rows, strip.alpha, strip.first_row, pattern, settings.reach)
        runs = _run_all(raw, strip, {"white": work["white"]}, sums, decays.result)
    others: dict[Judge, Work] = {judge: lanes for judge, lanes in work.items() if judge != "white" and len(lanes.row)}
    if others:
        # The bands' planes are laid out around those lanes alone: mostly few.
        lane, lanes = lane_size(pattern), list(others.values())
        near = (
            _around([w.row for w in lanes], lane[0], rows),
            _around([w.column for w in lanes], lane[1], strip.columns),
        )
        if near == (strip.rows, strip.columns):
            runs += _run_all(raw, strip, others, sums, decays.result)
        else:
            part = crop(strip, raw.shape, *near)
            runs += _run_all(raw, part, others, sums, lambda: part_of(decays.result(), strip, part))
    return Started(rows, sums, runs)


def end_rows(started: Started, raw: RawImage, pattern: Pattern, results: list[Any]) -> None:
    """Put estimate [e-] and, where asked for, noise gain into the frame's results, [row, column, channel] each."""
    for run in started.runs:
        _run_failed(run, started.sums)
    finish(started.sums, raw, started.rows, pattern, results)


def _around(places: list[NDArray[np.int32]], lane: int, whole: tuple[int, int]) -> tuple[int, int]:
    """First and past the last row, or column, of a strip that holds the lanes that begin at some places."""
    first = np.concatenate(places)
    return max(int(first.min()), whole[0]) // lane * lane, min(int(first.max()) + lane, whole[1])


def _run_all(
    raw: RawImage, strip: Strip, work: Mapping[Judge, Work], sums: Sums, decays: Callable[[], NDArray[Any]]
) -> list[Run]:
    """Load a strip and start the kernels of its lanes: W's alone, or the others."""
    work = {judge: lanes for judge, lanes in work.items() if len(lanes.row)}
    if not work:
        return []
    frame, pattern, noise = load(raw, strip, set(work), decays), strip.pattern, sums.noise_gain is not None
    runs = []
    for judge, lanes in work.items():
        size = lane_size(pattern)
        shape = Shape(pattern.size, *size, judge == "white", strip.settings.patch, 1 + (judge == "both"), False, noise)
        runs.append(_run(frame, _upload_lanes(lanes, strip, shape), shape, sums))
    return runs


def load(raw: RawImage, strip: Strip, judges: set[Judge], decays: Callable[[], NDArray[Any]]) -> Frame:
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
        [upload(part) for part in plane_groups(strip, slots)],
        upload(centre_groups(strip.dn - np.float32(raw.black_dn), strip, cells)),
        None if mixed is None else upload(centre_groups(mixed, strip, cells)),
        upload(centre_groups(decays(), strip, [0])),
        upload(entries),
        upload(counts),
        *opaque,
    )


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
    return Lanes(*(upload(part) for part in (*own, *parts)))


def _run(frame: Frame, lanes: Lanes, shape: Shape, sums: Sums) -> Run:
    """Start to reconstruct a group of lanes and to put their sums in place."""
    pixels = reconstruct_lanes(frame, lanes, shape)
    failed = dr.full(arrays().Bool, False, dr.width(lanes.row))
    if not shape.exact:
        inside = _inside(frame, lanes, shape)
        for pixel, (weight, *_) in pixels.items():
            failed |= inside[pixel] & (weight < LEAST_WEIGHT)
    stored = put([pixels[pixel] for pixel in shape.pixels], lanes, shape, sums)
    dr.eval(failed, stored)  # all at once, for the loop to run once
    return Run(frame, lanes, shape, failed)


def _run_failed(run: Run, sums: Sums) -> None:
    """Reconstruct the lanes that need it once more, exactly; waits for the run."""
    chosen: Any = dr.compress(run.failed)
    if dr.width(chosen):
        again = Lanes(**{name: dr.gather(type(part), part, chosen) for name, part in vars(run.lanes).items()})
        dr.eval(vars(again))
        _run(run.frame, again, replace(run.shape, exact=True), sums)


def _inside(frame: Frame, lanes: Lanes, shape: Shape) -> dict[Pixel, Any]:
    """Whether each pixel of a lane lies in the frame; those of other strips too, for all strips to decide alike."""
    unsigned = arrays().UInt
    # Unsigned, a negative coordinate is a large one.
    rows = {r: unsigned(lanes.row + r) < frame.height for r in shape.places[0]}
    columns = {c: unsigned(lanes.column + c) < frame.width for c in shape.places[1]}
    return {(r, c): rows[r] & columns[c] for r, c in shape.pixels}
