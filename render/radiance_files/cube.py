"""Cubes of radiance or reflectance: NumPy's ``.npy``, ENVI, and plain ``.mat``, with a TOML beside them that says what
they hold.

ENVI's pictures are a text header, ``.hdr``, and the numbers as they are in a file beside it; fields are named as in
"ENVI Header Files" (NV5 Geospatial's documentation).
"""

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from render.radiance import SpectralRadiance
from render.radiance_files.file_checks import bands_between, require_extent, require_file
from render.radiance_files.mat_file import read_numbers
from rodcone.errors import InputError, in_place, read_errors, require_name, require_range
from rodcone.toml_file import read_toml, strict_converter, structured
from rodcone.types import Floats

_MOST_HEADER_BYTES = 1 << 20  # of ENVI; one of 500 bands with their names takes 20 kB
_TYPES = {1: "u1", 2: "i2", 3: "i4", 4: "f4", 5: "f8", 12: "u2", 13: "u4", 14: "i8", 15: "u8"}
_SIDES = {"height": "lines", "width": "samples", "wavelength": "bands"}
_ORDER = {
    "bsq": ("wavelength", "height", "width"),
    "bil": ("height", "wavelength", "width"),
    "bip": ("height", "width", "wavelength"),
}
_ENDINGS = ("", ".raw", ".img", ".dat", ".bin", ".bsq", ".bil", ".bip")
_FIELD = re.compile(r"^\s*([^=;\n]+?)\s*=\s*(\{[^}]*\}|[^\n]*)", re.MULTILINE)
_UNITS = {"nanometers": 1.0, "micrometers": 1000.0, "unknown": 1.0}
KINDS = RADIANCE, REFLECTANCE = "radiance", "reflectance"
AXES = ("height", "width", "wavelength")
MOST_OVER_ONE = 0.01  # of a reflectance's values: highlights and noise; more is another unit


@dataclass(frozen=True)
class Stored:
    """Numbers of a file as they stand in it: their axes, and wavelengths and scale where the file states them."""

    values: NDArray[Any]
    axes: tuple[str, ...]
    wavelength_nm: Floats | None = None
    scale: float = 1.0


@dataclass(frozen=True)
class Description:
    """Keys of the TOML beside a cube; see `read_cube`."""

    holds: str
    wavelength_nm: Any = None
    axes: tuple[str, ...] = ()
    variable: str | None = None
    scale: float | None = None

    def __post_init__(self) -> None:
        require_name("holds", self.holds, KINDS)
        if self.scale is not None:
            require_range("scale", self.scale, 1e-30, 1e30, "give what a stored 1 is worth")


_CONVERTER = strict_converter()


def description(path: str | Path) -> Path:
    """Name of the TOML beside a cube: ``desk.toml`` of ``desk.npy``."""
    return Path(path).with_suffix(".toml")


def cube_holds(path: str | Path) -> str:
    """What a cube holds, one of `KINDS`.

    Raises
    ------
    InputError
        For a missing or wrong description.
    """
    return _described(Path(path)).holds


def read_cube(path: str | Path) -> SpectralRadiance:
    """Read a cube; a reflectance stands in the place of the radiance.

    Beside it lies a TOML of the same name with ``holds`` ("radiance" [W m^-2 sr^-1 nm^-1] or "reflectance" [0 to 1]);
    ``wavelength_nm``, one number a band or the first and the last of evenly spaced ones, or in a ``.mat`` the name of a
    variable (ENVI's header states them); ``axes``, in the order of the array, ``height``, ``width`` and ``wavelength``
    by default, which a ``.mat`` has to name; ``variable`` of a ``.mat``; ``scale``, what a stored 1 is worth.

    Raises
    ------
    InputError
        For a file or description that can't be read or don't agree, values that are negative or not finite, or
        reflectances of which over 1 % exceed 1.
    """
    path = Path(path)
    described = _described(path)
    with in_place(str(path)):
        stored = _READERS[path.suffix.lower()](path, described)
        if sorted(stored.axes) != sorted(AXES):
            raise InputError(f"axes: {list(stored.axes)!r} are not allowed; give {list(AXES)} in the array's own order")
        if stored.values.ndim != 3 or stored.values.dtype.kind not in "fiu":
            raise InputError(
                f"an array of {stored.values.ndim} axes of {stored.values.dtype}; allowed: 3 axes of real numbers; "
                "save one cube"
            )
        values = np.moveaxis(stored.values, [stored.axes.index(name) for name in AXES], (0, 1, 2))
        require_extent(*values.shape)
        centres, widths = bands_between(_wavelengths(stored, described, values.shape[2]))
        with np.errstate(all="ignore"):  # SpectralRadiance tells where a value isn't finite
            scaled = np.asarray(values, dtype=np.float32) * np.float32(described.scale or stored.scale)
        cube = SpectralRadiance(scaled, centres, width_nm=widths)
        over = float((scaled > 1).mean())
        if described.holds == REFLECTANCE and over > MOST_OVER_ONE:
            raise InputError(
                f"{over:.0%} of its reflectances exceed 1; allowed: {MOST_OVER_ONE:.0%}, of highlights; give scale, "
                "such as 0.01 for per cent"
            )
    return cube


