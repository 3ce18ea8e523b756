"""Tables of colour-science, whose import takes two seconds: loaded at first use, its plotting notice kept quiet."""

import warnings
from functools import cache
from typing import Any


@cache
def colour_science() -> Any:
    """Return the `colour` module."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # it warns that Matplotlib is absent, which nothing here uses
        import colour
    return colour
