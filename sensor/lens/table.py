"""A lens by data: its point spread by image height and wavelength, relative illumination, distortion, lateral colour.

A TOML file states the lens, and may name a CSV of its point spread beside it:

    f_number = 4.0
    field = [0.0, 0.25, 0.5, 0.75, 1.0]            # image heights, 0 in the middle and 1 in the picture's corners
    wavelength_nm = [450.0, 550.0, 650.0]
    relative_illumination = [1.0, 0.97, ...]       # one number for each field
    distortion = [0.0, -0.001, ...]                # image height over that without distortion, less 1
    lateral_um = [[0.0, 0.4, ...], [...], [...]]   # of each wavelength: how much farther out it lands [um]
    point_spread = "lens.csv"

The CSV has one row for each field and wavelength with the coefficients of the wave's path [nm] by Noll's numbers
(`sensor.lens.wavefront`), ``field,wavelength_nm,pupil_radial,pupil_across,Z4,Z5,...``; or one row for each point of
measured kernels, ``field,wavelength_nm,radial_um,across_um,energy``, which lie on one square grid.
"""

import csv
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from math import isfinite
from pathlib import Path
from typing import Any

import numpy as np
import scipy

from rodcone.digests import digest, digest_file
from rodcone.errors import InputError, in_place, read_errors, require_name, require_range
from rodcone.files import read_bounded
from rodcone.toml_file import read_toml, strict_converter, structured
from rodcone.types import Floats
from sensor.config import LensConfig, SensorConfig

SHIPPED = Path(__file__).parent / "data"
MOST_BYTES = 1 << 24  # 9 rings of 7 wavelengths with kernels of 64 x 64 points take 8 MB
MOST_NOLL = 66  # largest of Noll's numbers, up to the tenth order
BEYOND = 1.25  # largest image height from which distortion may bring light into the picture
PLACE = ("field", "wavelength_nm")
PUPIL = ("pupil_radial", "pupil_across")
POINTS = ("radial_um", "across_um", "energy")
_LEAST_STEP_UM, _MOST_POINTS = 1e-3, 257  # least step of a kernel, and most points along each of its sides
_FIX = "see the file of a shipped lens, such as sensor/lens/data/cooke_triplet.toml"


@dataclass(frozen=True)
class Wavefronts:
    """Wavefronts at the exit pupil, by field and wavelength.

    Attributes
    ----------
    noll : (term,) tuple of int
        Noll's numbers of the terms.
    path_nm : (field, wavelength, term) float64
        Coefficients of terms whose root mean square over the pupil is 1.
    pupil : (field, wavelength, 2) float64
        Half axes of the pupil along the radius and across it, over that of the f-number.
    """

    noll: tuple[int, ...]
    path_nm: Floats
    pupil: Floats


@dataclass(frozen=True)
class Kernels:
    """Point images, by field and wavelength.

    Attributes
    ----------
    energy : (field, wavelength, side, side) float64
        Each with the sum 1; rows lie along the radius, outwards, columns across it. The middle is the point's place.
    step_um : float
    """

    energy: Floats
    step_um: float


