"""Spectra of light sources by name, each scaled to a luminance of 1 cd/m^2 (as an irradiance, to 1 lux)."""

import re
import warnings
from functools import cache

import numpy as np

from render.spectrum import (
    LUMINOUS_EFFICACY_LM_W,
    Spectrum,
    black_body,
    colour_matching_functions,
    flat,
    line_spectrum,
    luminous_efficiency,
    published_spectra,
)
from rodcone.curve_file import is_curve_file, read_columns
from rodcone.errors import InputError, one_line, require_range, unknown
from rodcone.optional import quietly_imported

# Sodium's lines D2 and D1 in air, from the NIST Atomic Spectra Database. In thin vapour D2 is twice as strong. In a
# low-pressure lamp the two are nearer to equal, but at a distance of 0.6 nm no band and no eye shows the difference.
_LINES = {"sodium_low": ((588.995, 589.592), (2.0, 1.0))}
# Rise of the full moon's reflectance per nm, over its value at 550 nm: straight line through the 16 bands of 405 to
# 775 nm of the ROLO model at a phase of 7 degrees (Kieffer & Stone 2005, equation 10 and table 4; libration left out).
MOON_SLOPE_PER_NM = 1.48e-3
# Lamps that emit lines, but of which only a table in steps of 5 nm is known, which shows none.
TABULATED_LINES = ("F11", "LED-RGB1", "sodium_high")
_NUMBER = re.compile(r"\d{4,5}")  # a temperature without its unit; no lamp's name is a number of so many digits
# Units of a column that no factor turns into power per wavelength.
_NOT_POWER = re.compile(r"\b(?:[µμu]?mol\w*|photons?|quanta|dBm?|log\w*|counts?)\b", re.IGNORECASE)
_TEMPERATURE = re.compile(r"(D?)(\d+(?:\.\d+)?) ?K")


def illuminant_names() -> tuple[str, ...]:
    """List the names that `illuminant` knows, besides a temperature such as ``3000K`` or ``D7000K``.

    Most are tables of CIE 015:2018 in steps of 5 nm. F11 is a narrow-band fluorescent lamp, HP1 a standard
    high-pressure sodium lamp, LED-B3 a white LED of 4100 K, LED-RGB1 a lamp of three LEDs and LED-V1 a white LED with a
    violet pump.

    Examples
    --------
    >>> import rodcone
    >>> "D65" in rodcone.illuminants()
    True
    """
    return (*sorted((*published_spectra("illuminants"), "E")), "moonlight", *_LINES, "sunlight")


def lines_nm(name: str) -> tuple[float, ...]:
    """Return a named light's emission lines [nm], for `line_bands`; an empty tuple if its spectrum is smooth.

    Raises
    ------
    InputError
        If `name` is unknown.

    Warns
    -----
    UserWarning
        For a lamp that emits lines which its table doesn't show; plain bands follow such a table exactly.

    Examples
    --------
    >>> import rodcone
    >>> rodcone.lines_nm("sodium_low")
    (588.995, 589.592)
    """
    illuminant(name)
    if name in TABULATED_LINES:
        warnings.warn(
            f"lines_nm: {name} is a lamp of lines whose table holds steps of 5 nm and no lines: none to give; "
            "plain bands follow its table, with electrons within 0.2 % at 10 nm and 2 % at 20 nm",
            stacklevel=2,
        )
    return _LINES[name][0] if name in _LINES else ()


def illuminant(name: str) -> Spectrum:
    """Return the spectrum of a named light, scaled to a luminance of 1 cd/m^2.

    Parameters
    ----------
    name : str
        One of `illuminant_names`; ``3000K`` or ``3000 K``, a black body; ``D7000K``, daylight of that temperature; the
        name of another light in colour-science, such as ``FL3.12``, for which that library is imported in 2 s; or a
        file, ``led.csv``, ``.txt``, ``.spd`` or ``.spdx``, of wavelengths and one more column in any unit of power
        (`rodcone.curve_file.read_columns`). A file is read at each call.

    Raises
    ------
    InputError
        If `name` is unknown, its temperature is out of range, or the file has another form or holds no light.

    Examples
    --------
    >>> import rodcone
    >>> light = rodcone.illuminant("3000K")
    >>> light.wavelength_nm[[0, -1]]
    array([ 300., 1100.])
    """
    if not isinstance(name, str):
        raise InputError(
            f"illuminant: {name!r} is no name; allowed: names such as D65; write '{name} K' for a black body"
        )
    return _measured(name) if is_curve_file(name) else _named(name)


