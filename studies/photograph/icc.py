"""Colour profiles of the encodings, so that a picture says what its numbers mean: ICC.1:2022 (version 4.4)."""

import struct

import numpy as np

from isp.colour.encoding import Encoding
from rodcone.colour_spaces import D50_XYZ, adapt_to_d65, rgb_to_xyz

# Curve of IEC 61966-2-1 as the parameters g, a, b, c, d of ICC's function type 3: linear under d.
_CURVE = (2.4, 1 / 1.055, 0.055 / 1.055, 1 / 12.92, 0.04045)
_HEADER = 128


def icc_profile(encoding: Encoding) -> bytes:
    """Display profile of three primaries and one curve."""
    to_d50 = np.linalg.inv(adapt_to_d65(np.eye(3), D50_XYZ).T)
    columns = (to_d50 @ rgb_to_xyz(encoding.primaries_xy)).T
    curve = b"para" + bytes(4) + struct.pack(">HH", 3, 0) + _fixed(*_CURVE)
    content = {
        b"desc": _text(encoding.title),
        b"cprt": _text("CC0"),
        b"wtpt": _xyz(*D50_XYZ),
        b"chad": b"sf32" + bytes(4) + _fixed(*to_d50.ravel()),
        **{name + b"XYZ": _xyz(*column) for name, column in zip((b"r", b"g", b"b"), columns, strict=True)},
        **{name + b"TRC": curve for name in (b"r", b"g", b"b")},
    }
    table, body = struct.pack(">I", len(content)), b""
    for name, value in content.items():
        place = _HEADER + 4 + 12 * len(content) + len(body)
        table += name + struct.pack(">II", place, len(value))
        body += value.ljust(-(-len(value) // 4) * 4, b"\0")
    size = _HEADER + len(table) + len(body)
    header = struct.pack(">I4sI4s4s4s", size, bytes(4), 0x04400000, b"mntr", b"RGB ", b"XYZ ")
    header += struct.pack(">6H", 2026, 1, 1, 0, 0, 0) + b"acsp"
    return (header.ljust(68, b"\0") + _fixed(*D50_XYZ)).ljust(_HEADER, b"\0") + table + body


def _fixed(*values: float) -> bytes:
    """Numbers of 16 bits before and behind the point."""
    return struct.pack(f">{len(values)}i", *(round(float(value) * 65536) for value in values))


def _xyz(*values: float) -> bytes:
    return b"XYZ " + bytes(4) + _fixed(*values)


def _text(text: str) -> bytes:
    """One text, in English."""
    coded = text.encode("utf-16-be")
    return b"mluc" + bytes(4) + struct.pack(">II", 1, 12) + b"enUS" + struct.pack(">II", len(coded), 28) + coded
