"""Spectra as piecewise linear functions and their averages over bands; published tables; photons, luminance and colour.

The published tables are colour-science's, to the last digit, in a file of this package: importing that library takes
1 to 2 s. ``python tests/render/test_illuminants.py`` writes the file. Tables of refractive indices are Mitsuba's own.
"""

import json
import re
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cache, lru_cache
from importlib import metadata
from pathlib import Path
from types import EllipsisType

import numpy as np
from numpy.typing import ArrayLike, NDArray

from render.band_weights import band_weights
from rodcone.digests import ByBits, by_bits
from rodcone.display import Axes, brief, draw_curves, png_of
from rodcone.doors import method
from rodcone.errors import InputError
from rodcone.types import Floats as Floats  # noqa: PLC0414  (other packages import it from here)
from rodcone.types import real_array

VISIBLE_NM = (380.0, 780.0)
SHORTEST_NM, LONGEST_NM = 100.0, 20_000.0  # range of numbers that may be wavelengths in nm: far ultraviolet to heat
MOST_OVERLAP = 0.01  # share of the narrower of two bands that may overlap by rounding of stated edges
LINE_BASE_NM = 0.1  # width of a line at its base, far below that of any band, so that a line's shape doesn't matter
LINE_REACH_NM = 0.5  # distance from a line to its band's edges: enough for a lamp's line width and its tabulation
LEAST_LINE = 1e-3  # least share of a light's power in a line; smaller peaks are noise of a finely measured curve
OBSERVER_NM: Floats = np.arange(360.0, 831.0)  # corners of the CIE 1931 observer
DEFAULT_WAVELENGTH_NM: Floats = np.arange(385.0, 780.0, 10.0)  # centres of 40 bands that fill 380-780 nm
# Default width of a render's bands: electrons of charts err by 0.05 % under smooth light, by 0.3 to 1.6 % under lines.
RENDER_BAND_NM = 20.0
BLOCK = 1 << 16  # pixels whose bands are summed in double precision at once


@dataclass(frozen=True)
class Spectrum:
    """A function of wavelength, linear between its points and zero outside them.

    Attributes
    ----------
    wavelength_nm : (n,) float64
        Strictly increasing.
    values : (n,) float64
        Finite and not negative; the unit is the owner's (reflectance, W m^-2 sr^-1 nm^-1, ...).

    Raises
    ------
    InputError
        If the points are not as above, or not within 100 to 20 000 nm.

    Examples
    --------
    >>> import rodcone
    >>> ramp = rodcone.Spectrum([400.0, 700.0], [0.0, 1.0])
    >>> ramp.band_average([550.0], [100.0])
    array([0.5])
    """

    wavelength_nm: Floats
    values: Floats

    __repr__ = brief

    def __post_init__(self) -> None:
        nm = np.array(real_array("wavelength_nm", self.wavelength_nm), dtype=np.float64)
        values = np.array(real_array("spectrum values", self.values), dtype=np.float64)
        if nm.ndim != 1 or nm.size < 2 or not np.all(np.isfinite(nm)) or not np.all(np.diff(nm) > 0):
            raise InputError(
                f"wavelength_nm: {nm.tolist()!r} is not allowed; give two or more strictly increasing [nm]"
            )
        _require_nm(float(nm[0]), float(nm[-1]))
        if values.shape != nm.shape or not np.all(np.isfinite(values) & (values >= 0)):
            raise InputError(
                f"spectrum values: allowed are {nm.size} finite numbers >= 0, one a wavelength; correct them"
            )
        object.__setattr__(self, "wavelength_nm", nm)
        object.__setattr__(self, "values", values)

    @method
    def plot(self, axes: Axes | None = None) -> Axes:
        """Draw the curve into Matplotlib's axes, new ones by default."""
        return draw_curves({"": (self.wavelength_nm, self.values)}, axes, x="wavelength, nm", y="value")

    def _repr_png_(self) -> bytes:
        return png_of(self.plot)

    def __mul__(self, factor: float) -> "Spectrum":
        """Return the spectrum times a number."""
        return Spectrum(self.wavelength_nm, self.values * factor)

    @method
    def band_average(self, wavelength_nm: ArrayLike, width_nm: ArrayLike) -> Floats:
        """Average over each band ``wavelength_nm +- width_nm / 2``, shape (band,); exact for the linear pieces."""
        centre = np.asarray(wavelength_nm, dtype=np.float64)
        half = np.asarray(width_nm, dtype=np.float64) / 2
        return (self._integral_to(centre + half) - self._integral_to(centre - half)) / (2 * half)

    def _integral_to(self, nm: Floats) -> Floats:
        """Integrate from the first point to `nm`."""
        at = np.clip(nm, self.wavelength_nm[0], self.wavelength_nm[-1])
        steps = np.diff(self.wavelength_nm) * (self.values[1:] + self.values[:-1]) / 2
        before = np.concatenate([[0.0], np.cumsum(steps)])
        left = np.clip(np.searchsorted(self.wavelength_nm, at, side="right") - 1, 0, steps.size - 1)
        height = (np.interp(at, self.wavelength_nm, self.values) + self.values[left]) / 2
        return np.asarray(before[left] + height * (at - self.wavelength_nm[left]))


