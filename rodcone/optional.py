"""Libraries that only some uses need, imported at their first use.

Their warnings at their own import (about a deprecated name of SciPy's, or absent Matplotlib) don't concern their use
here, and are suppressed.
"""

import warnings
from importlib import import_module
from typing import Any

from rodcone.errors import InputError


def optional_library(name: str, extra: str) -> Any:
    """Return a module of an optional library.

    Raises
    ------
    InputError
        If it isn't installed; the message names the extra that installs it.
    """
    try:
        return quietly_imported(name)
    except ImportError as error:
        raise InputError(f"{name}: not installed ({error}); allowed here: pip install 'rodcone[{extra}]'") from None


def quietly_imported(name: str) -> Any:
    """Import a module while suppressing warnings, and return it."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return import_module(name)
