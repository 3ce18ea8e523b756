"""Developed pictures as files, by the ending of their name: PNG and TIFF of 8 or 16 bits a channel."""

from io import BytesIO
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from isp.colour.encoding import ENCODINGS
from rodcone.errors import InputError, unknown
from rodcone.files import replacing
from studies.photograph.icc import icc_profile
from studies.photograph.png import to_png

ENDINGS = (".png", ".tif", ".tiff")
BITS = (8, 16)


def check_picture_file(path: Path, bits: int, encoding: str) -> None:
    """Raise `InputError` where a picture can't be written under this name, with these bits or in this encoding."""
    if path.suffix.lower() not in ENDINGS:
        raise InputError(f"out: {str(path)!r} has another ending; allowed: {', '.join(ENDINGS)}; rename it")
    if bits not in BITS:
        raise InputError(f"bits: {bits!r} is not allowed; give 8 or 16")
    if encoding not in ENCODINGS:
        raise unknown("encoding", encoding, ENCODINGS)


def write_picture(encoded: NDArray[np.float64], path: str | Path, bits: int = 8, encoding: str = "srgb") -> None:
    """Write an encoded picture (h, w, 3) in [0, 1]; it appears whole or not at all.

    Raises
    ------
    InputError
        As `check_picture_file`.
    OSError
        Where the folder is missing or can't be written.
    """
    path = Path(path)
    check_picture_file(path, bits, encoding)
    write = to_png if path.suffix.lower() == ".png" else to_tiff
    content = write(encoded, bits, encoding)
    with replacing(path) as (place,):
        place.write_bytes(content)


def to_tiff(encoded: NDArray[np.float64], bits: int = 8, encoding: str = "srgb") -> bytes:
    """TIFF file (revision 6.0, deflate) of an encoded picture (h, w, 3) in [0, 1], its colour profile in it."""
    import tifffile

    samples = np.rint(encoded * (2**bits - 1)).astype(f"u{bits // 8}")
    file = BytesIO()
    tifffile.imwrite(
        file,
        samples,
        photometric="rgb",
        compression="zlib",
        predictor=True,
        metadata=None,
        software="rodcone",
        iccprofile=icc_profile(ENCODINGS[encoding]),
    )
    return file.getvalue()