def flat(value: float = 1.0) -> Spectrum:
    """Return a spectrum with one value over 300-1100 nm, which covers all bands that the project uses."""
    return Spectrum(np.array([300.0, 1100.0]), np.array([value, value]))


def line_spectrum(lines_nm: ArrayLike, powers: ArrayLike) -> Spectrum:
    """Make a spectrum of emission lines, each a triangle 0.1 nm wide at the base; `powers` are their integrals.

    Raises
    ------
    InputError
        If lines aren't increasing, or are less than 0.1 nm apart.
    """
    lines = np.atleast_1d(lines_nm).astype(np.float64)
    heights = np.atleast_1d(powers) * (2 / LINE_BASE_NM)
    if lines.shape != heights.shape or np.any(np.diff(lines) <= LINE_BASE_NM):
        raise InputError(f"lines_nm: {lines.tolist()!r} is not allowed; give increasing lines over 0.1 nm apart")
    nm = (lines[:, None] + np.array([-0.5, 0.0, 0.5]) * LINE_BASE_NM).ravel()
    return Spectrum(nm, (heights[:, None] * np.array([0.0, 1.0, 0.0])).ravel())


def even_bands(range_nm: tuple[float, float], count: int) -> tuple[Floats, Floats]:
    """Divide a range into bands of one width; return their centres and widths, shape (band,) each."""
    edges = np.linspace(*range_nm, count + 1)
    return (edges[1:] + edges[:-1]) / 2, np.diff(edges)


def line_bands(
    lines_nm: ArrayLike, range_nm: tuple[float, float] = VISIBLE_NM, width_nm: float = 10.0
) -> tuple[Floats, Floats]:
    """Divide a range into bands so that each line has a narrow one; return centres and widths, shape (band,) each.

    A line's band reaches 0.5 nm to either side; lines less than 1 nm apart share one. All other bands are `width_nm`
    wide, or end where a line's band begins. A piece of less than 1 nm that is left over joins its neighbour.

    Raises
    ------
    InputError
        For a line outside the range.

    Examples
    --------
    >>> import rodcone
    >>> centre_nm, width_nm = rodcone.line_bands([589.3], (400.0, 700.0), 100.0)
    >>> round(float(width_nm.sum()))
    300
    """
    low, high = range_nm
    lines = np.sort(np.atleast_1d(np.asarray(lines_nm, dtype=np.float64)))
    if np.any(lines < low + LINE_REACH_NM) or np.any(lines > high - LINE_REACH_NM):
        raise InputError(f"lines_nm: {lines.tolist()!r} is not inside {low:g} to {high:g}; widen range_nm")
    groups = np.split(lines, np.flatnonzero(np.diff(lines) >= 2 * LINE_REACH_NM) + 1) if lines.size else []
    cuts = np.array([edge for group in groups for edge in (group[0] - LINE_REACH_NM, group[-1] + LINE_REACH_NM)])
    even = np.append(low + width_nm * np.arange(np.floor((high - low) / width_nm + 1e-9) + 1), high)
    near = np.abs(cuts[:, None] - even).min(axis=0, initial=np.inf) < 2 * LINE_REACH_NM
    within = np.searchsorted(cuts, even) % 2 == 1
    edges = np.unique([low, high, *cuts, *even[~near & ~within]])
    return (edges[1:] + edges[:-1]) / 2, np.diff(edges)


