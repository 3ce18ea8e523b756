"""Display of values: one line of text instead of all numbers, plots of curves and of rows of pictures by Matplotlib,
and in a notebook a small picture, which is made only when it is shown.
"""

from collections.abc import Callable, Mapping
from dataclasses import MISSING, Field, fields
from io import BytesIO
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rodcone.colour_spaces import encode_srgb, white_of
from rodcone.errors import require_whole

MOST_ITEMS = 6  # largest number of items of an array, list or mapping that are written out
MOST_NESTED = 160  # largest number of characters of a value inside another one
MOST_RANGED = 1 << 20  # largest number of elements of an array whose range is computed


def brief(value: Any) -> str:
    """Return the text of a dataclass on one line: fields that differ from their defaults, arrays by shape and range.

    A class that holds arrays or tables uses this function as its ``__repr__``.
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


def _text(value: object) -> str:
    """Return the text of a field; a long value is named by its kind."""
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
    """Return a small array in full; for any other one return its shape, type and range."""
    if 0 < values.size <= MOST_ITEMS and values.ndim == 1:
        return f"[{', '.join(f'{x:.6g}' if values.dtype.kind == 'f' else str(x) for x in values)}]"
    what = f"<{' x '.join(map(str, values.shape))} {values.dtype}"
    if values.ndim < 3 and 0 < values.size <= MOST_RANGED and values.dtype.kind in "iuf":
        numbers = values[~np.isnan(values)]
        return f"{what}, {numbers.min():.4g} to {numbers.max():.4g}>" if numbers.size else f"{what}, all NaN>"
    return f"{what}>"


def _listed(items: list[str]) -> str:
    """Join items by commas; of many, name the first few and their number."""
    if len(items) <= MOST_ITEMS:
        return ", ".join(items)
    return f"{', '.join(items[: MOST_ITEMS - 1])}, ... {len(items)} in all"


if TYPE_CHECKING:  # Matplotlib's import takes half a second, for which only a user who plots waits
    from matplotlib.axes import Axes as Axes  # noqa: PLC0414  (values import it from here)
else:
    Axes = Any

BLUE, ORANGE, INK = "#0068a8", "#b34700", "#1d2125"
CHANNEL_COLOURS = {"R": "#b3261e", "G": "#00795a", "B": BLUE, "W": INK, "C": "#00838f", "Y": "#8a6d00"}
SIZE = (6.0, 3.0)  # width and height of a figure [inches]


def new_axes() -> Axes:
    """Return the axes of a new figure, which a notebook shows by itself and a script by `matplotlib.pyplot.show`."""
    from matplotlib import pyplot

    return pyplot.subplots(figsize=SIZE, layout="constrained")[1]


def png_of(draw: Callable[[Axes], object]) -> bytes:
    """Return a PNG of what a function draws into axes; Matplotlib's list of open figures doesn't grow."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=SIZE, layout="constrained")
    file = BytesIO()
    draw(figure.subplots())
    figure.savefig(file, format="png", dpi=100)
    return file.getvalue()


def draw_curves(
    curves: Mapping[str, tuple[ArrayLike, ArrayLike]], axes: Axes | None, *, x: str, y: str, marker: str = ""
) -> Axes:
    """Draw curves by name into axes, or into new ones; a channel's name gives its colour.

    Parameters
    ----------
    curves : mapping of str to pair of (n,) arrays
        A curve without a name stays out of the legend.
    x, y : str
        Names of the two axes, units included.
    """
    axes = new_axes() if axes is None else axes
    for name, (across, up) in curves.items():
        axes.plot(across, up, color=CHANNEL_COLOURS.get(name), label=name or None, marker=marker, markersize=3.0)
    axes.set(xlabel=x, ylabel=y)
    if any(curves):
        axes.legend(frameon=False)
    return axes


def draw_line(planes: Mapping[str, NDArray[np.floating]], row: int | None, axes: Axes | None, y: str) -> Axes:
    """Draw a row of planes (h, w), by default the middle one; samples that are NaN are left out.

    Raises
    ------
    InputError
        For a row outside the picture.
    """
    height, width = next(iter(planes.values())).shape
    row = height // 2 if row is None else row
    require_whole("row", row, 0, height - 1, "give one of the picture's rows")
    finite = {name: np.isfinite(plane[row]) for name, plane in planes.items()}
    curves = {name: (np.flatnonzero(at), planes[name][row, at]) for name, at in finite.items() if at.any()}
    return draw_curves(curves, axes, x=f"column, in row {row}", y=y, marker="." if width <= 128 else "")


LEAST_SHOWN = 384  # approximate width to which a smaller picture is enlarged [pixels]
SIDE = 512  # largest longer side of a shown picture [pixels]


def preview_png(linear: NDArray[np.floating]) -> bytes:
    """Return a PNG of a linear picture, (h, w, 3) sRGB or (h, w) grey, scaled by its own white.

    Large pictures are subsampled, small ones enlarged by whole multiples. It is meant for display only: pictures that
    are to be compared are adapted and encoded by `rodcone.colour_spaces`.
    """
    from PIL import Image  # only here: most programs never show anything

    step = max(1, -(-max(linear.shape[:2]) // SIDE))
    small = np.nan_to_num(np.asarray(linear[::step, ::step], dtype=np.float64))
    white = white_of(small)
    clipped = np.clip(small / white, 0.0, 1.0) if white > 0 else np.zeros_like(small)
    times = max(1, LEAST_SHOWN // clipped.shape[1])
    pixels = np.rint(encode_srgb(clipped) * 255).astype(np.uint8).repeat(times, axis=0).repeat(times, axis=1)
    file = BytesIO()
    Image.fromarray(pixels).save(file, "PNG")
    return file.getvalue()
