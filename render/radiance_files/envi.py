"""ENVI's pictures: a text header, ``.hdr``, and a file of plain numbers beside it.

Fields are named as in "ENVI Header Files" (NV5 Geospatial's documentation). A field that changes values, geometry or
their meaning is either applied or refused by name.
"""

import re
import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from render.radiance_files.file_checks import require_extent, require_file
from rodcone.curve_file import LENGTHS_NM
from rodcone.errors import InputError
from rodcone.file_keys import require_known
from rodcone.types import Floats

_MOST_HEADER_BYTES = 1 << 20  # a header of 500 bands with their names takes 20 kB
_TYPES = {1: "u1", 2: "i2", 3: "i4", 4: "f4", 5: "f8", 12: "u2", 13: "u4", 14: "i8", 15: "u8"}
_SIDES = {"height": "lines", "width": "samples", "wavelength": "bands"}
_ORDER = {
    "bsq": ("wavelength", "height", "width"),
    "bil": ("height", "wavelength", "width"),
    "bip": ("height", "width", "wavelength"),
}
_ENDINGS = ("", ".raw", ".img", ".dat", ".bin", ".bsq", ".bil", ".bip")
_FIELD = re.compile(r"^\s*([^=;\n]+?)\s*=\s*(\{[^}]*\}|[^\n]*)", re.MULTILINE)
_NO_UNIT = ("", "unknown")  # units of wavelength for which nm are assumed; values too small for nm are refused later


@dataclass(frozen=True)
class EnviPicture:
    """ENVI's picture, whose numbers are still in their file.

    Attributes
    ----------
    values : array
        Numbers as the file stores them, with its order of axes.
    axes : tuple of str
        ``height``, ``width`` and ``wavelength`` in the order of the array's axes.
    wavelength_nm : (band,) float64 or None
    radiance, reflectance : tuple of (band,) float64, or None
        Gain and offset of each band that give radiance or reflectance; None if the header states none.
    factor : float or None
        Reflectance of a stored 1, if the header states one divisor for all bands; it agrees with `reflectance`.
    good : (band,) bool
        Whether a band isn't marked as bad.
    ignored : float or None
        Value that marks missing data.
    """

    values: NDArray[Any]
    axes: tuple[str, ...]
    wavelength_nm: Floats | None
    radiance: tuple[Floats, Floats] | None
    reflectance: tuple[Floats, Floats] | None
    factor: float | None
    good: NDArray[np.bool_]
    ignored: float | None


def data_file(header: str | Path) -> Path:
    """Find the file of numbers: the header's name without ``.hdr``, or with another ending.

    Raises
    ------
    InputError
        If there is none.
    """
    stem = Path(header).with_suffix("")
    for ending in _ENDINGS:
        beside = stem.with_name(stem.name + ending)
        if beside.is_file():
            return beside
    raise InputError(
        f"there are no numbers beside it; allowed: {stem.name} with one of {', '.join(_ENDINGS[1:])}; add it"
    )


def open_envi(header: Path) -> EnviPicture:
    """Open ENVI's picture; its numbers stay in their file until they are read.

    Raises
    ------
    InputError
        For a header that isn't ENVI's, lacks a number, has a field that changes values and can't be applied, or a data
        file of another size.
    """
    fields = _fields(header)
    size = {axis: _whole(fields, name, 1 << 20) for axis, name in _SIDES.items()}
    require_extent(*size.values())
    kind = _whole(fields, "data type", 99)
    order = fields.get("interleave", "").lower()
    if kind not in _TYPES or order not in _ORDER:
        raise InputError(
            f"data type {kind} and interleave {order!r} are not allowed; give one of {', '.join(map(str, _TYPES))} "
            f"(real numbers) and one of {', '.join(_ORDER)}"
        )
    if _whole(fields, "file compression", 1, "0"):
        raise InputError("file compression: 1 is not allowed; save it without")
    dtype = np.dtype((">" if _whole(fields, "byte order", 1, "0") else "<") + _TYPES[kind])
    offset = _whole(fields, "header offset", 1 << 40, "0")
    numbers = data_file(header)
    shape = tuple(size[axis] for axis in _ORDER[order])
    needed = offset + dtype.itemsize * int(np.prod(shape, dtype=np.int64))
    if require_file(numbers) < needed:
        raise InputError(
            f"{numbers.name} has {numbers.stat().st_size} bytes, its header stands for {needed}; copy it whole"
        )
    bands = size["wavelength"]
    ignored = fields.get("data ignore value")
    return EnviPicture(
        np.memmap(numbers, dtype, "r", offset, shape),
        _ORDER[order],
        _wavelengths(fields),
        _law(fields, "data gain values", "data offset values", bands),
        *_reflectance(fields, bands),
        _list(fields, "bbl", bands, 1.0) != 0,
        None if ignored is None else _number("data ignore value", ignored),
    )


