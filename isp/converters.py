"""Raw files as other programs develop them: a negative, and a 16-bit Bayer one beside it where it isn't one itself."""

from dataclasses import replace
from math import ceil, log2
from pathlib import Path

import numpy as np

from isp.remosaic import remosaic
from sensor.cfa import is_bayer
from sensor.raw import RawImage
from sensor.raw_files.raw_file import write_raw

MOST_STEP = 3.0  # of 16-bit numbers, in standard deviations of dark noise: a mean is then off by 4 % of a step at most


def for_converters(raw: RawImage) -> RawImage | None:
    """Bayer raw image of 16-bit whole numbers, which every raw converter develops; None where `raw` is one.

    Another mosaic is re-mosaiced (`isp.remosaic`). Floats become whole numbers where steps of 16 bits are at most
    `MOST_STEP` standard deviations of dark noise; elsewhere they stay floats, which some converters refuse.

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
    """Step of a raw image's samples as whole numbers of 16 bits, a power of two of its own digital numbers [e-]."""
    return float(raw.gain_e_per_dn * 2.0 ** max(ceil(log2(raw.white_dn / 65_535)), 0))


def write_with_bayer(raw: RawImage, path: str | Path, *, frame: int | None = None) -> tuple[Path, ...]:
    """Write a raw file and, beside a .dng that not every converter develops, NAME_bayer.dng; gives their paths.

    Of RGBW, quad mosaics and merged readings the .dng is for rodcone and software that reads mosaics; converters are
    given NAME_bayer.dng (`for_converters`). A .tif has its .json beside it.

    Parameters
    ----------
    raw : RawImage
        For a .dng with colours, such as `capture` gives it.
    path : str or Path
        Ends in .dng, .tif or .tiff.
    frame : int, optional
        Number of the exposure in a burst, which a .dng notes.

    Raises
    ------
    InputError
        For another ending, or a raw image that the format can't hold.
    OSError
        Where the folder is missing or can't be written.
    """
    path = Path(path)
    written = write_raw(raw, path, frame=frame)
    bayer = for_converters(raw) if path.suffix.lower() == ".dng" else None
    return written if bayer is None else (*written, *write_raw(bayer, bayer_name(path), frame=frame))


def bayer_name(path: Path) -> Path:
    """Name of the Bayer negative beside a negative."""
    return path.with_stem(f"{path.stem}_bayer")


def converter_note(raw: RawImage, path: Path) -> str:
    """Say which file a converter is given in place of a negative of merged samples, and how it differs; else empty.

    That another mosaic than Bayer's is re-mosaiced for it goes without saying: `rodcone --help` says so once.
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
