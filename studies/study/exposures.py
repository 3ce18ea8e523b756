"""Exposure times as a user writes them: ``20ms``, or a rule by name."""

from difflib import get_close_matches

from rodcone.errors import InputError, require_range
from rodcone.time_text import parse_time
from sensor.exposure import RULES


def parse_exposure(text: str, name: str = "exposures") -> float | None:
    """Exposure time [s] of ``10ms``, ``0.5s`` or ``200us``; None for a rule of `sensor.exposure.RULES`.

    Errors call the value by `name`.

    Raises
    ------
    InputError
        For anything else, or a time of 0.
    """
    if text in RULES:
        return None
    if near := get_close_matches(text, RULES, 1):
        allowed = f"{', '.join(RULES)}, or a number and us, ms or s"
        raise InputError(f"{name}: {text!r} is not a time; allowed: {allowed}; did you mean {near[0]!r}?")
    seconds = parse_time(text, name, tuple(RULES))
    require_range(name, seconds, 1e-9, 1e6, "give a time above 0 in seconds")
    return seconds
