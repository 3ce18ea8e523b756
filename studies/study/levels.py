"""Levels and exposures as a user writes them (``25cd/m2``, ``10ms``), and wavelengths at which lights are known."""

import re
from difflib import get_close_matches

from render.illuminants import illuminant
from render.spectrum import VISIBLE_NM, emission_lines_nm
from rodcone.errors import InputError, require_name, require_range
from rodcone.time_text import parse_time
from scenes.levels import DEMO_LEVELS
from sensor.exposure import RULES

UNITS = ("cd/m2", "lux")
SYMBOLS = {"lx": "lux", "cd/m^2": "cd/m2"}  # other spellings of the units
NAMED = {level.name: level for level in DEMO_LEVELS}
_FORM = re.compile(r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*(.*?)\s*$")


def parse_level(text: str) -> tuple[float, str]:
    """Parse the value and the unit of a light level; a level that is given by name is in cd/m2.

    Raises
    ------
    InputError
        For an unknown name, a missing number, an unknown unit, or a level that is not above 0.
    """
    if text in NAMED:
        return NAMED[text].luminance_cd_m2, UNITS[0]
    match = _FORM.match(text)
    if match is None:
        raise InputError(
            f"level: {text!r} is not a light level; allowed: a number and a unit, or {', '.join(NAMED)}; "
            "write 25cd/m2 or 500lux"
        )
    value = float(match[1])
    unit = match[2].replace("²", "2")
    unit = SYMBOLS.get(unit, unit)
    if not unit:
        raise InputError(f"level: {text.strip()!r} has no unit; allowed: {' or '.join(UNITS)}; write {text.strip()}lux")
    require_name("level: unit", unit, UNITS)
    require_range("level", value, 1e-9, 1e12, f"give a level above 0, such as 25{unit}")
    return value, unit


def levels_between(over: str) -> dict[str, float]:
    """Return the luminance of the named levels in a range such as ``street:classroom``, by name [cd/m^2]."""
    names = list(NAMED)
    first, colon, last = over.partition(":")
    if not colon or first not in names or last not in names or names.index(first) > names.index(last):
        raise InputError(f"over: {over!r} is not a range of levels; allowed: two of {', '.join(names)}, the darker "
                         f"first; write {names[0]}:{names[-1]}")  # fmt: skip
    return {name: NAMED[name].luminance_cd_m2 for name in names[names.index(first) : names.index(last) + 1]}


def parse_exposure(text: str, name: str = "exposures", least_s: float = 1e-9) -> float | None:
    """Parse an exposure time such as ``10ms``, ``0.5s``, ``200us`` or ``1/50`` [s]; None for a rule.

    The rules are `sensor.exposure.RULES`. Errors call the value by `name`.

    Raises
    ------
    InputError
        For anything else, or a time below `least_s`.
    """
    if text in RULES:
        return None
    if near := get_close_matches(text, RULES, 1):
        allowed = f"{', '.join(RULES)}, or a number and us, ms or s, or 1/50"
        raise InputError(f"{name}: {text!r} is not a time; allowed: {allowed}; did you mean {near[0]!r}?")
    seconds = parse_time(text, name, tuple(RULES))
    require_range(name, seconds, least_s, 1e6, f"give a time {'above 0' if least_s else 'of 0 or more'} in seconds")
    return seconds


LOWEST_NM, HIGHEST_NM = 300.0, 1100.0  # range of `render.spectrum.flat`, black bodies and the sun's table
LEAST_RANGE_NM = 100.0  # the widest band that `RenderLimits.band_nm` allows
# A light whose table ends before the bands do counts as dark from there on if its last value is at most this share of
# its peak. The CIE's tables of white LEDs end at 780 nm with values of 0.6 to 5 % of the peak.
_RUN_OUT = 0.01


def check_known(spectrum: str, range_nm: tuple[float, float]) -> None:
    """Raise `InputError` for an unknown light, or for one that isn't known over a range beyond 380-780 nm.

    Beyond 380-780 nm a light with emission lines is refused too.
    """
    light = illuminant(spectrum)
    if range_nm[0] >= VISIBLE_NM[0] and range_nm[1] <= VISIBLE_NM[1]:
        return
    ends = zip(light.wavelength_nm[[0, -1]], light.values[[0, -1]], (range_nm[0], -range_nm[1]), (1, -1), strict=True)
    short = [nm for nm, value, edge_nm, sign in ends if sign * nm > edge_nm and value > _RUN_OUT * light.values.max()]
    if short or emission_lines_nm(light).size:
        raise InputError(
            f"spectra: {spectrum!r} is known over {light.wavelength_nm[0]:g}-{light.wavelength_nm[-1]:g} nm, and "
            f"render.range_nm asks for {range_nm[0]:g}-{range_nm[1]:g} nm; allowed: sunlight, moonlight, temperatures "
            "such as 2856K, LEDs that have run out there such as LED-B5; take one of them"
        )


def check_rendered_range(range_nm: tuple[float, ...]) -> None:
    """Raise `InputError` for a range of wavelengths that no study renders."""
    if len(range_nm) != 2 or not LOWEST_NM <= range_nm[0] < range_nm[1] <= HIGHEST_NM:
        raise InputError(
            f"render.range_nm: {list(range_nm)!r} is not allowed; give [shortest, longest] within "
            f"{LOWEST_NM:g} to {HIGHEST_NM:g} nm, where lights are known"
        )
    if range_nm[1] - range_nm[0] < LEAST_RANGE_NM:
        raise InputError(f"render.range_nm: {list(range_nm)!r} is less than {LEAST_RANGE_NM:g} nm; widen it")
