"""ENVI's pictures: a text header, ``.hdr``, and the numbers as they are in a file beside it.

The names are those of "ENVI Header Files" (NV5 Geospatial's documentation).
"""

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from render.radiance_files.file_checks import require_extent, require_file
from rodcone.errors import InputError
from rodcone.types import Floats

MOST_BYTES = 1 << 20  # of a header; one of 500 bands with their names takes 20 kB
_TYPES = {1: "u1", 2: "i2", 3: "i4", 4: "f4", 5: "f8", 12: "u2", 13: "u4", 14: "i8", 15: "u8"}
_ORDER = {
    "bsq": ("bands", "lines", "samples"),
    "bil": ("lines", "bands", "samples"),
    "bip": ("lines", "samples", "bands"),
}
_ENDINGS = ("", ".raw", ".img", ".dat", ".bin", ".bsq", ".bil", ".bip")
_FIELD = re.compile(r"^\s*([^=;\n]+?)\s*=\s*(\{[^}]*\}|[^\n]*)", re.MULTILINE)
_UNITS = {"nanometers": 1.0, "micrometers": 1000.0, "unknown": 1.0}


@dataclass(frozen=True)
class Envi:
    """Numbers (h, w, band) of an ENVI picture, its wavelengths [nm] if it states them, and what a stored 1 is worth."""

    values: NDArray[Any]
    wavelength_nm: Floats | None
    scale: float


def data_file(header: str | Path) -> Path:
    """File of the numbers: of the header's name without ``.hdr``, or with another ending.

    Raises
    ------
    InputError
        Where there is none.
    """
    stem = Path(header).with_suffix("")
    for ending in _ENDINGS:
        beside = stem.with_name(stem.name + ending)
        if beside.is_file():
            return beside
    raise InputError(
        f"there are no numbers beside it; allowed: {stem.name} with one of {', '.join(_ENDINGS[1:])}; add it"
    )


def open_envi(header: Path) -> Envi:
    """Open a picture; its numbers stay in their file until they are read.

    Raises
    ------
    InputError
        For a header that isn't ENVI's, lacks a number or is compressed, or a data file of another size.
    """
    if require_file(header) > MOST_BYTES:
        raise InputError(f"its header is over {MOST_BYTES} bytes; give the .hdr of an ENVI picture")
    text = header.read_text("utf-8", errors="replace")
    if not text.startswith("ENVI"):
        raise InputError("it doesn't begin with ENVI; give the .hdr of an ENVI picture")
    fields = {" ".join(key.lower().split()): value.strip() for key, value in _FIELD.findall(text)}
    size = {name: _whole(fields, name, 1 << 20) for name in ("samples", "lines", "bands")}
    require_extent(size["lines"], size["samples"], size["bands"])
    kind, order = _whole(fields, "data type", 99), fields.get("interleave", "").lower()
    if kind not in _TYPES or order not in _ORDER:
        raise InputError(
            f"data type {kind} and interleave {order!r} are not allowed; give one of {', '.join(map(str, _TYPES))} "
            f"(real numbers) and one of {', '.join(_ORDER)}"
        )
    if _whole(fields, "file compression", 1, "0"):
        raise InputError("file compression: 1 is not allowed; save it without")
    dtype = np.dtype((">" if _whole(fields, "byte order", 1, "0") else "<") + _TYPES[kind])
    offset, numbers = _whole(fields, "header offset", 1 << 40, "0"), data_file(header)
    shape = tuple(size[name] for name in _ORDER[order])
    needed = offset + dtype.itemsize * int(np.prod(shape, dtype=np.int64))
    if require_file(numbers) < needed:
        raise InputError(
            f"{numbers.name} has {numbers.stat().st_size} bytes, its header stands for {needed}; copy it whole"
        )
    values = np.memmap(numbers, dtype, "r", offset, shape)
    values = np.moveaxis(values, [_ORDER[order].index(name) for name in ("lines", "samples", "bands")], (0, 1, 2))
    return Envi(values, _wavelengths(fields), 1.0 / _number(fields.get("reflectance scale factor", "1")))


def _wavelengths(fields: dict[str, str]) -> Floats | None:
    if "wavelength" not in fields:
        return None
    unit = fields.get("wavelength units", "unknown").lower()
    if unit not in _UNITS:
        raise InputError(f"wavelength units: {unit!r} is not allowed; give Nanometers or Micrometers")
    return np.array([_number(part) for part in fields["wavelength"].strip("{} \n").split(",")]) * _UNITS[unit]


def _number(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = np.nan
    if not 1e-30 < value < 1e30:
        raise InputError(f"{text.strip()!r} in its header is not a number above 0; correct it")
    return value


def _whole(fields: dict[str, str], name: str, most: int, default: str | None = None) -> int:
    text = fields.get(name, default)
    if text is None or not re.fullmatch(r"\d{1,13}", text) or int(text) > most:
        raise InputError(f"{name}: {text!r} is not a whole number of 0 to {most}; correct the header")
    return int(text)