def _measured(path: str) -> Spectrum:
    columns = read_columns(path, "illuminant")
    if len(columns) != 2:
        raise InputError(
            f"illuminant: {path!r} has {len(columns) - 1} columns beside wavelength_nm; allowed: 1; keep one lamp"
        )
    column = list(columns)[1]
    if unit := _NOT_POWER.search(column):
        raise InputError(
            f"illuminant: {path!r}: its column {column!r} is in {unit[0]}; allowed: power per wavelength, "
            "in any unit; convert it"
        )
    try:
        nm, values = columns.values()
        lamp = Spectrum(nm, values)
        return unit_luminance(lamp * (1.0 / float(lamp.values.max())))  # in any unit, so of any size
    except (InputError, ZeroDivisionError) as error:
        reason = one_line(error) if isinstance(error, InputError) else "it gives no visible light"
        raise InputError(f"illuminant: {path!r}: {reason}") from None


@cache
def _named(name: str) -> Spectrum:
    if temperature := _TEMPERATURE.fullmatch(name):
        kelvin = float(temperature[2])
        if temperature[1]:
            return daylight(kelvin)
        require_range("illuminant: black body [K]", kelvin, 800.0, 1e6, "cooler ones hardly glow")
        return unit_luminance(black_body(kelvin))
    if _NUMBER.fullmatch(name):
        raise InputError(
            f"illuminant: {name!r} has no unit; allowed: kelvin; write {name}K for a black body, D{name}K for daylight"
        )
    if name not in illuminant_names():
        others = quietly_imported("colour").SDS_ILLUMINANTS
        if name not in list(others):  # colour-science takes any case
            raise unknown("illuminant", name, (*illuminant_names(), "temperature such as 3000K"))
        return unit_luminance(Spectrum(others[name].wavelengths, others[name].values))
    if name in _LINES:
        return _unit_lines(*_LINES[name])
    return unit_luminance(_smooth(name))


def _unit_lines(at_nm: tuple[float, ...], powers: tuple[float, ...]) -> Spectrum:
    """Scale lines to a luminance of 1 by V at the lines themselves, because bands of 1 nm would be 1 % off."""
    v = colour_matching_functions()[1]
    visible = np.interp(at_nm, v.wavelength_nm, v.values) @ np.array(powers)
    return line_spectrum(at_nm, np.array(powers) / (LUMINOUS_EFFICACY_LM_W * visible))


def _smooth(name: str) -> Spectrum:
    if name == "E":
        return flat()
    if name in ("moonlight", "sunlight"):
        # the sun's own beam at the ground, 1 nm means: ASTM G173-03, direct and circumsolar, sun 42 degrees high
        nm, sun = published_spectra("sun")["direct"]
        return Spectrum(nm, sun if name == "sunlight" else sun * (1 + MOON_SLOPE_PER_NM * (nm - 550.0)))
    return Spectrum(*published_spectra("illuminants")[name])


@cache
def daylight(cct_k: float) -> Spectrum:
    """Compute CIE daylight of a correlated colour temperature (CIE 015:2018, illuminants D), scaled to 1 cd/m^2.

    Parameters
    ----------
    cct_k : float
        4000 to 25 000 K; D65 is 6504 K, since the second radiation constant has changed from 1.4380 to 1.4388 cm K.

    Raises
    ------
    InputError
        For a temperature outside that range, in which the formula holds.
    """
    require_range("illuminant: daylight [K]", cct_k, 4000.0, 25_000.0, "below it give a black body such as 3000K")
    t = np.float64(cct_k)  # rounded as colour-science does: stored renders are found by these bits
    if t <= 7000.0:
        x = -4.607e9 / t**3 + 2.9678e6 / t**2 + 0.09911 * 10**3 / t + 0.244063
    else:
        x = -2.0064e9 / t**3 + 1.9018e6 / t**2 + 0.24748 * 10**3 / t + 0.23704
    y = -3.0 * x**2 + 2.87 * x - 0.275
    m = 0.0241 + 0.2562 * x - 0.7341 * y
    m1 = (-1.3515 - 1.7703 * x + 5.9114 * y) / m
    m2 = (0.0300 - 31.4424 * x + 30.0717 * y) / m
    (nm, s0), (_, s1), (_, s2) = published_spectra("daylight").values()
    return unit_luminance(Spectrum(nm, s0 + m1 * s1 + m2 * s2))


def unit_luminance(spectrum: Spectrum) -> Spectrum:
    """Scale a spectrum so that its `spectral_luminance` is 1."""
    return spectrum * (1.0 / spectral_luminance(spectrum))


def spectral_luminance(spectrum: Spectrum) -> float:
    """Compute the luminance of a spectrum at power 1, summed in bands of 1 nm over 360-830 nm."""
    nm = np.arange(360.5, 830.0)
    width = np.ones_like(nm)
    return float(LUMINOUS_EFFICACY_LM_W * (spectrum.band_average(nm, width) @ luminous_efficiency(nm, width)))
