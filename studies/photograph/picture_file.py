"""Write pictures as PNG or TIFF files with 8 or 16 bits per channel; the file name's ending chooses.

PNG is written here, because Pillow writes no RGB with 16 bits. A PNG in sRGB says so in its chunk `sRGB`. One in
Display P3 says so twice: in `cICP`, four numbers that programs of PNG's third edition (W3C, 2025) read first, and in
`iCCP`, a profile that older programs read (ICC.1:2022, version 4.4).
"""

import struct
import zlib
from functools import cache
from io import BytesIO
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from isp.colour.encoding import ENCODINGS, quantise
from isp.picture import Picture
from rodcone.errors import InputError, require_name
from rodcone.files import require_ending, write_files
from studies.metrics.compare import ReferencePicture

DATA = Path(__file__).parents[1] / "data"
_SIGNATURE = b"\x89PNG\r\n\x1a\n"
_SOFTWARE = b"Software\0rodcone"
_RGB, _PERCEPTUAL, _UP = 2, 0, 2  # colour type RGB, sRGB's rendering intent, filter: difference from the row above
# Primaries of P3 with D65, transfer function of sRGB, R G B without a matrix, full range: ITU-T H.273, tables 2 to 4.
_P3_CODES = bytes([12, 13, 0, 1])


def to_png(samples: NDArray[np.unsignedinteger], encoding: str = "srgb") -> bytes:
    """Return samples (h, w, 3), as `isp.colour.encoding.quantise` gives them, as a PNG file (W3C PNG, 3rd edition)."""
    height, width = samples.shape[:2]
    bits = 8 * samples.itemsize
    rows = np.frombuffer(samples.astype(f">u{samples.itemsize}").tobytes(), np.uint8).reshape(height, -1)
    filtered = np.empty((height, rows.shape[1] + 1), np.uint8)
    filtered[:, 0] = _UP
    filtered[0, 1:] = rows[0]
    filtered[1:, 1:] = rows[1:] - rows[:-1]  # modulo 256, as the filter is defined
    header = struct.pack(">IIBBBBB", width, height, bits, _RGB, 0, 0, 0)
    data = zlib.compress(filtered.tobytes(), 6)
    before = (b"IHDR", header), *_colour_chunks(encoding), (b"tEXt", _SOFTWARE)
    chunks = (*before, (b"IDAT", data), (b"IEND", b""))
    return _SIGNATURE + b"".join(_chunk(name, content) for name, content in chunks)


def _colour_chunks(encoding: str) -> tuple[tuple[bytes, bytes], ...]:
    if encoding == "srgb":
        return ((b"sRGB", bytes([_PERCEPTUAL])),)
    title = ENCODINGS[encoding].title.encode("ascii") + b"\0\0"  # the end of the name, and the only compression method
    return (b"cICP", _P3_CODES), (b"iCCP", title + zlib.compress(icc_profile(encoding)))


def _chunk(name: bytes, content: bytes) -> bytes:
    return struct.pack(">I", len(content)) + name + content + struct.pack(">I", zlib.crc32(name + content))


@cache
def icc_profile(encoding: str) -> bytes:
    """Return the ICC display profile of an encoding: primaries, adaptation to D50, and the curve of IEC 61966-2-1."""
    return (DATA / f"{encoding}.icc").read_bytes()


ENDINGS = (".png", ".tif", ".tiff")
BITS = (8, 16)


def check_picture_file(path: Path, bits: int, encoding: str) -> None:
    """Raise `InputError` where a picture can't be written under this name, with these bits or in this encoding."""
    require_ending(path, *ENDINGS)
    if bits not in BITS:
        raise InputError(f"bits: {bits!r} is not allowed; give 8 or 16")
    require_name("encoding", encoding, ENCODINGS)


def default_path(raw: Path) -> Path:
    """Return the raw file's name with .png; raise `InputError` where another program wrote a picture of that name."""
    path = raw.with_suffix(".png")
    if path.is_file() and path != raw:
        with path.open("rb") as file:
            if _SOFTWARE not in file.read(1 << 12):
                raise InputError(f"out: {str(path)!r} exists and isn't rodcone's; to write over it give -o {path}")
    return path


def write_picture(
    picture: Picture | ReferencePicture | NDArray[np.floating], path: str | Path, bits: int = 8, encoding: str = "srgb"
) -> None:
    """Write a picture, whole or not at all.

    Parameters
    ----------
    picture : Picture, ReferencePicture, or (h, w, 3) or (h, w) array
        A `Picture` or `ReferencePicture` is linear, and is encoded here. An array must be encoded already, with 0 for
        black and 1 for white.
    path : path
        Ends in ``.png``, ``.tif`` or ``.tiff``.
    bits : int
        8 or 16 bits per channel.
    encoding : str
        Name in `isp.colour.encoding.ENCODINGS`; for an array, the encoding that it has.

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
    encoded = picture.encode(encoding=encoding) if isinstance(picture, Picture | ReferencePicture) else picture
    write = to_png if path.suffix.lower() == ".png" else to_tiff
    content = write(quantise(encoded, bits), encoding)
    write_files({path: content})


def to_tiff(samples: NDArray[np.unsignedinteger], encoding: str = "srgb") -> bytes:
    """Return samples (h, w, 3), as `quantise` gives them, as a TIFF file (revision 6.0, deflate) with its profile."""
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
        iccprofile=icc_profile(encoding),
    )
    return file.getvalue()
