"""Light levels as a user writes them: ``25cd/m2``, ``500lux``, or the name of one in `scenes.levels`."""

import re

from rodcone.errors import InputError, require_range, unknown
from scenes.levels import DEMO_LEVELS

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
    if unit not in UNITS:
        raise unknown("level: unit", unit, UNITS)
    require_range("level", value, 1e-9, 1e12, f"give a level above 0 in {unit}")
    return value, unit