def emission_lines_nm(spectrum: Spectrum) -> Floats:
    """Find a spectrum's emission lines [nm]: peaks at most 0.2 nm wide, over twice as high as their neighbours."""
    nm, values = spectrum.wavelength_nm, spectrum.values
    beside = np.maximum(values[:-2], values[2:])
    power = values[1:-1] * (nm[2:] - nm[:-2]) / 2
    narrow = np.maximum(nm[2:] - nm[1:-1], nm[1:-1] - nm[:-2]) <= LINE_BASE_NM
    return nm[1:-1][narrow & (values[1:-1] > 2 * beside) & (power > LEAST_LINE * np.trapezoid(values, nm))]


def fine_bands(
    spectra: Iterable[Spectrum], range_nm: tuple[float, float] = VISIBLE_NM, width_nm: float = 10.0
) -> tuple[Floats, Floats]:
    """Divide a range into even bands, and a narrow one for each emission line of any light: centres and widths."""
    lines = np.unique(np.concatenate([np.zeros(0), *map(emission_lines_nm, spectra)]))
    within = lines[(lines > range_nm[0] + 1) & (lines < range_nm[1] - 1)]
    even = even_bands(range_nm, max(1, round((range_nm[1] - range_nm[0]) / width_nm)))
    return line_bands(within, range_nm, width_nm) if within.size else even


def band_widths(wavelength_nm: ArrayLike, width_nm: ArrayLike | None = None) -> Floats:
    """Return the width of each band [nm]: as given, or the spacing of evenly spaced centres.

    Raises
    ------
    InputError
        If centres don't increase, widths aren't positive, or the spacing is uneven and no widths are given; if bands
        reach beyond 100 to 20 000 nm, or overlap by more than 1 % of a width.
    """
    nm = real_array("wavelength_nm", wavelength_nm).astype(np.float64)
    if nm.ndim != 1 or nm.size == 0 or not np.all(np.isfinite(nm)) or np.any(np.diff(nm) <= 0) or nm[0] <= 0:
        raise InputError(f"wavelength_nm: {nm.tolist()!r} is not allowed; give increasing band centres in nm")
    if width_nm is not None:
        widths = real_array("width_nm", width_nm)
        if widths.shape not in ((), nm.shape):
            raise InputError(f"width_nm: {widths.shape} widths for {nm.size} bands; give one each, or one for all")
        widths = np.broadcast_to(widths.astype(np.float64), nm.shape).copy()
        if not np.all(np.isfinite(widths) & (widths > 0)):
            raise InputError(f"width_nm: {widths.tolist()!r} is not allowed; give positive band widths in nm")
    else:
        steps = np.diff(nm)
        if nm.size == 1 or not np.allclose(steps, steps[0], rtol=1e-6):
            raise InputError(
                f"wavelength_nm: {nm.size} bands without even spacing have no width; give width_nm as well"
            )
        widths = np.full(nm.shape, steps.mean())
    first, last = nm - widths / 2, nm + widths / 2
    _require_nm(float(first.min()), float(last.max()))
    twice = np.flatnonzero(last[:-1] - first[1:] > MOST_OVERLAP * np.minimum(widths[:-1], widths[1:]))
    if twice.size:
        i = int(twice[0])
        raise InputError(
            f"width_nm: bands {i} and {i + 1}, {first[i]:g} to {last[i]:g} nm and {first[i + 1]:g} to "
            f"{last[i + 1]:g} nm, overlap, and the light of both would count twice; give widths that don't"
        )
    return widths


