"""Raw files of flat and dark frames: read together, checked to belong together, and the pixel that they tell."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rodcone.errors import InputError
from sensor.cameras.numbers import PixelNumbers, SourcedValue, bits_of
from sensor.emva1288.from_frames import FrameFigures, Interval, figures_of_frames
from sensor.raw import RawImage
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
    cut = {path: _middle(raw, window) for path, raw in raws.items()}
    try:
        return figures_of_frames(
            [cut[path] for path in flats], [cut[path] for path in darks], raws[first].cfa, raws[first].white_dn
        )
    except InputError as error:
        names = ", ".join(path.name for path in flats)
        raise InputError(f"{error} (flat frames: {names})") from error


def frame_numbers(figures: FrameFigures, files: Sequence[Path]) -> PixelNumbers:
    """Pixel that frames tell, every number with its 95 % interval."""
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


def _middle(raw: RawImage, window: int | None) -> NDArray[np.uint16]:
    """Square in the middle of a frame, beginning with the tile's first position."""
    if window is None:
        return raw.dn
    height, width = raw.dn.shape
    rows, columns = len(raw.cfa), len(raw.cfa[0])
    if not max(rows, columns) <= window <= min(height, width):
        raise InputError(
            f"window: {window} pixels don't fit a frame of {height} x {width}; allowed: up to its side; give fewer"
        )
    top, left = (height - window) // 2 // rows * rows, (width - window) // 2 // columns * columns
    return raw.dn[top : top + window, left : left + window]
