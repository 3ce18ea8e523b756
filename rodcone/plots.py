"""Plots of values, drawn by Matplotlib: curves, and lines through pictures."""

from collections.abc import Callable, Mapping
from io import BytesIO
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rodcone.errors import require_whole

if TYPE_CHECKING:  # Matplotlib takes half a second to import: only who plots waits for it
    from matplotlib.axes import Axes as Axes  # noqa: PLC0414  (values import it from here)
else:
    Axes = Any

BLUE, ORANGE, INK = "#0068a8", "#b34700", "#1d2125"
CHANNEL_COLOURS = {"R": "#b3261e", "G": "#00795a", "B": BLUE, "W": INK, "C": "#00838f", "Y": "#8a6d00"}
SIZE = (6.0, 3.0)  # of a figure [inches]


def new_axes() -> Axes:
    """Axes of a figure of their own, which a notebook shows and a script by `matplotlib.pyplot.show`."""
    from matplotlib import pyplot

    return pyplot.subplots(figsize=SIZE, layout="constrained")[1]


def png_of(draw: Callable[[Axes], object]) -> bytes:
    """PNG of what a function draws into axes; Matplotlib's list of open figures doesn't grow."""
    from matplotlib.figure import Figure

    figure, file = Figure(figsize=SIZE, layout="constrained"), BytesIO()
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
    """Draw a row of planes (h, w); the middle one where none is asked for, samples that are NaN left out.

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