def _require_nm(shortest: float, longest: float) -> None:
    """Raise `InputError` for wavelengths that can't be nanometres, and name the unit that they seem to have."""
    if shortest >= SHORTEST_NM and longest <= LONGEST_NM:
        return
    fix = "give nanometres"
    for unit, factor in (("metres", 1e9), ("micrometres", 1e3)):
        if shortest * factor >= SHORTEST_NM and longest * factor <= LONGEST_NM:
            fix = f"they seem to be {unit}: multiply them by {factor:g}"
            break
    raise InputError(
        f"wavelength_nm: {shortest:g} to {longest:g} is outside {SHORTEST_NM:g} to {LONGEST_NM:g} nm; {fix}"
    )


def black_body(temperature_k: float) -> Spectrum:
    """Compute Planck's law over 300-1100 nm, relative to its value at 560 nm."""
    second_radiation_constant_nm_k = 1.438776877e7  # CODATA 2018, exact SI: h c / k
    nm = np.arange(300.0, 1101.0, 5.0)
    exponent = second_radiation_constant_nm_k / temperature_k
    return Spectrum(nm, (560.0 / nm) ** 5 * np.expm1(exponent / 560.0) / np.expm1(exponent / nm))


PUBLISHED = Path(__file__).parent / "data" / "published_spectra.json"


@cache
def published_spectra(collection: str) -> dict[str, tuple[Floats, Floats]]:
    """Read the wavelengths [nm] and values of each table of a collection, in its published order.

    Parameters
    ----------
    collection : str
        ``observer`` (CIE 1931, 2 degrees; CIE 018:2019), ``illuminants`` and ``daylight`` (CIE 015:2018), ``sun`` (ASTM
        G173-03, direct and circumsolar, in 1 nm means), ``color_checker`` (Ohta 1997) or ``nikon_d5100`` (Darrodi
        et al. 2015, response of R, G and B to equal power).
    """
    tables = json.loads(PUBLISHED.read_text(encoding="utf-8"))[collection]
    return {
        name: (table["first_nm"] + table["step_nm"] * np.arange(len(table["values"])), np.array(table["values"]))
        for name, table in tables.items()
    }


_NAME = re.compile(r"[\w-]+")


@cache
def optical_constant(material: str, part: str) -> Spectrum | None:
    """Read one part, ``eta`` or ``k``, of a material's complex index without importing Mitsuba.

    Return None for a material of which Mitsuba has no table, such as ``none``, its perfect mirror.
    """
    path = metadata.distribution("mitsuba").locate_file(f"mitsuba/data/ior/{material}.{part}.spd")
    if not _NAME.fullmatch(material) or not Path(str(path)).is_file():
        return None
    table = np.loadtxt(str(path))
    return Spectrum(table[:, 0], table[:, 1])


PLANCK_J_S = 6.62607015e-34  # exact, SI 2019
ELECTRON_C = 1.602176634e-19  # charge of an electron, exact
LIGHT_M_S = 299792458.0  # exact
LUMINOUS_EFFICACY_LM_W = 683.0  # SI: K_cd at 540 THz


@cache
def colour_matching_functions() -> tuple[Spectrum, Spectrum, Spectrum]:
    """Return the CIE 1931 2-degree x, y and z in steps of 1 nm from 360 to 830 nm (CIE 018:2019)."""
    x, y, z = (Spectrum(nm, np.maximum(values, 0.0)) for nm, values in published_spectra("observer").values())
    return x, y, z


def luminous_efficiency(wavelength_nm: ArrayLike, width_nm: ArrayLike) -> Floats:
    """Average V(lambda), which is the y of the CIE 1931 observer, over each band."""
    return colour_matching_functions()[1].band_average(wavelength_nm, width_nm)