@dataclass(frozen=True, eq=False)
class LensTable:
    """A lens by data. Image heights are 0 in the middle of the picture and 1 in its corners.

    Attributes
    ----------
    f_number : float
    field : (field,) float64
        From 0 to 1, rising.
    wavelength_nm : (wavelength,) float64
        Rising wavelengths; outside their range the nearest one is used.
    relative_illumination, distortion : (field,) float64
    lateral_um : (wavelength, field) float64
        Distance by which a wavelength lands farther out than the undispersed image [um].
    point_spread : Wavefronts, Kernels or None
        None for a lens that spreads light as an ideal one.
    digest : str
        Hash of the files that it was read from.
    """

    f_number: float
    field: Floats
    wavelength_nm: Floats
    relative_illumination: Floats
    distortion: Floats
    lateral_um: Floats
    point_spread: Wavefronts | Kernels | None = None
    digest: str = ""

    def illumination(self, height: Floats) -> Floats:
        """Return the irradiance at image heights relative to that on the axis."""
        return np.asarray(self._curves[0](np.minimum(height, 1.0)))

    def darkens(self) -> bool:
        """Return whether the lens gives some image heights another illumination than the middle."""
        return bool((self.relative_illumination != 1).any())

    def landing(self, height: Floats, wavelength_nm: float, half_diagonal_um: float) -> Floats:
        """Return the image height at which light lands that an ideal lens would image at `height`."""
        lateral = self._lateral(wavelength_nm)
        beside = np.interp(height, self.field, lateral / half_diagonal_um)
        if lateral.any() and self.field.size > 1:
            beside = np.where(height > 1, lateral[-1] / half_diagonal_um, beside)
        return np.asarray(height * (1 + self._curves[1](height)) + beside)

    def _lateral(self, wavelength_nm: float) -> Floats:
        return np.array([np.interp(wavelength_nm, self.wavelength_nm, of_field) for of_field in self.lateral_um.T])

    @cached_property
    def _curves(self) -> tuple[Any, Any]:
        pchip = scipy.interpolate.PchipInterpolator
        return pchip(self.field, self.relative_illumination), pchip(self.field, self.distortion)

    def wavefront_nm(self, height: float, wavelength_nm: float) -> tuple[Floats, Floats]:
        """Return the Zernike coefficients [nm] and the pupil's half axes at an image height (wavefronts only)."""
        assert isinstance(self.point_spread, Wavefronts)
        both = np.concatenate([self.point_spread.path_nm, self.point_spread.pupil], axis=2)
        of_field = scipy.interpolate.PchipInterpolator(self.field, both)(min(height, 1.0))
        share = np.interp(wavelength_nm, self.wavelength_nm, np.arange(self.wavelength_nm.size))
        low = min(int(share), self.wavelength_nm.size - 1)
        high = min(low + 1, self.wavelength_nm.size - 1)
        values = of_field[low] + (share - low) * (of_field[high] - of_field[low])
        return values[:-2], values[-2:]

    def kernel(self, height: float, wavelength_nm: float) -> Floats:
        """Return the point image at an image height, for a lens with kernels."""
        assert isinstance(self.point_spread, Kernels)
        total = np.zeros(self.point_spread.energy.shape[2:])
        for at, of_field in _between(self.field, height):
            for nm, of_nm in _between(self.wavelength_nm, wavelength_nm):
                total += of_field * of_nm * self.point_spread.energy[at, nm]
        return total


def _between(nodes: Floats, value: float) -> list[tuple[int, float]]:
    """Return the nodes on either side of a value, each with its share in linear interpolation."""
    share = float(np.interp(value, nodes, np.arange(nodes.size)))
    low = min(int(share), nodes.size - 1)
    return [(low, 1 - share + low), (min(low + 1, nodes.size - 1), share - low)]


@dataclass(frozen=True)
class _File:
    """Keys of a lens's file."""

    f_number: float
    field: tuple[float, ...]
    wavelength_nm: tuple[float, ...] = (550.0,)
    relative_illumination: tuple[float, ...] = ()
    distortion: tuple[float, ...] = ()
    lateral_um: tuple[tuple[float, ...], ...] = ()
    point_spread: str = ""
    title: str = ""
    source: str = ""


_CONVERTER = strict_converter()


def shipped() -> tuple[str, ...]:
    """Return the names of the lenses that come with rodcone."""
    return tuple(sorted(path.stem for path in SHIPPED.glob("*.toml")))


def lens_file(lens: str) -> Path:
    """Return the path of a lens's file: of a shipped one by its name, of any other by the path that ends in ``.toml``.

    Raises
    ------
    InputError
        For a name that no shipped lens has.
    """
    if lens.endswith(".toml"):
        return Path(lens)
    require_name("lens", lens, shipped())
    return SHIPPED / f"{lens}.toml"


def with_lens(sensor: SensorConfig, table: str) -> SensorConfig:
    """Return the camera with a lens from measured or designed data (`LensConfig.table`), at the f-number of its table.

    Raises
    ------
    InputError
        As `read_lens`.
    """
    return replace(sensor, lens=replace(sensor.lens, **terms_of(table)))


