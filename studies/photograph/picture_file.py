"""Developed pictures as files, by the ending of their name: PNG and TIFF of 8 or 16 bits a channel."""

from io import BytesIO
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from isp.colour.encoding import ENCODINGS, quantise
from isp.picture import Picture
from rodcone.errors import InputError, unknown
from rodcone.files import replacing
from studies.photograph.png import icc_profile, to_png

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


def write_picture(
    picture: Picture | NDArray[np.floating], path: str | Path, bits: int = 8, encoding: str = "srgb"
) -> None:
    """Write a picture, whole or not at all.

    Parameters
    ----------
    picture : Picture or (h, w, 3) or (h, w) array
        A `Picture` is linear and encodes itself. An array is one that is encoded, 0 black and 1 white.
    path : path
        Ends in ``.png``, ``.tif`` or ``.tiff``.
    bits : int
        8 or 16 a channel.
    encoding : str
        Of `isp.colour.encoding.ENCODINGS`; that of an array.

    Raises
    ------
    InputError
        As `check_picture_file` and `isp.colour.encoding.quantise`.
    OSError
        Where the folder is missing or can't be written.

    Warns
    -----
    UserWarning
        Where values are clipped: how many.
    """
    path = Path(path)
    check_picture_file(path, bits, encoding)
    encoded = picture.encode(encoding=encoding) if isinstance(picture, Picture) else picture
    write = to_png if path.suffix.lower() == ".png" else to_tiff
    content = write(quantise(encoded, bits), encoding)
    with replacing(path) as (place,):
        place.write_bytes(content)


def to_tiff(samples: NDArray[np.unsignedinteger], encoding: str = "srgb") -> bytes:
    """TIFF file (revision 6.0, deflate) of samples (h, w, 3) as `quantise` gives them, their colour profile in it."""
    import tifffile

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
