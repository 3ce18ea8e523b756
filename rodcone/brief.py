"""One-line texts of values that hold arrays or tables: what a console prints in place of all their numbers."""

from collections.abc import Mapping
from dataclasses import MISSING, Field, fields
from typing import Any

import numpy as np

MOST_ITEMS = 6  # of an array, list or mapping that are written out
MOST_NESTED = 160  # characters of a value inside another
MOST_RANGED = 1 << 20  # elements of an array whose range is worth the time


def brief(value: Any) -> str:
    """Text of a dataclass on one line: its fields but for those at their defaults, arrays by shape and range.

    A class that holds arrays or tables takes it as its ``__repr__``.
    """
    parts = [
        f"{field.name}={_text(getattr(value, field.name))}"
        for field in fields(value)
        if not _is_default(field, getattr(value, field.name))
    ]
    return f"{type(value).__name__}({', '.join(parts)})"


def _is_default(field: Field[Any], value: object) -> bool:
    plain = isinstance(value, bool | int | float | str | tuple | None)
    return plain and field.default is not MISSING and bool(value == field.default)


def _text(value: Any) -> str:
    """Text of a field; what is long is named by its kind."""
    if isinstance(value, np.ndarray):
        return _array(value)
    if isinstance(value, float | np.floating):
        return f"{value:.6g}"
    if isinstance(value, Mapping):
        plain = len(value) <= MOST_ITEMS and all(isinstance(x, str | float | int) for x in value.values())
        text = f"{{{_listed([f'{key}: {_text(x)}' if plain else str(key) for key, x in value.items()])}}}"
    elif isinstance(value, tuple | list):
        text = f"({_listed([_text(item) for item in value])})"
    else:
        text = f"<{type(value).__name__}>" if callable(value) else repr(value)
    if len(text) <= MOST_NESTED or isinstance(value, str):
        return text if len(text) <= MOST_NESTED else f"{text[:MOST_NESTED]}...'"
    kind = type(value).__name__
    return f"<{kind} of {len(value)}>" if isinstance(value, Mapping | tuple | list) else f"{kind}(...)"


def _array(values: np.ndarray[Any, Any]) -> str:
    """Small ones in full, others by shape, type and range."""
    if 0 < values.size <= MOST_ITEMS and values.ndim == 1:
        return f"[{', '.join(f'{x:.6g}' if values.dtype.kind == 'f' else str(x) for x in values)}]"
    what = f"<{' x '.join(map(str, values.shape))} {values.dtype}"
    if values.ndim < 3 and 0 < values.size <= MOST_RANGED and values.dtype.kind in "iuf":
        numbers = values[~np.isnan(values)]
        return f"{what}, {numbers.min():.4g} to {numbers.max():.4g}>" if numbers.size else f"{what}, all NaN>"
    return f"{what}>"


def _listed(items: list[str]) -> str:
    """Items with commas, the first few of many."""
    if len(items) <= MOST_ITEMS:
        return ", ".join(items)
    return f"{', '.join(items[: MOST_ITEMS - 1])}, ... {len(items)} in all"