def terms_of(table: str) -> dict[str, Any]:
    """Return the fields of `LensConfig` that a tabulated lens sets: its name, its f-number, and the hash of its files.

    A shipped lens has no hash: its content belongs to the version of rodcone.

    Raises
    ------
    InputError
        As `read_lens`.
    """
    read = read_lens(table)
    digest_of_own = read.digest if table.endswith(".toml") else ""
    return {"table": table, "table_digest": digest_of_own, "f_number": read.f_number}


def lens_table(lens: LensConfig) -> LensTable:
    """Read the table of a lens by data, and check that the rest of the lens goes with it.

    Raises
    ------
    InputError
        As `read_lens`, and for another f-number than the table's, defocus, or files that have changed since the lens
        was made.
    """
    table = read_lens(lens.table)
    if lens.table_digest and lens.table_digest != table.digest:
        raise InputError(
            f"lens file {lens.table!r}: it, or its point spread, has changed since the camera was made; allowed: one "
            "content for all of a camera's pictures; make the camera anew"
        )
    if lens.f_number != table.f_number:
        raise InputError(
            f"f_number: {lens.f_number:g} with the lens {lens.table!r}; allowed: {table.f_number:g}, where its table "
            "holds; give that, or another lens"
        )
    if lens.defocus_um:
        raise InputError(
            f"defocus_um: {lens.defocus_um:g} with the lens {lens.table!r}; allowed: 0; put it in its table, as Z4"
        )
    return table


def read_lens(lens: str) -> LensTable:
    """Read a lens by data.

    Parameters
    ----------
    lens : str
        Name of a shipped lens, or a TOML file.

    Raises
    ------
    InputError
        For a file that can't be read, or values that no lens has: negative energy, gaps, nodes that don't rise.
    """
    path = lens_file(lens)
    given = _given(path, _stamp(path))
    spread = None
    if given.point_spread:
        spread = path.parent / given.point_spread
        with in_place(f"lens file {str(path)!r}"):
            return _read(path, given, spread, _stamp(spread, "point_spread", "give a CSV beside the lens's file"))
    return _read(path, given, None, None)


def _stamp(path: Path, what: str = "lens file", fix: str = _FIX) -> tuple[int, int]:
    """Return when a file was changed, and its size."""
    with read_errors(f"{what}: {str(path)!r} can't be read", fix):
        status = path.stat()
    return status.st_mtime_ns, status.st_size


@lru_cache(maxsize=16)
def _given(path: Path, _of_file: tuple[int, int]) -> _File:
    with read_errors(f"lens file: {str(path)!r} can't be read", _FIX):
        content = read_toml(path)
    with in_place(f"lens file {str(path)!r}"):
        return structured(content, _File, _CONVERTER, _FIX)


@lru_cache(maxsize=16)
def _read(path: Path, given: _File, spread: Path | None, _of_spread: tuple[int, int] | None) -> LensTable:
    with in_place(f"lens file {str(path)!r}"):
        table = _table(given, path.parent)
    return replace(table, digest=digest([digest_file(file) for file in (path, spread) if file]))