def _fields(header: Path) -> dict[str, str]:
    """Read a header's fields by name; refuse a field that would change values and that this program doesn't apply."""
    if require_file(header) > _MOST_HEADER_BYTES:
        raise InputError(f"its header is over {_MOST_HEADER_BYTES} bytes; give the .hdr of an ENVI picture")
    text = header.read_text("utf-8", errors="replace")
    if not text.startswith("ENVI"):
        raise InputError("it doesn't begin with ENVI; give the .hdr of an ENVI picture")
    fields = {" ".join(key.lower().replace("_", " ").split()): value.strip() for key, value in _FIELD.findall(text)}
    require_known("ENVI header", fields)
    if fields.get("file type", "ENVI Standard").lower() not in ("envi standard", "envi"):
        raise InputError(f"file type: {fields['file type']!r} is not allowed; give an ENVI Standard picture")
    return fields


def _law(fields: Mapping[str, str], gains: str, offsets: str, bands: int) -> tuple[Floats, Floats] | None:
    """Return the gain and offset of each band; None if the header states neither."""
    if gains not in fields and offsets not in fields:
        return None
    return _list(fields, gains, bands, 1.0), _list(fields, offsets, bands, 0.0)


def _reflectance(fields: Mapping[str, str], bands: int) -> tuple[tuple[Floats, Floats] | None, float | None]:
    """Return each band's gain and offset to reflectance, and the common factor; refuse a header where they differ."""
    law = _law(fields, "data reflectance gain values", "data reflectance offset values", bands)
    if "reflectance scale factor" not in fields:
        return law, None
    factor = _number("reflectance scale factor", fields["reflectance scale factor"])
    if not 1e-30 < factor < 1e30:
        raise InputError(f"reflectance scale factor: {factor:g} is not a number above 0; correct it")
    one = np.full(bands, 1.0 / factor), np.zeros(bands)
    if law is not None and not np.allclose(law, one, rtol=1e-6, atol=0.0):
        raise InputError(
            f"reflectance scale factor: {factor:g} and the data reflectance gain and offset values disagree; allowed: "
            "one of them; take the other out"
        )
    return law, 1.0 / factor


def _wavelengths(fields: Mapping[str, str]) -> Floats | None:
    if "wavelength" not in fields:
        return None
    unit = fields.get("wavelength units", "").lower()
    if unit not in LENGTHS_NM and unit not in _NO_UNIT:
        raise InputError(f"wavelength units: {unit!r} is not allowed; give Nanometers or Micrometers")
    values = np.array([_number("wavelength", part) for part in _parts(fields["wavelength"])])
    if unit in _NO_UNIT:
        warnings.warn("its header states no wavelength units: nm are taken", stacklevel=4)
    return values * LENGTHS_NM.get(unit, 1.0)


def _parts(text: str) -> list[str]:
    """Split a list into its entries, without the empty one after a final comma."""
    parts = [part.strip() for part in text.strip("{} \t\r\n").split(",")]
    return parts[:-1] if parts[-1] == "" else parts


def _list(fields: Mapping[str, str], name: str, bands: int, default: float) -> Floats:
    """Return a field's numbers, one per band, or the default for each."""
    if name not in fields:
        return np.full(bands, default)
    values = np.array([_number(name, part) for part in _parts(fields[name])])
    if values.size != bands:
        raise InputError(f"{name}: {values.size} numbers don't fit {bands} bands; give one each")
    return values


def _number(name: str, text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = np.nan
    if not -1e300 < value < 1e300:
        raise InputError(f"{name}: {text.strip()[:40]!r} in its header is not a number; correct it")
    return value


def _whole(fields: Mapping[str, str], name: str, most: int, default: str | None = None) -> int:
    text = fields.get(name, default)
    if text is None or not re.fullmatch(r"\d{1,13}", text) or int(text) > most:
        raise InputError(f"{name}: {text!r} is not a whole number of 0 to {most}; correct the header")
    return int(text)
