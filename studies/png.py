"""Pictures as PNG of 8 or 16 bits a channel (Pillow writes no RGB of 16), lossless."""

import struct
import zlib

import numpy as np
from numpy.typing import NDArray

from render.errors import InputError

_SIGNATURE = b"\x89PNG\r\n\x1a\n"
_RGB, _PERCEPTUAL, _UP = 2, 0, 2  # colour type, sRGB rendering intent, filter: the difference from the row above


def to_png(encoded: NDArray[np.float64], bits: int = 8) -> bytes:
    """PNG file (W3C PNG, 3rd edition) of encoded sRGB (h, w, 3) in [0, 1].

    Raises
    ------
    InputError
        For other bits than 8 or 16.
    """
    if bits not in (8, 16):
        raise InputError(f"bits: {bits!r} is not allowed; give 8 or 16")
    height, width = encoded.shape[:2]
    samples = np.rint(encoded * (2**bits - 1)).astype(f">u{bits // 8}")
    rows = np.frombuffer(samples.tobytes(), np.uint8).reshape(height, -1)
    filtered = np.empty((height, rows.shape[1] + 1), np.uint8)
    filtered[:, 0] = _UP
    filtered[0, 1:] = rows[0]
    filtered[1:, 1:] = rows[1:] - rows[:-1]  # modulo 256, as the filter is defined
    header = struct.pack(">IIBBBBB", width, height, bits, _RGB, 0, 0, 0)
    chunks = ((b"IHDR", header), (b"sRGB", bytes([_PERCEPTUAL])), (b"IDAT", zlib.compress(filtered.tobytes(), 6)))
    return _SIGNATURE + b"".join(_chunk(name, content) for name, content in (*chunks, (b"IEND", b"")))


def _chunk(name: bytes, content: bytes) -> bytes:
    return struct.pack(">I", len(content)) + name + content + struct.pack(">I", zlib.crc32(name + content))
