"""Exposure times as a user writes them: ``20ms``, or a rule by name."""

import re
from collections.abc import Sequence
from difflib import get_close_matches

from rodcone.errors import InputError, require_range
from sensor.exposure import RULES

_TIME = re.compile(r"\s*(\d+\.?\d*(?:[eE][-+]?\d+)?|\.\d+)\s*(us|ms|s)\s*$")
_NUMBER = re.compile(r"\d+\.?\d*")
_SECONDS = {"us": 1e-6, "ms": 1e-3, "s": 1.0}


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


def parse_time(text: str, name: str = "time", others: Sequence[str] = ()) -> float:
    """Time [s] of ``10ms``, ``0.5s`` or ``200us``; `others` are what an error names beside it.

    Raises
    ------
    InputError
        For anything else, a number without a unit too.
    """
    match = _TIME.match(text)
    if match is None:
        fix = f"write {text.strip()}ms or {text.strip()}s" if _NUMBER.fullmatch(text.strip()) else "write 10ms"
        rules = f"{', '.join(others)}, or " if others else ""
        raise InputError(f"{name}: {text!r} is not a time; allowed: {rules}a number and us, ms or s; {fix}")
    return float(match[1]) * _SECONDS[match[2]]
