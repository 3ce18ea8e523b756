"""Libraries that only some uses need: imported at that use, and named with their extra where they are missing."""

import warnings
from importlib import import_module
from typing import Any

from rodcone.errors import InputError


def optional_library(name: str, extra: str) -> Any:
    """Return a module of an optional library.

    What it warns about at its own import (a deprecated name of SciPy's, Matplotlib that is absent) is not about its use
    here, and kept quiet.

    Raises
    ------
    InputError
        Where it is not installed; the line names the extra that brings it.
    """
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return import_module(name)
    except ImportError as error:
        raise InputError(f"{name}: not installed ({error}); allowed here: pip install 'rodcone[{extra}]'") from None
