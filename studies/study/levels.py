"""Light levels as a user writes them: ``25cd/m2`` or ``500lux``."""

import re

from render.transport import Transport
from rodcone.errors import InputError, require_range, unknown
from scenes.levels import LightLevel

UNITS = ("cd/m2", "lux")
_FORM = re.compile(r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*(.*?)\s*$")


def parse_level(text: str) -> tuple[float, str]:
    """Value and unit of a light level.

    Raises
    ------
    InputError
        For a missing number, an unknown unit, or a level that is not above 0.
    """
    match = _FORM.match(text)
    if match is None:
        raise InputError(f"level: {text!r} is not a light level; allowed: a number and a unit; write 25cd/m2 or 500lux")
    value = float(match[1])
    unit = match[2].replace("²", "2")
    if unit not in UNITS:
        raise unknown("level: unit", unit, UNITS)
    require_range("level", value, 1e-9, 1e12, f"give a level above 0 in {unit}")
    return value, unit


def resolve_level(text: str, transport: Transport) -> LightLevel:
    """Light level as mean scene luminance; lux means illuminance on the scene's reference plane."""
    value, unit = parse_level(text)
    if unit == "cd/m2":
        return LightLevel(text, value, "asked for")
    per_cd_m2 = transport.illuminance_lux(1.0)
    if per_cd_m2 is None:
        raise InputError(f"level: {text!r} needs a reference plane, which the scene doesn't state; give it in cd/m2")
    return LightLevel(text, value / per_cd_m2, "asked for")
