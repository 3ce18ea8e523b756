"""Geometry of the report's line charts: values in, coordinates of an inline SVG out. The template draws them."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from math import ceil, floor, isfinite, log10

from matplotlib.ticker import MaxNLocator

WIDTH, HEIGHT = 400.0, 240.0
LEFT, RIGHT, TOP, BOTTOM = 58.0, 92.0, 14.0, 40.0
# Two direct labels closer than this would overprint (12 px type).
LABEL_GAP = 15.0
LABEL_LENGTH = 12


@dataclass(frozen=True)
class Tick:
    """A position along an axis in SVG units, and its text."""

    at: float
    text: str


@dataclass(frozen=True)
class ChartPoint:
    """A mark in SVG units, with the words that a pointer brings up."""

    x: float
    y: float
    text: str


@dataclass(frozen=True)
class ChartLine:
    """What is to be drawn: a name, one value (or None) for each position, and where known the interval around it."""

    name: str
    values: Sequence[float | None]
    texts: Sequence[str]
    intervals: Sequence[tuple[float, float] | None] = ()


@dataclass(frozen=True)
class Series:
    """A line ready to draw; `slot` picks colour, dash and mark; `band` outlines its intervals."""

    name: str
    label: str
    slot: int
    path: str
    points: tuple[ChartPoint, ...]
    label_y: float
    band: str = ""


@dataclass(frozen=True)
class Chart:
    """Everything the template needs to draw one chart."""

    title: str
    description: str
    x_ticks: tuple[Tick, ...]
    y_ticks: tuple[Tick, ...]
    guides: tuple[float, ...]
    series: tuple[Series, ...]
    rule: Tick | None
    x_label: str
    width: float = WIDTH
    height: float = HEIGHT
    left: float = LEFT
    right: float = WIDTH - RIGHT
    top: float = TOP
    bottom: float = HEIGHT - BOTTOM


@dataclass(frozen=True)
class Scale:
    """A linear or logarithmic map from `low`..`high` to SVG units `start`..`stop`."""

    low: float
    high: float
    start: float
    stop: float
    log: bool = False

    def at(self, value: float) -> float:
        """Return the position of `value`, held inside the axis."""
        held = min(max(value, self.low), self.high)
        low, high, here = (log10(v) for v in (self.low, self.high, held)) if self.log else (self.low, self.high, held)
        return round(self.start + (here - low) / (high - low) * (self.stop - self.start), 2)


def tick_text(value: float) -> str:
    """Write a tick without exponent or trailing zeros, thousands apart."""
    text = f"{value:,.6f}".rstrip("0").rstrip(".").replace(",", "\N{NARROW NO-BREAK SPACE}")
    return text.replace("-", "\N{MINUS SIGN}")


def linear_ticks(low: float, high: float) -> list[float]:
    """Return about five round values that enclose `low`..`high`."""
    if low == high:
        high = low + max(abs(low), 1.0)
    return [round(float(tick), 9) for tick in MaxNLocator(5, steps=[1, 2, 2.5, 5, 10]).tick_values(low, high)]


def decades(low: float, high: float) -> list[float]:
    """Return the powers of ten within `low`..`high`; every second one where they would crowd."""
    exponents = range(ceil(log10(low) - 1e-9), floor(log10(high) + 1e-9) + 1)
    return [10.0**exponent for exponent in exponents[:: 2 if len(exponents) > 6 else 1]]


def log_ticks(low: float, high: float) -> list[float]:
    """Return the powers of ten within `low`..`high`, with 2 and 5 times them where they alone would be under two."""
    whole = decades(low, high)
    if len(whole) > 1:
        return whole
    exponents = range(floor(log10(low)), ceil(log10(high)) + 1)
    finer = [factor * 10.0**exponent for exponent in exponents for factor in (1, 2, 5)]
    return [value for value in finer if low <= value <= high]


def line_path(points: Sequence[ChartPoint | None]) -> str:
    """Join points with straight lines; a missing one leaves a gap."""
    return " ".join(f"{'L' if before else 'M'}{at.x:g} {at.y:g}" for before, at in pairwise([None, *points]) if at)


def band_path(xs: Sequence[float], intervals: Sequence[tuple[float, float] | None], scale: Scale) -> str:
    """Outline the intervals from left to right; an unknown one ends a piece, and one alone is a vertical stroke."""
    pieces: list[list[tuple[float, float, float]]] = [[]]
    for x, interval in zip(xs, intervals, strict=True):
        if interval is None or not all(isfinite(end) for end in interval):
            pieces.append([])
        else:
            pieces[-1].append((x, scale.at(interval[0]), scale.at(interval[1])))
    outlines = []
    for piece in filter(None, pieces):
        around = [(x, high) for x, _, high in piece] + [(x, low) for x, low, _ in piece[::-1]]
        outlines.append("M" + "L".join(f"{x:g} {y:g}" for x, y in around) + "Z")
    return " ".join(outlines)


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


def _value_axis(values: Sequence[float], log: bool) -> tuple[Scale, list[float]]:
    """Choose the value axis: round bounds, and its ticks."""
    start, stop = HEIGHT - BOTTOM, TOP
    if not log:
        ticks = linear_ticks(min(values, default=0.0), max(values, default=1.0))
        return Scale(ticks[0], ticks[-1], start, stop), ticks
    positive = [value for value in values if value > 0] or [1.0]
    low, high = 10.0 ** floor(log10(min(positive))), 10.0 ** ceil(log10(max(positive)))
    if low == high:
        high = low * 10
    return Scale(low, high, start, stop, log=True), decades(low, high)


def _series(slot: int, line: ChartLine, order: Sequence[int], xs: Sequence[float], scale: Scale) -> Series:
    """Place one line's points, from left to right."""
    placed = [
        ChartPoint(xs[i], scale.at(value), line.texts[i])
        if (value := line.values[i]) is not None and isfinite(value)
        else None
        for i in order
    ]
    points = tuple(point for point in placed if point is not None)
    label = line.name if len(line.name) <= LABEL_LENGTH else line.name[: LABEL_LENGTH - 1] + "…"
    band = band_path([xs[i] for i in order], [line.intervals[i] for i in order], scale) if line.intervals else ""
    return Series(line.name, label, slot, line_path(placed), points, points[-1].y if points else TOP, band)