def _table(given: _File, folder: Path) -> LensTable:
    """Check a file's numbers, and read its point spread."""
    # Nodes.
    require_range("f_number", given.f_number, 0.1, 1e4, "give focal length over aperture")
    field, nm = _rising("field", given.field), _rising("wavelength_nm", given.wavelength_nm)
    if field.size < 2 or field[0] != 0 or field[-1] != 1:
        raise InputError(f"field: {list(given.field)}; allowed: from 0 (the middle) to 1 (the corners); give both ends")
    if not 100 <= nm[0] <= nm[-1] <= 20_000:
        raise InputError(f"wavelength_nm: {list(given.wavelength_nm)}; allowed: 100 to 20000 nm; give nanometres")

    # Curves.
    light = _of_fields("relative_illumination", given.relative_illumination, field, 1.0, 1e-3, 10.0)
    if light[0] != 1:
        raise InputError(f"relative_illumination: {light[0]:g} in the middle; allowed: 1; divide all by it")
    distortion = _of_fields("distortion", given.distortion, field, 0.0, -0.9, 10.0)
    lateral = np.zeros((nm.size, field.size))
    if given.lateral_um:
        if len(given.lateral_um) != nm.size:
            raise InputError(
                f"lateral_um: {len(given.lateral_um)} rows for {nm.size} wavelengths; allowed: a row for each; fill it"
            )
        rows = [_of_fields("lateral_um", row, field, 0.0, -1e4, 1e4) for row in given.lateral_um]
        lateral = np.array(rows)

    # Point spread.
    spread = _point_spread(folder / given.point_spread, field, nm) if given.point_spread else None
    table = LensTable(float(given.f_number), field, nm, light, distortion, lateral, spread)
    heights = np.linspace(0, 1, 1001)
    if np.any(np.diff(heights * (1 + table._curves[1](heights))) <= 0):
        raise InputError(
            f"distortion: {distortion.tolist()} folds the picture; allowed: field x (1 + distortion) rises; "
            "give shares, not per cent"
        )
    return table


def _rising(name: str, values: Sequence[float]) -> Floats:
    """Check that numbers rise, and return them as an array."""
    found = np.array(values, dtype=np.float64)
    if not found.size or not np.isfinite(found).all() or np.any(np.diff(found) <= 0):
        raise InputError(f"{name}: {list(values)} doesn't rise; allowed: numbers, each above the last; sort them")
    return found


def _of_fields(name: str, values: Sequence[float], field: Floats, default: float, low: float, high: float) -> Floats:
    """Check that there is one number from low to high for each field; fill in the default where none is given."""
    if not values:
        return np.full(field.size, default)
    if len(values) != field.size:
        raise InputError(f"{name}: {len(values)} numbers for {field.size} fields; allowed: one each; fill the gaps")
    for value in values:
        require_range(name, value, low, high, "give one number for each field")
    return np.array(values, dtype=np.float64)


def _point_spread(path: Path, field: Floats, nm: Floats) -> Wavefronts | Kernels:
    with read_errors(f"point_spread: {str(path)!r} can't be read", "give a CSV beside the lens's file"):
        rows = [row for row in csv.reader(read_bounded(path, MOST_BYTES).decode().splitlines()) if row]
    with in_place(f"point_spread {path.name!r}"):
        head, numbers = _numbers(rows)
        if tuple(head) == PLACE + POINTS:
            return _kernels(numbers, field, nm)
        start = len(PLACE) + len(PUPIL) * (tuple(head[2:4]) == PUPIL)
        if tuple(head[:2]) != PLACE or not all(re.fullmatch(r"Z[1-9]\d?", name) for name in head[start:]):
            raise InputError(
                f"columns: {', '.join(head)[:200]}; allowed: {', '.join(PLACE + POINTS)}, or {', '.join(PLACE + PUPIL)}"
                " and Noll's terms, Z4, Z5, ...; rename them"
            )
        return _wavefronts(tuple(int(name[1:]) for name in head[start:]), numbers, start, field, nm)


def _numbers(rows: list[list[str]]) -> tuple[list[str], Floats]:
    """Return the header and the numbers of a CSV's rows."""
    if len(rows) < 2:
        raise InputError("rows: none; allowed: a header and one row or more; fill it")
    head = [name.strip() for name in rows[0]]
    for number, row in enumerate(rows[1:], 2):
        try:
            whole = len(row) == len(head) and all(isfinite(float(cell)) for cell in row)
        except ValueError:
            whole = False
        if not whole:
            raise InputError(
                f"row {number}: {','.join(row)[:80]!r}; allowed: {len(head)} finite numbers, as the header has; mend it"
            )
    return head, np.array(rows[1:], dtype=np.float64)


