"""Choose which two of a report's pictures are compared, and write the figures and words of all comparisons."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations, permutations, product
from math import isfinite, isnan
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenes.catalogue import DRAWN
from studies.metrics.metric import METRICS, Metric
from studies.pages import report_text as text
from studies.pages.headline import WHITE_PIXEL, Group, Pair, answer, balance_words, best_words, in_light, pair_words
from studies.pages.report_data import ReportCell, ReportData
from studies.pages.verdict import AHEAD, BEHIND, OUTCOMES, Leads, counts, leads
from studies.study.study import OWN

# Indices of the axes in `ReportData.cells`; and the orders in which an axis is preferred for a row's pictures (along
# it they are compared) and for the rows.
SCENE, LIGHT, SENSOR, EXPOSURE, BALANCE, BRIGHTNESS, CAMERA = range(7)
ALONG_FIRST = (BRIGHTNESS, EXPOSURE, SENSOR, LIGHT, SCENE, BALANCE, CAMERA)
ROWS_FIRST = (SENSOR, EXPOSURE, SCENE, LIGHT, BALANCE, CAMERA, BRIGHTNESS)
RIVALS = (CAMERA, SENSOR, EXPOSURE, BALANCE)  # axes of which a person chooses a value; scene and light are given


@dataclass(frozen=True)
class Axis:
    """Axis of a study, and its values as the page writes them."""

    name: str
    values: tuple[str, ...]


@dataclass(frozen=True)
class Comparison:
    """Value `a` of the axis `compared` against its value `b`, along another axis, in a row for each value of a third.

    Attributes
    ----------
    compared, along, rows : int
        Indices of the axes. `along` and `rows` may have a single value.
    a, b : int
        Indices of the values; equal if there is nothing to compare.
    """

    compared: int
    along: int
    rows: int
    a: int
    b: int


def axes_of(report: ReportData) -> tuple[Axis, ...]:
    """Return all axes of a report, in the order of `ReportData.cells`."""
    return (
        Axis("Scene", tuple(scene.name for scene in report.scenes)),
        Axis("Light", tuple("own light" if x == OWN else f"under {x}" for x in report.spectra)),
        Axis("Sensor", tuple(text.plain_name(sensor.name) for sensor in report.sensors)),
        Axis("Exposure", tuple(text.exposure_name(exposure) for exposure in report.exposures)),
        Axis("White balance", tuple(text.BALANCE_NAMES.get(balance, balance) for balance in report.balances)),
        Axis("Light level", tuple(level.name for level in report.levels)),
        Axis("Camera", tuple(text.camera_name(camera) for camera in report.cameras)),
    )


def first_comparison(report: ReportData) -> Comparison:
    """Choose the comparison that a page shows at first: of cameras if there are several, else by the next of `RIVALS`.

    Of several cameras it compares the pair that the study names, else the same method on both mosaics if the study has
    both. If there is nothing to compare, both values are the one camera.
    """
    several = [index for index, axis in enumerate(axes_of(report)) if len(axis.values) > 1]

    def chosen(order: tuple[int, ...], *taken: int) -> int:
        free = [index for index in order if index not in taken]
        return next((index for index in free if index in several), free[0])

    compared = chosen(RIVALS)
    along = chosen(ALONG_FIRST, compared)
    a, b = 0, min(1, len(axes_of(report)[compared].values) - 1)
    pair = report.compare or WHITE_PIXEL
    if compared == CAMERA and set(pair) <= set(report.cameras):
        a, b = (report.cameras.index(camera) for camera in pair)
    return Comparison(compared, along, chosen(ROWS_FIRST, compared, along), a, b)


def grid(report: ReportData) -> NDArray[np.object_]:
    """Return the cells as an array with one dimension per axis."""
    cells = np.empty(len(report.cells), dtype=object)
    cells[:] = report.cells
    return cells.reshape([len(axis.values) for axis in axes_of(report)])


def groups_of(report: ReportData, axis: int, a: int, b: int) -> list[Group]:
    """Return the groups in which two values of an axis other than the light level are compared."""
    axes = axes_of(report)
    levels = [level.name for level in report.levels]
    cells = np.moveaxis(grid(report), (axis, BRIGHTNESS), (0, -1)).reshape(len(axes[axis].values), -1, len(levels))
    groups = []
    for title, *both in zip(group_titles(report, axis), cells[a], cells[b], strict=True):
        sides = tuple(both[0]), tuple(both[1])
        pair = Pair(
            names=(axes[axis].values[a], axes[axis].values[b]),
            ours=_figures(sides[0]),
            theirs=_figures(sides[1]),
            levels=levels,
            light_cd_m2=[cell.luminance_cd_m2 for cell in sides[0]],
        )
        groups.append(Group(title, pair, *sides))
    return groups


def comparison_words(
    report: ReportData, axis: int, a: int, b: int
) -> list[tuple[Group, tuple[str, str, str, str, str]]]:
    """Return the groups of `groups_of`, each with the five sentences that the page says about it.

    They say which of the two is better, how much light that saves, whether a white balance is off by more than the
    lead, what the two have in common, and how RGBW compares with the best Bayer camera. A sentence may be empty.
    """
    groups = groups_of(report, axis, a, b)
    places = report.by_group if axis == CAMERA else [()] * len(groups)
    said = []
    for x, place in zip(groups, places, strict=True):
        balance = balance_words(x) if axis != BALANCE else ""
        said.append((x, (answer(x.pair), in_light(x.pair), balance, pair_words(x), best_words(x, place))))
    return said


def means_over_scenes(report: ReportData, groups: Sequence[Group]) -> list[Group]:
    """Return groups whose figures are means over scenes; they have no cells.

    Scenes that were drawn at random are averaged in groups of their own.
    """
    drawn = [scene.name.startswith(DRAWN) for scene in report.scenes]
    rest = len(groups) // len(report.scenes)
    means = []
    for words, kind in (("named", False), ("drawn", True)):
        members = [scene for scene, is_drawn in enumerate(drawn) if is_drawn == kind]
        for place in range(rest) if len(members) > 1 else ():
            pairs = [groups[scene * rest + place].pair for scene in members]
            ours, theirs = (
                {key: np.mean([getattr(pair, side)[key] for pair in pairs], axis=0) for key in pairs[0].ours}
                for side in ("ours", "theirs")
            )
            after = groups[place].title.removeprefix(report.scenes[0].name)
            means.append(
                Group(f"mean of {len(members)} {words} scenes{after}", replace(pairs[0], ours=ours, theirs=theirs))
            )
    return means


def _figures(cells: Sequence[ReportCell]) -> dict[str, NDArray[np.float64]]:
    """Return the figures of cells by metric, (level, seed); NaN for an unknown figure."""
    return {metric.key: np.array([cell.samples(metric.key) for cell in cells]) for metric in METRICS}


def group_titles(report: ReportData, axis: int) -> list[str]:
    """Return a title for each combination of the axes other than `axis` and the light level, in the groups' order.

    A title names the values of those axes that vary.
    """
    others = [other.values for at, other in enumerate(axes_of(report)) if at not in (axis, BRIGHTNESS)]
    return [
        ", ".join(value for value, values in zip(place, others, strict=True) if len(values) > 1)
        for place in product(*others)
    ]


def comparisons(report: ReportData) -> list[dict[str, Any]]:
    """Return for each axis what the page's script shows about any two of its values, i and j.

    Returns
    -------
    list of dict
        ``leads``, by "i j" with i < j and by metric: outcomes (their first letters), leads and half widths in all
        places along the other axes. For axes in `RIVALS` also: ``counts``, by "i j" and metric: how often the first is
        ahead, level and behind over the groups, where levels between which no difference is seen count once; ``means``,
        by "i j": for each mean over scenes its title and, by metric, the same as ``leads`` over light; ``answers``, by
        "a b": the words for each group.
    """
    cells = grid(report)
    metrics = shown_metrics(report.cells)
    by_axis = []
    for axis, length in enumerate(cells.shape):
        across: dict[str, Any] = {"leads": {}, "counts": {}, "means": {}, "answers": {}}
        sides = [_figures(tuple(part.ravel())) for part in np.moveaxis(cells, axis, 0)]
        for i, j in combinations(range(length), 2):
            across["leads"][f"{i} {j}"] = {
                metric.key: _flat(leads(metric, sides[i][metric.key], sides[j][metric.key])) for metric in metrics
            }
        for a, b in permutations(range(length), 2) if axis in RIVALS else ():
            compared = comparison_words(report, axis, a, b)
            key = f"{a} {b}"
            groups = [group for group, _ in compared]
            across["answers"][key] = [
                {"said": said, "light": light, "balance": balance, "times": " ".join(filter(None, further))}
                for _, (said, light, balance, *further) in compared
            ]
            if a < b:
                counted = [counts(x.pair.ours, x.pair.theirs) for x in groups]
                across["counts"][key] = {
                    metric.key: [sum(count[metric.key][outcome] for count in counted) for outcome in OUTCOMES]
                    for metric in metrics
                }
                across["means"][key] = [
                    {"title": mean.title} | {metric.key: _flat(mean.pair.leads[metric.key]) for metric in metrics}
                    for mean in means_over_scenes(report, groups)
                ]
        by_axis.append(across)
    return by_axis


def _flat(lead: Leads) -> list[Any]:
    """Return outcomes as letters, and leads and half widths rounded to seven digits; a page shows fewer."""
    numbers = (
        [float(f"{x:.7g}") if np.isfinite(x) else None for x in part.tolist()] for part in (lead.mean, lead.half)
    )
    return ["".join(outcome[0] for outcome in lead.outcome.tolist()), *numbers]


def shown_metrics(cells: Sequence[ReportCell]) -> list[Metric]:
    """Return the metrics that are known for at least one cell; those of targets are known only on their own scene."""
    return [metric for metric in METRICS if any(isfinite(cell.mean(metric.key)) for cell in cells)]


def comparison_markdown(report: ReportData, command: str, a: int) -> str:
    """Return a Markdown page that compares one value of the axis that the report compares first with all others.

    Parameters
    ----------
    report : ReportData
    command : str
        Command that makes the page.
    a : int
        Index of the value.
    """
    of = first_comparison(report)
    axis = axes_of(report)[of.compared]
    b = of.b if a == of.a else next(value for value in range(len(axis.values)) if value != a)
    words = [
        " ".join(filter(None, ("-", code(x.title) if x.title else "", said, light, balance, best)))
        for x, (said, light, balance, _, best) in comparison_words(report, of.compared, a, b)
    ]
    seeds = "1 seed" if len(report.seeds) == 1 else f"{len(report.seeds)} seeds"
    parts = [
        f"# {code(report.title)}",
        f"    {command}",
        f"rodcone {report.rodcone}, study {code(report.name)}, {seeds}. "
        f"{code(axis.values[a])} beside {code(axis.values[b])}:",
        "\n".join(words),
        f"Lead of {code(axis.values[a])}, half the 95 % interval over seeds after ±. **Bold**: behind by what a person "
        "sees. In brackets: less than that, or undecided. Last: light levels ahead, level, behind; equal light once.",
        *(lead_table(report, of.compared, a, metric) for metric in shown_metrics(report.cells)),
    ]
    return "\n\n".join(parts) + "\n"


def lead_table(report: ReportData, axis: int, a: int, metric: Metric) -> str:
    """Return a table of one value's leads over the others: a row per other value and condition, a column per level."""
    names = axes_of(report)[axis].values
    rows = []
    for other in (value for value in range(len(names)) if value != a):
        groups = groups_of(report, axis, a, other)
        counted = [counts(group.pair.ours, group.pair.theirs)[metric.key] for group in groups]
        last = " / ".join(str(sum(count[outcome] for count in counted)) for outcome in OUTCOMES)
        for group in (*groups, *means_over_scenes(report, groups)):
            title = f"{code(names[other])}, {code(group.title)}" if group.title else code(names[other])
            rows.append([title, *lead_cells(metric, group.pair.leads[metric.key]), last])
    unit = f" [{metric.unit}]" if metric.unit else ""
    return text.markdown_table(
        [f"{metric.name}{unit}", *(code(level.name) for level in report.levels), "counted"], rows
    )


def lead_cells(metric: Metric, lead: Leads) -> list[str]:
    """Write leads as cells of a table: a visible loss in bold, a lead that is invisible or undecided in brackets."""
    cells = []
    for mean, half, outcome in zip(lead.mean, lead.half, lead.outcome, strict=True):
        words = text.MISSING if isnan(mean) else text.lead_text(metric, float(mean))
        words += "" if isnan(half) else f" ± {text.fixed(float(half), metric.digits)}"
        cells.append({BEHIND: f"**{words}**", AHEAD: words}.get(str(outcome), f"({words})"))
    return cells


def code(words: str) -> str:
    """Write any name as Markdown's code, in which only the backtick and | have a meaning; they are replaced."""
    return "`" + " ".join(words.split()).replace("`", "'").replace("|", "\\|") + "`"
