"""What the paper's figures are laid out of: pictures in rows with captions, and curves over an axis."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rodcone.colour_spaces import encode_srgb
from studies.pages.charts import Scale, decades, linear_ticks, spread, tick_text
from studies.pages.drawing import Drawing, Line, Mark, Picture, Text

Image = NDArray[np.float64]
SIDE, GAP, HEAD = 192.0, 10.0, 18.0  # of a picture, between pictures, and for the words above one
WIDTH, HEIGHT = 460.0, 250.0
LEFT, RIGHT, TOP, BOTTOM = 56.0, 120.0, 26.0, 42.0


@dataclass(frozen=True)
class Figure:
    """A figure: the paper's number, its caption, and the drawing."""

    name: str
    caption: str
    drawing: Drawing


def sheet(title: str, description: str, rows: Sequence[Sequence[tuple[str, Image]]]) -> Drawing:
    """Rows of pictures (h, w, 3), each with words above it; all are shown of one width."""
    marks: list[Mark] = []
    y = 0.0
    for row in rows:
        height = max(SIDE * picture.shape[0] / picture.shape[1] for _, picture in row)
        for column, (words, picture) in enumerate(row):
            x = column * (SIDE + GAP)
            marks.append(Text(x, y + 13, words))
            marks.append(Picture(x, y + HEAD, SIDE, SIDE * picture.shape[0] / picture.shape[1], picture))
        y += HEAD + height + GAP
    width = max(len(row) for row in rows) * (SIDE + GAP) - GAP
    return Drawing(width, y - GAP, title, description, tuple(marks))


def curves(
    title: str,
    x_label: str,
    x: Sequence[float],
    lines: Sequence[tuple[str, Sequence[float], str, bool]],
    *,
    log: tuple[bool, bool] = (False, False),
    at: tuple[float, float] = (0.0, 0.0),
) -> tuple[Mark, ...]:
    """Marks of one chart of `WIDTH` x `HEIGHT` units.

    Parameters
    ----------
    title : str
        What is over the axis, with its unit.
    x_label : str
    x : sequence of float
    lines : sequence of (name, values, colour, dashed)
        One value for each x. The name stands at the line's end, or over its peak where it ends under a tenth of that.
    log : (bool, bool)
        Whether each axis is logarithmic.
    at : (float, float)
        The chart's corner.
    """
    across, right, bottom = at[0] + LEFT, at[0] + WIDTH - RIGHT, at[1] + HEIGHT - BOTTOM
    values = [value for _, line, _, _ in lines for value in line]
    xs, x_ticks = _axis(min(x), max(x), log[0], across, right)
    ys, y_ticks = _axis(min(values), max(values), log[1], bottom, at[1] + TOP)
    marks: list[Mark] = [Text(across, at[1] + 14, title, bold=True)]
    for tick in y_ticks:
        marks.append(Line(((across, ys.at(tick)), (right, ys.at(tick))), "grid"))
        marks.append(Text(across - 8, ys.at(tick) + 4, tick_text(tick), "end", "soft"))
    for tick in x_ticks:
        marks.append(Line(((xs.at(tick), bottom), (xs.at(tick), bottom + 4)), "axis"))
        marks.append(Text(xs.at(tick), bottom + 17, tick_text(tick), "middle", "soft"))
    marks.append(Line(((across, bottom), (right, bottom)), "axis"))
    marks.append(Text(right, bottom + 34, x_label, "end", "soft"))
    ends = spread([ys.at(line[-1]) for _, line, _, _ in lines], 15.0, at[1] + TOP, bottom)
    for (name, line, colour, dashed), end in zip(lines, ends, strict=True):
        points = tuple((xs.at(here), ys.at(value)) for here, value in zip(x, line, strict=True))
        marks.append(Line(points, colour, dashed))
        peak = points[line.index(max(line))]
        falls = line[-1] < 0.1 * max(line)
        over = Text(peak[0], peak[1] - 6, name, "middle", colour)
        marks.append(over if falls else Text(right + 8, end + 4, name, "start", colour))
    return tuple(marks)


def _axis(low: float, high: float, log: bool, start: float, stop: float) -> tuple[Scale, list[float]]:
    if log:
        return Scale(low, high, start, stop, log=True), decades(low, high)
    ticks = linear_ticks(low, high)
    return Scale(ticks[0], ticks[-1], start, stop), ticks


def grey(plane: Image, white: float) -> Image:
    """Plane (h, w) as encoded grey (h, w, 3), `white` being 1: shown as a camera would, by sRGB's curve."""
    return encode_srgb(np.repeat(np.asarray(plane, dtype=np.float64)[..., None] / white, 3, axis=-1))
