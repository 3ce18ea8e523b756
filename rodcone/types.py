"""Arrays and callbacks that every package uses: their names and axes, and checks of what an array holds."""

from collections.abc import Callable
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from rodcone.errors import InputError

Floats: TypeAlias = NDArray[np.float64]  # of any shape
Singles: TypeAlias = NDArray[np.float32]  # of any shape
Image: TypeAlias = NDArray[np.float64]  # (h, w, channel), or (h, w) of one channel
Plane: TypeAlias = NDArray[np.float64]  # (h, w): one channel at every pixel
Planes: TypeAlias = NDArray[np.float32]  # (band, h, w), or (group, band, h, w)
Mosaic: TypeAlias = NDArray[np.float64]  # (h, w): at every pixel the one channel that its site reads
Progress: TypeAlias = Callable[[float, float], None]  # share of the work done, 0 to 1, and relative error so far


def require_unmasked(name: str, value: object) -> None:
    """Raise `InputError` for masked values, and for a table with names, which an array would lose without a word."""
    if np.ma.is_masked(value):
        raise InputError(f"{name}: values that are masked are not allowed; fill them, as by values.filled(0)")
    if hasattr(value, "iloc") and getattr(value, "ndim", 1) != 1:
        kind = type(value).__name__
        raise InputError(f"{name}: a {kind} is not allowed; give an array, as by values.to_numpy()")


def real_array(name: str, value: object) -> NDArray[Any]:
    """Return an array of whole or floating numbers; raise `InputError` for complex or masked ones, text and others."""
    require_unmasked(name, value)
    try:
        array = np.asarray(value)
    except (ValueError, TypeError, OverflowError):  # rows of unequal length, among others
        array = np.asarray(None)
    if array.dtype.kind not in "iuf":
        kind = f"an array of {array.dtype}" if array.ndim else f"a {type(value).__name__}"
        raise InputError(f"{name}: {kind} is not allowed; give an array of real numbers")
    return array