def _described(path: Path) -> Description:
    """Content of the TOML beside a cube, checked but for what depends on the array."""
    require_file(path)
    beside = description(path)
    if not beside.is_file():
        raise InputError(
            f'{path}: nothing says what it holds; allowed: {beside.name} beside it; write there holds = "reflectance" '
            '(or "radiance"), and wavelength_nm = [400, 700], the first and the last band'
        )
    fix = "give holds and wavelength_nm"
    with in_place(str(beside)), read_errors("can't be read", fix):
        return structured(read_toml(beside), Description, _CONVERTER, fix)


def _wavelengths(stored: Stored, described: Description, bands: int) -> Floats:
    given = stored.wavelength_nm if described.wavelength_nm is None else described.wavelength_nm
    if given is None:
        raise InputError("wavelength_nm: nothing states it; give one number a band, or the first and the last")
    try:
        nm = np.array(stored.wavelength_nm if isinstance(given, str) else given, dtype=np.float64).ravel()
    except (TypeError, ValueError, OverflowError):
        nm = np.empty(0)
    if isinstance(given, list) and nm.size == 2 < bands and 0 < nm[0] < nm[1] < np.inf:
        nm = np.linspace(nm[0], nm[1], bands)
    if nm.size != bands:
        raise InputError(
            f"wavelength_nm: {nm.size} numbers don't fit {bands} bands; give one each, or the first and the last; axes "
            "says which axis they are"
        )
    return nm


def _read_npy(path: Path, described: Description) -> Stored:
    # its header is parsed as Python's literals, which fail in many ways
    with read_errors("NumPy can't read it", "give an array saved by numpy.save", Exception):
        values = np.load(path, mmap_mode="r", allow_pickle=False)
    if not isinstance(values, np.ndarray):
        raise InputError("it is no array; give one saved by numpy.save")
    return Stored(values, described.axes or AXES)


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


def _open_envi(header: Path, _: Description) -> Stored:
    """Open ENVI's picture; its numbers stay in their file until they are read.

    Raises
    ------
    InputError
        For a header that isn't ENVI's, lacks a number or is compressed, or a data file of another size.
    """
    if require_file(header) > _MOST_HEADER_BYTES:
        raise InputError(f"its header is over {_MOST_HEADER_BYTES} bytes; give the .hdr of an ENVI picture")
    text = header.read_text("utf-8", errors="replace")
    if not text.startswith("ENVI"):
        raise InputError("it doesn't begin with ENVI; give the .hdr of an ENVI picture")
    fields = {" ".join(key.lower().split()): value.strip() for key, value in _FIELD.findall(text)}
    size = {axis: _whole(fields, name, 1 << 20) for axis, name in _SIDES.items()}
    require_extent(*size.values())
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
    shape = tuple(size[axis] for axis in _ORDER[order])
    needed = offset + dtype.itemsize * int(np.prod(shape, dtype=np.int64))
    if require_file(numbers) < needed:
        raise InputError(
            f"{numbers.name} has {numbers.stat().st_size} bytes, its header stands for {needed}; copy it whole"
        )
    values = np.memmap(numbers, dtype, "r", offset, shape)
    scale = 1.0 / _number(fields.get("reflectance scale factor", "1"))
    return Stored(values, _ORDER[order], _envi_wavelengths(fields), scale)


def _envi_wavelengths(fields: dict[str, str]) -> Floats | None:
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


def _read_mat(path: Path, described: Description) -> Stored:
    name, nm = described.variable, described.wavelength_nm
    if name is None or not described.axes:
        raise InputError(
            "variable and axes are missing; a .mat doesn't tell which of its arrays is the cube; give "
            f'variable = "NAME" and axes = {list(AXES)} in the array\'s own order'
        )
    numbers = read_numbers(path, [name, *([nm] if isinstance(nm, str) else [])])
    for key in (name, nm):
        if isinstance(key, str) and key not in numbers:
            raise InputError(f"it has no numbers {key!r}; give the name of a variable of the file")
    return Stored(numbers[name], described.axes, numbers[nm] if isinstance(nm, str) else None)


_READERS = {".npy": _read_npy, ".hdr": _open_envi, ".mat": _read_mat}
EXTENSIONS = tuple(_READERS)
