"""Draw a metric of a sweep over light: the means of each line, and the lead of the first line over the others."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from rodcone.errors import InputError, require_keys, require_name
from rodcone.types import Floats
from studies.metrics.confidence import half_width
from studies.metrics.metric import Metric
from studies.pages.plots import CHART, COLOURS, LINES, SOFT, STYLE, blank, name_at_ends, plain_ticks
from studies.pages.report_text import camera_name, plain_name
from studies.pages.verdict import leads
from studies.study.lit_scene import in_lux
from studies.sweep.provenance import require_alike
from studies.sweep.row import AXES, Row

LEVEL = "level"
MOST_LINES, MOST_PANELS = 8, 6
_NAMES = {"processor": camera_name, "sensor": plain_name}


@dataclass(frozen=True)
class Panel:
    """Figures under one combination of a study's other axes, drawn as one panel of lines over light.

    Attributes
    ----------
    title : str
        Values of the axes that the sweep varies, except light, the axis of the lines and the seeds.
    light : (level,) float64
        Light of the levels, in `unit`.
    unit : str
    lines : mapping of str to (level, seed) float64
        Figures by the name of each line; NaN where the sweep has no figure.
    """

    title: str
    light: Floats
    unit: str
    lines: Mapping[str, Floats]


def panels(
    rows: Sequence[Row], metric: Metric, by: str, where: Mapping[str, str], first: str | None = None
) -> list[Panel]:
    """Divide a sweep's figures into panels of lines over light.

    Parameters
    ----------
    rows : sequence of Row
    metric : Metric
    by : str
        Axis of `AXES` whose values are the lines.
    where : mapping of str to str
        Axes, and the one value of each that counts.
    first : str, optional
        Value of the first line; left out, the study's first.

    Raises
    ------
    InputError
        For an unknown axis, no cell, cells of different versions, or more lines or panels than a figure holds.
    """
    axes = [axis for axis in AXES if axis != LEVEL]
    require_keys("axis", (by, *where), axes if by == LEVEL else AXES)
    kept = [row for row in rows if all(str(getattr(row, axis)) == value for axis, value in where.items())]
    if not kept:
        raise InputError(f"where: no cell has {dict(where)}; allowed: values of the study's axes; see rodcone export")
    require_alike(kept)
    names = list(dict.fromkeys(getattr(row, by) for row in kept))
    if first is not None:
        by_text = {str(name): name for name in names}
        require_name("first", first, by_text)
        names = [by_text[first], *(name for name in names if str(name) != first)]
    others = [axis for axis in axes if axis != by and len({getattr(row, axis) for row in kept}) > 1]
    places: dict[tuple[str, ...], list[Row]] = {}
    for row in kept:
        places.setdefault(tuple(str(getattr(row, axis)) for axis in others), []).append(row)
    if len(names) > MOST_LINES or len(places) > MOST_PANELS:
        what, count, most = (
            ("lines", len(names), MOST_LINES) if len(names) > MOST_LINES else ("panels", len(places), MOST_PANELS)
        )
        axis = by if what == "lines" else others[0]
        raise InputError(
            f"where: the figure would have {count} {what}; allowed: {most}; keep a part, such as "
            f"--where {axis}={getattr(kept[0], axis)}"
        )
    return [_panel(", ".join(place), of_place, metric, by, names) for place, of_place in places.items()]


def _panel(title: str, rows: Sequence[Row], metric: Metric, by: str, names: Sequence[str]) -> Panel:
    levels, seeds = (list(dict.fromkeys(getattr(row, axis) for row in rows)) for axis in (LEVEL, "seed"))
    lux = in_lux(levels) and all(row.illuminance_lux for row in rows)
    light = {row.level: (row.illuminance_lux or 0.0) if lux else row.luminance_cd_m2 for row in rows}
    levels.sort(key=light.__getitem__)
    lines = {name: np.full((len(levels), len(seeds)), np.nan) for name in names}
    for row in rows:
        value = getattr(row, metric.key)
        lines[getattr(row, by)][levels.index(row.level), seeds.index(row.seed)] = np.nan if value is None else value
    shown = {str(_NAMES.get(by, str)(name)): figures for name, figures in lines.items()}
    return Panel(title, np.array([light[level] for level in levels]), "lux" if lux else "cd/m²", shown)


@rc_context(STYLE)
def metric_figure(parts: Sequence[Panel], metric: Metric) -> Figure:
    """Draw each panel as a row: means over the seeds with 95 % intervals, and the first line's lead over the others."""
    columns = 1 if len(parts[0].lines) == 1 else 2
    figure = blank(columns * (CHART[0] + 60), len(parts) * (CHART[1] + 20))
    grid = figure.subplots(len(parts), columns, squeeze=False)
    unit = f" [{metric.unit}]" if metric.unit else ""
    for part, row in zip(parts, grid, strict=True):
        (first, ours), *others = part.lines.items()
        place = f", {part.title}" if part.title else ""
        _draw(row[0], part, {name: (x.mean(axis=1), half_width(x)) for name, x in part.lines.items()}, 0)
        better = "higher is better" if metric.higher else "lower is better"
        row[0].set(title=f"{metric.name}{unit}, {better}{place}")
        for axes in row[1:]:
            compared = {f"over {name}": leads(metric, ours, theirs) for name, theirs in others}
            axes.axhspan(-metric.threshold, metric.threshold, color=SOFT, alpha=0.12, linewidth=0)
            axes.axhline(0.0, color=SOFT, linewidth=0.8)
            _draw(axes, part, {name: (lead.mean, lead.half) for name, lead in compared.items()}, 1)
            axes.set(title=f"Lead of {first}{unit}, grey: nobody sees it{place}")
    return figure


def _draw(axes: Axes, part: Panel, lines: Mapping[str, tuple[Floats, Floats]], slot: int) -> None:
    """Draw means with their intervals over light; `slot` is the index of the first line's colour."""
    ends = []
    for index, (name, (mean, half)) in enumerate(lines.items(), slot):
        colour = COLOURS[index % len(COLOURS)]
        style = LINES[index // len(COLOURS)]
        axes.plot(part.light, mean, color=colour, linestyle=style, marker="o", markersize=3.5)
        if np.isfinite(half).any():
            axes.fill_between(part.light, mean - half, mean + half, color=colour, alpha=0.18, linewidth=0)
        if np.isfinite(mean).any():
            ends.append((name, float(mean[np.isfinite(mean)][-1]), colour))
    axes.set(xscale="log", xlabel=f"light, {part.unit}")
    plain_ticks(axes)
    name_at_ends(axes, ends)
