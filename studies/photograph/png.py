"""Pictures as PNG of 8 or 16 bits a channel (Pillow writes no RGB of 16), lossless.

What the numbers mean: for sRGB the chunk `sRGB`. For Display P3 both `cICP`, four numbers that say it exactly and that
programs of PNG's third edition (W3C, 2025) put first, and `iCCP`, a profile that older ones read.
"""

import struct
import zlib

import numpy as np
from numpy.typing import NDArray

from isp.colour.encoding import ENCODINGS
from studies.photograph.icc import icc_profile

_SIGNATURE = b"\x89PNG\r\n\x1a\n"
_RGB, _PERCEPTUAL, _UP = 2, 0, 2  # colour type, sRGB rendering intent, filter: the difference from the row above
# Primaries of P3 with D65, transfer function of sRGB, R G B as they are, full range: ITU-T H.273, tables 2 to 4.
_P3_CODES = bytes([12, 13, 0, 1])


def to_png(encoded: NDArray[np.float64], bits: int = 8, encoding: str = "srgb") -> bytes:
    """PNG file (W3C PNG, 3rd edition) of an encoded picture (h, w, 3) in [0, 1]."""
    height, width = encoded.shape[:2]
    samples = np.rint(encoded * (2**bits - 1)).astype(f">u{bits // 8}")
    rows = np.frombuffer(samples.tobytes(), np.uint8).reshape(height, -1)
    filtered = np.empty((height, rows.shape[1] + 1), np.uint8)
    filtered[:, 0] = _UP
    filtered[0, 1:] = rows[0]
    filtered[1:, 1:] = rows[1:] - rows[:-1]  # modulo 256, as the filter is defined
    header = struct.pack(">IIBBBBB", width, height, bits, _RGB, 0, 0, 0)
    data = zlib.compress(filtered.tobytes(), 6)
    chunks = ((b"IHDR", header), *_colour_chunks(encoding), (b"IDAT", data), (b"IEND", b""))
    return _SIGNATURE + b"".join(_chunk(name, content) for name, content in chunks)


def _colour_chunks(encoding: str) -> tuple[tuple[bytes, bytes], ...]:
    if encoding == "srgb":
        return ((b"sRGB", bytes([_PERCEPTUAL])),)
    title = ENCODINGS[encoding].title.encode("ascii") + b"\0\0"  # the name's end, and the one compression there is
    return (b"cICP", _P3_CODES), (b"iCCP", title + zlib.compress(icc_profile(ENCODINGS[encoding])))


def _chunk(name: bytes, content: bytes) -> bytes:
    return struct.pack(">I", len(content)) + name + content + struct.pack(">I", zlib.crc32(name + content))
