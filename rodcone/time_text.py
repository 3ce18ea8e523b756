"""Times as a user writes them: ``20ms``, ``1/50``."""

import re
from collections.abc import Sequence

from rodcone.errors import InputError

_TIME = re.compile(r"\s*(\d+\.?\d*(?:[eE][-+]?\d+)?|\.\d+)\s*(us|ms|s)\s*$")
_FRACTION = re.compile(r"\s*1/(\d{1,6}(?:\.\d+)?)\s*s?\s*$")  # as photographers write it
_NUMBER = re.compile(r"\d+\.?\d*")
_SECONDS = {"us": 1e-6, "ms": 1e-3, "s": 1.0}


def parse_time(text: str, name: str = "time", others: Sequence[str] = ()) -> float:
    """Return the time [s] of ``10ms``, ``0.5s``, ``200us`` or ``1/50``; an error also lists `others` as allowed.

    Raises
    ------
    InputError
        For anything else, a number without a unit too.
    """
    fraction = _FRACTION.match(text)
    if fraction and float(fraction[1]) > 0:
        return 1.0 / float(fraction[1])
    match = _TIME.match(text)
    if match is None:
        fix = f"write {text.strip()}ms or {text.strip()}s" if _NUMBER.fullmatch(text.strip()) else "write 20ms"
        rules = f"{', '.join(others)}, or " if others else ""
        raise InputError(f"{name}: {text!r} is not a time; allowed: {rules}a number and us, ms or s, or 1/50; {fix}")
    return float(match[1]) * _SECONDS[match[2]]
