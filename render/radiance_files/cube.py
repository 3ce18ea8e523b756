"""Cubes of radiance or reflectance: NumPy's ``.npy``, ENVI, and plain ``.mat``, with a TOML beside them that says what
they hold.
"""

import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from render.radiance import SpectralRadiance
from render.radiance_files.envi import open_envi
from render.radiance_files.file_checks import bands_between, require_extent, require_file, require_reflectances
from render.radiance_files.mat_file import read_numbers
from rodcone.errors import InputError, in_place, read_errors, require_name, require_range
from rodcone.toml_file import read_toml, strict_converter, structured
from rodcone.types import Floats

KINDS = RADIANCE, REFLECTANCE = "radiance", "reflectance"
AXES = ("height", "width", "wavelength")


@dataclass(frozen=True)
class StoredArray:
    """Numbers as a file stores them, and facts that the file states about them.

    Attributes
    ----------
    values : array
    axes : tuple of str
        Names of the array's axes.
    wavelength_nm : (band,) float64 or None
    law : (gains, offsets) or None
        Gain and offset of each band, which convert stored numbers to values.
    good : (band,) bool or None
        Whether a band is usable.
    """

    values: NDArray[Any]
    axes: tuple[str, ...]
    wavelength_nm: Floats | None = None
    law: tuple[Floats, Floats] | None = None
    good: NDArray[np.bool_] | None = None


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
    """Return the path of the TOML beside a cube: ``desk.toml`` for ``desk.npy``."""
    return Path(path).with_suffix(".toml")


def cube_holds(path: str | Path) -> str:
    """Return what a cube holds, one of `KINDS`.

    Raises
    ------
    InputError
        For a missing or wrong description.
    """
    return _described(Path(path)).holds


def read_cube(path: str | Path) -> SpectralRadiance:
    """Read a cube of radiance or reflectance; reflectances are returned as the values of a `SpectralRadiance`.

    A TOML file of the same name lies beside it. Its keys are:

    - ``holds``: "radiance" [W m^-2 sr^-1 nm^-1] or "reflectance" [0 to 1];
    - ``wavelength_nm``: one number per band, or the first and the last of evenly spaced ones, or for a ``.mat`` the
      name of a variable. ENVI's header states wavelengths itself;
    - ``axes``: names of the array's axes in its order, by default ``height``, ``width``, ``wavelength``. A ``.mat``
      needs the key;
    - ``variable``: name of the cube in a ``.mat``;
    - ``scale``: value of a stored 1. It replaces ENVI's reflectance scale factor; after ENVI's gains and offsets it is
      the value of a 1 that these give.

    Bands are sorted by wavelength.

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
        nm = _wavelengths(stored, described, values.shape[2])
        used = np.argsort(nm, kind="stable")
        used = used if stored.good is None else used[stored.good[used]]
        centres, widths = bands_between(nm[used])
        gains, offsets = (np.ones(nm.size), np.zeros(nm.size)) if stored.law is None else stored.law
        scale = 1.0 if described.scale is None else described.scale
        scaled = np.empty((*values.shape[:2], used.size), dtype=np.float32)
        with np.errstate(all="ignore"):  # SpectralRadiance reports a value that isn't finite
            for place, band in enumerate(used):
                scaled[..., place] = (values[..., band] * gains[band] + offsets[band]) * scale
        cube = SpectralRadiance(scaled, centres, width_nm=widths)
        if described.holds == REFLECTANCE:
            require_reflectances(scaled)
    return cube


def _described(path: Path) -> Description:
    """Read the TOML beside a cube and check all that doesn't depend on the array."""
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


def _wavelengths(stored: StoredArray, described: Description, bands: int) -> Floats:
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


def _read_npy(path: Path, described: Description) -> StoredArray:
    # its header is parsed as Python's literals, which fail in many ways
    with read_errors("NumPy can't read it", "give an array saved by numpy.save", Exception):
        values = np.load(path, mmap_mode="r", allow_pickle=False)
    if not isinstance(values, np.ndarray):
        raise InputError("it is no array; give one saved by numpy.save")
    return StoredArray(values, described.axes or AXES)


def _open_envi(header: Path, described: Description) -> StoredArray:
    """Open ENVI's picture, with the gains and offsets that convert stored numbers to radiance or reflectance."""
    picture = open_envi(header)
    law = picture.radiance
    if described.holds == REFLECTANCE:
        if picture.factor is not None:
            bands = picture.good.size
            law = (np.full(bands, picture.factor), np.zeros(bands)) if described.scale is None else None
        else:
            law = picture.reflectance or picture.radiance
        stated = picture.factor is not None or picture.reflectance is not None
        if stated and picture.radiance is not None:
            warnings.warn("its data gain values, of radiance, are left aside: it holds reflectance", stacklevel=3)
    elif law is not None and described.scale is None:
        raise InputError(
            "data gain values: in which unit of radiance they are, its header doesn't say; ENVI's own is "
            "W m^-2 sr^-1 um^-1; give scale in the .toml: 0.001 for that, 1 for W m^-2 sr^-1 nm^-1"
        )
    elif law is None and (picture.factor or picture.reflectance) and described.scale is None:
        raise InputError(
            "its header states a scale or gains of reflectance, the .toml that it holds radiance; correct one, or give "
            "scale"
        )
    if picture.ignored is not None:
        count = int((picture.values == picture.ignored).sum())
        if count and picture.ignored != 0:
            raise InputError(f"data ignore value: {count} of its numbers are {picture.ignored:g}, no data; crop it")
        if count:
            warnings.warn(f"{count} of its numbers are 0, its data ignore value: they count as dark", stacklevel=3)
    if not picture.good.any():
        raise InputError("bbl: it marks every band as bad; allowed: two good bands or more; correct it")
    if not picture.good.all():
        warnings.warn(f"{int((~picture.good).sum())} bands that its bbl marks as bad are left out", stacklevel=3)
    return StoredArray(picture.values, picture.axes, picture.wavelength_nm, law, picture.good)


def _read_mat(path: Path, described: Description) -> StoredArray:
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
    return StoredArray(numbers[name], described.axes, numbers[nm] if isinstance(nm, str) else None)


_READERS = {".npy": _read_npy, ".hdr": _open_envi, ".mat": _read_mat}
EXTENSIONS = tuple(_READERS)