def _places(numbers: Floats, field: Floats, nm: Floats) -> tuple[Any, Any]:
    """Return the indices of each row's field and wavelength; raise `InputError` if a combination is missing."""
    indices = []
    for name, nodes, values in zip(PLACE, (field, nm), numbers.T, strict=False):
        index = np.abs(values[:, None] - nodes).argmin(axis=1)
        off = np.abs(nodes[index] - values) > 1e-6 * np.maximum(np.abs(nodes[index]), 1)
        if off.any():
            raise InputError(
                f"{name}: {values[off][0]:g} is none of the lens's; allowed: {', '.join(f'{x:g}' for x in nodes)}; "
                "state the same in both files"
            )
        indices.append(index)
    seen = np.zeros((field.size, nm.size), dtype=bool)
    seen[indices[0], indices[1]] = True
    if not seen.all():
        at, of_nm = np.argwhere(~seen)[0]
        raise InputError(
            f"rows: none at field {field[at]:g}, {nm[of_nm]:g} nm; allowed: each field at each wavelength; fill the gap"
        )
    return indices[0], indices[1]


def _wavefronts(noll: tuple[int, ...], numbers: Floats, start: int, field: Floats, nm: Floats) -> Wavefronts:
    if len(set(noll)) != len(noll) or not noll or max(noll) > MOST_NOLL:
        raise InputError(
            f"columns: {', '.join(f'Z{j}' for j in noll) or 'no terms'}; allowed: Z1 to Z{MOST_NOLL}, each once; "
            "name one column a term"
        )
    at = _places(numbers, field, nm)
    if len(numbers) != field.size * nm.size:
        raise InputError(
            f"rows: {len(numbers)} for {field.size} fields and {nm.size} wavelengths; allowed: one each; leave some out"
        )
    pupil = np.ones((field.size, nm.size, 2))
    if start > len(PLACE):
        pupil[at] = numbers[:, 2:4]
        if pupil.min() < 0.05 or pupil.max() > 2:
            raise InputError(
                f"pupil: half axes from {pupil.min():g} to {pupil.max():g}; allowed: 0.05 to 2; give them over the "
                "f-number's"
            )
    path_nm = np.empty((field.size, nm.size, len(noll)))
    path_nm[at] = numbers[:, start:]
    return Wavefronts(noll, path_nm, pupil)


def _kernels(numbers: Floats, field: Floats, nm: Floats) -> Kernels:
    # The grid.
    places, (radial_um, across_um, energy) = _places(numbers, field, nm), numbers[:, 2:].T
    if energy.min() < 0:
        raise InputError(f"energy: {energy.min():g}; allowed: 0 or more; clip the kernels")
    apart = [np.diff(np.unique(np.round(values, 9))) for values in (radial_um, across_um)]
    step_um = float(min((values.min() for values in apart if values.size), default=1.0))
    reach = max(np.abs(radial_um).max(), np.abs(across_um).max()) / step_um
    if step_um < _LEAST_STEP_UM or 2 * round(reach) + 1 > _MOST_POINTS:
        raise InputError(
            f"kernels: points {step_um:g} um apart, out to {reach * step_um:g} um; allowed: {_MOST_POINTS} a side; "
            "give a coarser grid"
        )
    middle = round(reach)
    row, column = (np.rint(values / step_um).astype(int) for values in (radial_um, across_um))
    for name, index, values in (("radial_um", row, radial_um), ("across_um", column, across_um)):
        off = np.abs(index * step_um - values) > 1e-3 * step_um
        if off.any():
            raise InputError(
                f"{name}: {values[off][0]:g} is off the grid; allowed: whole multiples of {step_um:g} um; resample it"
            )

    # The kernels.
    kernels = np.zeros((field.size, nm.size, 2 * middle + 1, 2 * middle + 1))
    at = (*places, row + middle, column + middle)
    if len(np.unique(np.array(at), axis=1).T) != len(numbers):
        raise InputError("rows: a point stands twice; allowed: each once; leave one out")
    kernels[at] = energy
    sums = kernels.sum(axis=(2, 3))
    if np.any(np.abs(sums - 1) > 1e-3):
        raise InputError(
            f"energy: sums from {sums.min():g} to {sums.max():g}; allowed: 1 within 1e-3, for each kernel; "
            "divide each kernel by its sum"
        )
    return Kernels(kernels / sums[..., None, None], step_um)
