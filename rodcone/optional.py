"""Libraries that are imported at their first use: those that only some uses need, and colour-science, which takes 2 s.

What they warn about at their own import (a deprecated name of SciPy's, Matplotlib that is absent) is not about their
use here, and kept quiet.
"""

import warnings
from functools import cache
from importlib import import_module
from typing import Any

from rodcone.errors import InputError


@cache
def colour_science() -> Any:
    """Return the `colour` module."""
    return _quietly("colour")


def optional_library(name: str, extra: str) -> Any:
    """Return a module of an optional library.

    Raises
    ------
    InputError
        Where it is not installed; the line names the extra that brings it.
    """
    try:
        return _quietly(name)
    except ImportError as error:
        raise InputError(f"{name}: not installed ({error}); allowed here: pip install 'rodcone[{extra}]'") from None


def _quietly(name: str) -> Any:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return import_module(name)
