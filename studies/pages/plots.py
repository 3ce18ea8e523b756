"""Figures that are files, drawn by Matplotlib without its global state: the same bytes each time, on white."""

from collections.abc import Sequence
from io import BytesIO
from itertools import pairwise
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.ticker import LogLocator
from numpy.typing import NDArray

from rodcone.plots import BLUE as BLUE  # noqa: PLC0414  (pages and figures import the colours from here)
from rodcone.plots import INK as INK  # noqa: PLC0414
from rodcone.plots import ORANGE as ORANGE  # noqa: PLC0414

UNIT = 1 / 72  # inches: lengths below are points, which are the units of Matplotlib's SVG
SIDE = 192  # width of a picture [points]
CHART = (460, 250)  # width and height of a chart [points]
LABEL_GAP = 15  # between the names at the ends of lines [points]
PNG_DPI = 144
GREEN, PURPLE = "#00795a", "#8d4a78"
COLOURS = (BLUE, ORANGE, GREEN, PURPLE)
SOFT = "#565d64"
STYLE: dict[Any, Any] = {  # Matplotlib's settings
    "svg.hashsalt": "rodcone",  # otherwise the ids of an SVG are random
    "svg.fonttype": "none",  # text stays text
    "font.family": "DejaVu Sans",  # Matplotlib brings it
    "font.size": 10.0,
    "text.color": INK,
    "axes.titlesize": 10.0,
    "axes.titlelocation": "left",
    "axes.edgecolor": "#b4b7b3",
    "axes.labelcolor": SOFT,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.grid.axis": "y",
    "axes.axisbelow": True,
    "grid.color": "#d9dad5",
    "xtick.color": SOFT,
    "ytick.color": SOFT,
    "legend.frameon": False,
    "lines.linewidth": 1.6,
}


def svg_text(figure: Figure) -> str:
    """Write a figure as SVG, without a date and without a link to a document type."""
    text = _saved(figure, format="svg", metadata=dict.fromkeys(("Creator", "Date", "Format", "Type"))).decode("utf-8")
    return text[text.index("<svg") :]


def png_bytes(figure: Figure) -> bytes:
    """Write a figure as PNG, two pixels a point."""
    return _saved(figure, format="png", dpi=PNG_DPI, metadata={"Software": None})


def _saved(figure: Figure, **options: Any) -> bytes:
    """Lay a figure out once, since each further layout would move its parts a little, and write it."""
    buffer = BytesIO()
    with rc_context(STYLE):
        figure.draw_without_rendering()
        figure.set_layout_engine("none")
        figure.savefig(buffer, **options)
    return buffer.getvalue()


def blank(width: float, height: float) -> Figure:
    """Return an empty figure of a size in points; its axes are laid out so that nothing overlaps."""
    return Figure((width * UNIT, height * UNIT), layout=ConstrainedLayoutEngine(w_pad=8 * UNIT, h_pad=8 * UNIT))


@rc_context(STYLE)
def picture_rows(rows: Sequence[Sequence[tuple[str, NDArray[np.float64]]]]) -> Figure:
    """Draw rows of encoded pictures (h, w, 3), each with words above it; all have one width."""
    columns = max(len(row) for row in rows)
    heights = [max(SIDE * picture.shape[0] / picture.shape[1] for _, picture in row) + 28 for row in rows]
    figure = blank(columns * (SIDE + 10), sum(heights))
    grid = figure.subplots(len(rows), columns, squeeze=False, height_ratios=heights)
    for axes in grid.flat:
        axes.set_axis_off()
    for row, line in zip(rows, grid, strict=True):
        for (words, picture), axes in zip(row, line, strict=False):
            show_picture(axes, picture, words)
    return figure


def show_picture(axes: Axes, picture: NDArray[np.float64], words: str = "") -> None:
    """Draw an encoded picture (h, w, 3) in [0, 1]; its pixels stay squares."""
    axes.set_axis_off()
    axes.imshow(picture, interpolation="none")
    axes.set_title(words)


def plain_ticks(axes: Axes) -> None:
    """Write the ticks of both axes without exponents; less than two decades have ticks at 1, 2 and 5."""
    for axis, (low, high) in ((axes.xaxis, axes.get_xlim()), (axes.yaxis, axes.get_ylim())):
        if axis.get_scale() == "log" and high < 100 * low:
            axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axis.set_major_formatter(lambda value, _: tick_text(value))
        axis.set_minor_formatter(lambda value, _: "")


def name_at_ends(axes: Axes, ends: Sequence[tuple[str, float, str]]) -> None:
    """Write names right of the axes, apart from each other.

    Parameters
    ----------
    axes : Axes
        With its scales and limits set.
    ends : sequence of (name, y, colour)
        Where each line ends.
    """
    box = axes.transLimits
    high = CHART[1] * 0.7  # of the axes, about [points]
    wanted = [float(box.transform(axes.transScale.transform((1.0, y)))[1]) * high for _, y, _ in ends]
    for (name, _, colour), height in zip(ends, spread(wanted, LABEL_GAP, 0.0, high), strict=True):
        axes.text(1.02, height / high, name, color=colour, va="center", transform=axes.transAxes)


def tick_text(value: float) -> str:
    """Write a tick without exponent or trailing zeros, thousands apart."""
    text = f"{value:,.6f}".rstrip("0").rstrip(".").replace(",", "\N{NARROW NO-BREAK SPACE}")
    return text.replace("-", "\N{MINUS SIGN}")


def spread(wanted: Sequence[float], gap: float, low: float, high: float) -> list[float]:
    """Move label positions apart until neighbours are `gap` from each other, within `low`..`high` where that fits."""
    order = sorted(range(len(wanted)), key=lambda index: wanted[index])
    placed = list(wanted)
    for before, after in pairwise(order):
        placed[after] = max(placed[after], placed[before] + gap)
    over = max((placed[index] for index in order), default=low) - high
    if over > 0:
        placed = [position - over for position in placed]
        for before, after in pairwise(order[::-1]):
            placed[after] = min(max(wanted[after], low), placed[before] - gap)
    return placed