def line_chart(
    title: str,
    description: str,
    x: Sequence[float],
    lines: Sequence[ChartLine],
    *,
    percent: bool = False,
    shared: Sequence[float | None] = (),
    rule: tuple[float, str] | None = None,
    x_label: str = "scene luminance, cd/m²",
) -> Chart:
    """Lay out one chart over a logarithmic x axis.

    Parameters
    ----------
    title, description : str
        What a screen reader says instead of the picture.
    x : sequence of float
        Positive positions, such as luminance in cd/m², one for each value of every line.
    lines : sequence of ChartLine
        What to draw; None and values that are not finite leave a gap.
    percent : bool
        Shares on a logarithmic axis whose ticks are written as per cent.
    shared : sequence of float or None
        Further values the value axis has to hold, so that neighbouring charts share one scale.
    rule : (value, text), optional
        A horizontal line to judge the values against.
    x_label : str
        Name and unit of the positions.

    Returns
    -------
    Chart
        Coordinates in SVG units.
    """
    ends = [end for line in lines for interval in line.intervals if interval for end in interval]
    given = [*(value for line in lines for value in line.values), *ends, *shared, rule[0] if rule else None]
    scale, ticks = _value_axis([value for value in given if value is not None and isfinite(value)], percent)
    # A margin of 40 % of the value keeps the outermost marks off the frame.
    across = Scale(min(x) / 1.4, max(x) * 1.4, LEFT, WIDTH - RIGHT, log=True)
    xs = [across.at(position) for position in x]
    order = sorted(range(len(x)), key=lambda index: x[index])
    series = [_series(slot, line, order, xs, scale) for slot, line in enumerate(lines)]
    labels = spread([one.label_y for one in series], LABEL_GAP, TOP, HEIGHT - BOTTOM)
    write = (lambda value: tick_text(100 * value) + "\N{NO-BREAK SPACE}%") if percent else tick_text
    return Chart(
        title=title,
        description=description,
        x_ticks=tuple(Tick(across.at(value), tick_text(value)) for value in log_ticks(across.low, across.high)),
        y_ticks=tuple(Tick(scale.at(value), write(value)) for value in ticks),
        guides=tuple(xs),
        series=tuple(replace(one, label_y=round(y, 2)) for one, y in zip(series, labels, strict=True)),
        rule=Tick(scale.at(rule[0]), rule[1]) if rule else None,
        x_label=x_label,
    )
