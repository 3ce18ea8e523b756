"""Raw files for other programs: a DNG, and beside it a second DNG in 16-bit Bayer if the first isn't that."""

from dataclasses import replace
from math import ceil, log2
from pathlib import Path

import numpy as np

from isp.remosaic import remosaic
from sensor.cfa import is_bayer
from sensor.raw import RawImage
from sensor.raw_files.raw_file import write_raw

MOST_STEP = 3.0  # largest step of 16-bit numbers, in standard deviations of dark noise; means then err by 4 % of a step


def for_converters(raw: RawImage) -> RawImage | None:
    """Convert a raw image to 16-bit Bayer, which every raw converter develops; return None if it needs no change.

    Mosaics other than Bayer are re-mosaiced (`isp.remosaic`). Floats become whole numbers if the steps of 16 bits are
    at most `MOST_STEP` standard deviations of dark noise. Otherwise they stay floats, which some converters refuse.

    Raises
    ------
    InputError
        For a mosaic that can't become Bayer.
    """
    made = raw if is_bayer(raw.cfa) else remosaic(raw)
    step_e = sixteen_bit_step_e(made)
    if made.dn.dtype.kind == "f" and step_e <= MOST_STEP * made.dark_noise_e:
        step = step_e / made.gain_e_per_dn
        made = replace(
            made,
            dn=np.rint(np.clip(made.dn / step, 0.0, 65_535.0)).astype(np.uint16),
            black_dn=made.black_dn / step,
            white_dn=round(made.white_dn / step),
            gain_e_per_dn=made.gain_e_per_dn * step,
        )
    return None if made is raw else made


def sixteen_bit_step_e(raw: RawImage) -> float:
    """Return the step [e-] that a raw image's samples have in 16 bits: one digital number times a power of two."""
    return float(raw.gain_e_per_dn * 2.0 ** max(ceil(log2(raw.white_dn / 65_535)), 0))


def write_with_bayer(raw: RawImage, path: str | Path, *, frame: int | None = None) -> tuple[Path, ...]:
    """Write a raw file and, if it is a .dng that not every converter develops, NAME_bayer.dng; return their paths.

    A .dng of RGBW, a quad mosaic or merged readings is for rodcone and software that reads mosaics. NAME_bayer.dng is
    for raw converters (`for_converters`). A .tif gets a .json beside it.

    Parameters
    ----------
    raw : RawImage
        Raw image; a .dng needs its colours, which `capture` states.
    path : str or Path
        Path that ends in .dng, .tif or .tiff.
    frame : int, optional
        Number of the exposure in a burst, which a .dng records.

    Raises
    ------
    InputError
        For another ending, or a raw image that the format can't hold.
    OSError
        If the folder is missing or can't be written.
    """
    path = Path(path)
    written = write_raw(raw, path, frame=frame)
    bayer = for_converters(raw) if path.suffix.lower() == ".dng" else None
    return written if bayer is None else (*written, *write_raw(bayer, bayer_name(path), frame=frame))


def bayer_name(path: Path) -> Path:
    """Return the path of the Bayer negative beside a negative."""
    return path.with_stem(f"{path.stem}_bayer")


def converter_note(raw: RawImage, path: Path) -> str:
    """Return a text that says which file to give to a converter instead of the DNG `path`, and how this file differs.

    The text is empty unless samples are floats, as merged readings are, and the other file exists. If the mosaic is the
    only difference, there is no text, because `rodcone --help` explains it.
    """
    ways = [] if is_bayer(raw.cfa) else ["re-mosaiced"]
    if raw.dn.dtype.kind == "f":
        step_e = sixteen_bit_step_e(raw)
        steps = f"steps of {step_e:.2g} e- beside dark noise of {raw.dark_noise_e:.2g} e-"
        if step_e <= MOST_STEP * raw.dark_noise_e:
            ways += [f"in whole numbers of 16 bits ({steps})"]
        elif ways:
            ways += [f"in floats, which some refuse (16 bits would have {steps})"]
    told = raw.dn.dtype.kind == "f" and ways
    return f"{path.name}: give {bayer_name(path).name} to raw converters: it is {', '.join(ways)}" if told else ""
