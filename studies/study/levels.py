"""Levels and exposures as a user writes them: ``25cd/m2``, ``500lux``, a name of `scenes.levels`; ``10ms``, a rule."""

import re
from difflib import get_close_matches

from rodcone.errors import InputError, require_range, unknown
from rodcone.time_text import parse_time
from scenes.levels import DEMO_LEVELS
from sensor.exposure import RULES

UNITS = ("cd/m2", "lux")
NAMED = {level.name: level for level in DEMO_LEVELS}
_FORM = re.compile(r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*(.*?)\s*$")


def parse_level(text: str) -> tuple[float, str]:
    """Value and unit of a light level; one that has a name is in cd/m2.

    Raises
    ------
    InputError
        For a missing number, an unknown unit, or a level that is not above 0.
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
    if not unit:
        raise InputError(f"level: {text.strip()!r} has no unit; allowed: {' or '.join(UNITS)}; write {text.strip()}lux")
    if unit not in UNITS:
        raise unknown("level: unit", unit, UNITS)
    require_range("level", value, 1e-9, 1e12, f"give a level above 0, such as 25{unit}")
    return value, unit


def parse_exposure(text: str, name: str = "exposures", least_s: float = 1e-9) -> float | None:
    """Exposure time [s] of ``10ms``, ``0.5s``, ``200us`` or ``1/50``; None for a rule of `sensor.exposure.RULES`.

    Errors call the value by `name`.

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