def luminance(
    spectral: NDArray[np.floating], wavelength_nm: ArrayLike, width_nm: ArrayLike, light: Spectrum | None = None
) -> NDArray[np.float64]:
    """Convert spectral radiometric values to photometric ones over the last axis (band): K_m times the integral of L V.

    Radiance [W m^-2 sr^-1 nm^-1] gives luminance [cd m^-2]; irradiance [W m^-2 nm^-1] gives illuminance [lux].

    Parameters
    ----------
    spectral : (..., band) floating
        Band means.
    wavelength_nm, width_nm : (band,) array_like
    light : Spectrum, optional
        The lamp behind the band means, up to a factor (`render.band_weights`).
    """
    return _photometric(spectral, observer_weights(wavelength_nm, width_nm, light)[1])


def tristimulus(
    spectral: NDArray[np.floating], wavelength_nm: ArrayLike, width_nm: ArrayLike, light: Spectrum | None = None
) -> NDArray[np.float64]:
    """Convert spectral radiance, bands along the last axis, to XYZ [cd m^-2], shape (..., 3); Y is luminance.

    Parameters are those of `luminance`.
    """
    return _photometric(spectral, observer_weights(wavelength_nm, width_nm, light).T)


def _photometric(spectral: NDArray[np.floating], weights: Floats) -> NDArray[np.float64]:
    """Return K_m times the sum over bands of values times weights, which are (band,) or (band, n).

    A picture is summed some rows at a time, because NumPy copies in double precision all that it is given at once.
    """
    sums = np.empty((*spectral.shape[:-1], *weights.shape[1:]))
    for rows in row_blocks(spectral.shape[:-1]):
        sums[rows] = spectral[rows] @ weights
    sums *= LUMINOUS_EFFICACY_LM_W
    return sums


def row_blocks(shape: tuple[int, ...]) -> list[slice | EllipsisType]:
    """Return indices that together select all rows of a picture (h, w), each `BLOCK` pixels or one row.

    Anything but a picture is selected as a whole.
    """
    if len(shape) != 2 or shape[0] * shape[1] <= BLOCK:
        return [...]
    together = max(1, BLOCK // shape[1])
    return [slice(first, first + together) for first in range(0, shape[0], together)]


def observer_weights(wavelength_nm: ArrayLike, width_nm: ArrayLike, light: Spectrum | None = None) -> Floats:
    """Return the weights that turn band means into X, Y and Z, shape (3, band); parameters are those of `luminance`."""
    nm = np.asarray(wavelength_nm, dtype=np.float64)
    widths = np.broadcast_to(np.asarray(width_nm, dtype=np.float64), nm.shape)
    return _observer_weights(by_bits((nm, widths), nm, widths), None if light is None else spectrum_by_bits(light))


@lru_cache(maxsize=64)
def _observer_weights(bands: ByBits[tuple[Floats, Floats]], light: ByBits[Spectrum] | None) -> Floats:
    weights = band_weights(observer, OBSERVER_NM, *bands.value, None if light is None else light.value)
    weights.setflags(write=False)
    return weights


def spectrum_by_bits(spectrum: Spectrum) -> ByBits[Spectrum]:
    """Wrap a spectrum so that it can be the key of a cache."""
    return by_bits(spectrum, spectrum.wavelength_nm, spectrum.values)


def observer(wavelength_nm: Floats) -> Floats:
    """Evaluate CIE 1931 x, y and z at wavelengths, shape (3, n)."""
    return at_wavelengths(colour_matching_functions(), wavelength_nm)


def at_wavelengths(curves: Iterable[Spectrum], wavelength_nm: Floats) -> Floats:
    """Evaluate curves at wavelengths, shape (curve, n); they are 0 beyond their ends."""
    return np.array([np.interp(wavelength_nm, x.wavelength_nm, x.values, left=0.0, right=0.0) for x in curves])


def per_joule(curves: Iterable[Spectrum], wavelength_nm: Floats) -> Floats:
    """Convert responses per photon to responses per joule of light at wavelengths, shape (curve, n)."""
    return at_wavelengths(curves, wavelength_nm) * photons_per_joule(wavelength_nm)


def photons_per_joule(wavelength_nm: ArrayLike) -> Floats:
    """Compute the number of photons in a joule of light: lambda / (h c)."""
    return np.asarray(wavelength_nm, dtype=np.float64) * 1e-9 / (PLANCK_J_S * LIGHT_M_S)
