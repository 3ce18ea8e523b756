"""Measure a camera's pixel from raw files of flat and dark frames, which are checked to belong together."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from math import isnan
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from rodcone.errors import InputError
from sensor.cameras.frame_sets import FrameSet, LightFrames, open_set, read_frame_pixels, white_level
from sensor.cameras.numbers import PixelNumbers, SourcedValue, bits_of
from sensor.cfa import Tile
from sensor.emva1288.from_frames import (
    LEAST_SIDE,
    FrameFigures,
    Interval,
    LightStack,
    figures_of_frames,
    figures_of_stacks,
    stack_of,
)
from sensor.raw_files.raw_file import read_raw

MOST_FILES = 1000
_UNTOLD = {
    "pitch_um": "not told by frames: needed; sensor width over pixels across",
    "fill_factor": "not told by frames: needed; 1 where the quantum efficiency is the whole pixel's",
    "dark_current_e_per_s": "not told by dark frames of one exposure time; its shot noise is in read_noise_e",
}


def measure_files(flats: Sequence[Path], darks: Sequence[Path], window: int | None) -> FrameFigures:
    """Measure a camera from its raw files.

    Parameters
    ----------
    window : int, optional
        Width in pixels of the square in the middle to measure; None for the whole frame.

    Raises
    ------
    InputError
        For a file that can't be read, files that differ in size, mosaic, white level or exposure index, or frames that
        `figures_of_frames` refuses; files are named.
    """
    if len(flats) + len(darks) > MOST_FILES:
        raise InputError(f"frames: {len(flats) + len(darks)} files; allowed: {MOST_FILES}; give fewer")
    raws = {path: read_raw(path) for path in (*flats, *darks)}
    if len(raws) < len(flats) + len(darks):
        raise InputError("frames: a file is given twice; allowed: each once, or its noise would be counted twice")
    first, *others = raws
    for path in others:
        for name in ("shape", "cfa", "white_dn", "iso"):
            ours, its = getattr(raws[first], name), getattr(raws[path], name)
            if ours != its:
                raise InputError(
                    f"{path}: {name} is {its!r}, that of {first} is {ours!r}; allowed: one; take one camera"
                )
    cut = {path: _middle(raw.dn, raw.cfa, window) for path, raw in raws.items()}
    try:
        return figures_of_frames(
            [cut[path] for path in flats], [cut[path] for path in darks], raws[first].cfa, raws[first].white_dn
        )
    except InputError as error:
        names = ", ".join(path.name for path in flats)
        raise InputError(f"{error} (flat frames: {names})") from error


def measure_place(path: Path, window: int | None) -> FrameFigures:
    """Measure a camera from a set of frames: a folder, a zip file, a descriptor or a list (`frame_sets.open_set`)."""
    with open_set(path) as frames:
        return measure_set(frames, window)


def measure_set(frames: FrameSet, window: int | None = None) -> FrameFigures:
    """Measure a camera from frames by light, which are read one light after the other.

    A light with one frame is left out and named in the notes, as is one without any signal above the dark.

    Raises
    ------
    InputError
        For frames that can't be read, differ in size or mosaic, or that `figures_of_stacks` refuses.
    """
    pairs = [light for light in frames.lights if len(light.frames) > 1]
    flats, darks = ([light for light in pairs if light.lit is lit] for lit in (True, False))
    for name, lights in (("flat", flats), ("dark", darks)):
        if not lights:
            raise InputError(f"{name} frames: none has two or more of one light; allowed: two or more; take others")
    # What all have in common
    ends = [read_frame_pixels(lights[-1].frames[0], frames) for lights in (darks, flats)]
    notes = list(frames.notes)
    white_dn = ends[1].white_dn
    if isnan(white_dn):
        white_dn, note = white_level([read_frame_pixels(light.frames[0], frames) for light in flats])
        notes.append(note)
    if len(pairs) < len(frames.lights):
        notes.append(f"{len(frames.lights) - len(pairs)} lights with a single frame are left out")
    shape = ends[0].dn.shape
    tile = ends[0].cfa
    if min(shape[0] // len(tile), shape[1] // len(tile[0])) < LEAST_SIDE:
        raise InputError(f"frames: {shape[0]} x {shape[1]} pixels are too few; allowed: {LEAST_SIDE} tiles a side")

    def stacks(lights: Sequence[LightFrames]) -> Iterator[LightStack]:
        for light in lights:
            read = [read_frame_pixels(frame, frames) for frame in light.frames]
            for frame, one in zip(light.frames, read, strict=True):
                if one.dn.shape != shape or one.cfa != tile:
                    name = frame if isinstance(frame, Path) else "array"
                    raise InputError(
                        f"{name}: {one.dn.shape} of {one.cfa}, where the first frame is {shape} of {tile}; allowed: "
                        "one size and mosaic; take frames of one camera"
                    )
            cut = [_middle(one.dn, tile, window) for one in read]
            yield stack_of(cut, tile, white_dn, light.exposure_s, light.photons)

    found = figures_of_stacks(stacks(flats), list(stacks(darks)), tile, white_dn)
    return replace(found, notes=(*notes, *found.notes))


def frame_numbers(figures: FrameFigures, files: Sequence[Path]) -> PixelNumbers:
    """Return the numbers of the pixel that were measured on the frames, each with its 95 % interval."""
    *flats, darks = figures.frames
    source_note = f"measured on {sum(flats)} flat and {darks} dark frames, {files[0].name} and others"
    gain = figures.gain_dn_per_e
    white = figures.white_dn - figures.black_dn
    pixel = {
        "full_well_e": SourcedValue(
            white / gain.value,
            f"electrons at white, {white:.6g} DN over K = {_interval_text(gain)} DN/e- (eq. 50); "
            "the photodiode may hold more",
        ),
        "read_noise_e": SourcedValue(
            figures.read_noise_e.value, f"temporal dark noise, {_interval_text(figures.read_noise_e)} e-"
        ),
        "dsnu_e": SourcedValue(figures.dsnu_e.value, f"DSNU1288 (eq. 66), {_interval_text(figures.dsnu_e)} e-"),
        "prnu": SourcedValue(figures.prnu.value, f"PRNU1288 (eq. 67), {_interval_text(figures.prnu)}"),
    }
    settings = {
        "bits": bits_of(figures.white_dn, figures.black_dn, "the frames"),
        "black_level_dn": SourcedValue(round(figures.black_dn), f"mean of the dark frames, {figures.black_dn:.5g} DN"),
    }
    return PixelNumbers(source_note, pixel, settings, _UNTOLD, cfa=figures.cfa)


def _interval_text(interval: Interval) -> str:
    return f"{interval.value:.4g} ({interval.low:.4g} to {interval.high:.4g}, 95 %)"


def _middle(dn: NDArray[Any], tile: Tile, window: int | None) -> NDArray[Any]:
    """Cut a square out of the middle of a frame, beginning with the tile's first position; None keeps the frame."""
    if window is None:
        return dn
    height, width = dn.shape
    rows, columns = len(tile), len(tile[0])
    if not max(rows, columns) <= window <= min(height, width):
        raise InputError(
            f"window: {window} pixels don't fit a frame of {height} x {width}; allowed: up to its side; give fewer"
        )
    top, left = (height - window) // 2 // rows * rows, (width - window) // 2 // columns * columns
    return dn[top : top + window, left : left + window]
