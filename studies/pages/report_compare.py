"""Which two pictures a report sets against each other, and in which metrics the first is ahead, level or behind.

The page's script (templates/report_numbers.js) does the same sums for whatever else the reader chooses.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray
from scipy.stats import t as student

from studies.metrics.confidence import mean_with_confidence
from studies.pages import report_text as text
from studies.pages.report_data import ReportCell, ReportData

AHEAD, LEVEL, BEHIND, UNKNOWN = "ahead", "level", "behind", "unknown"
OUTCOMES = (AHEAD, LEVEL, BEHIND)
# The same method on both mosaics, the one with a white pixel first; and what the paper compares.
WHITE_PIXEL = ("ple_rgbw", "ple_bayer")
CONFIDENCE = 0.95
# Axes by their place in `ReportData.cells`, and in which order one is taken to compare or to part the charts by.
SCENE, LIGHT, SENSOR, EXPOSURE, BRIGHTNESS, CAMERA = range(6)
COMPARED_FIRST = (CAMERA, SENSOR, EXPOSURE, LIGHT, SCENE, BRIGHTNESS)
ALONG_FIRST = (BRIGHTNESS, EXPOSURE, SENSOR, LIGHT, SCENE, CAMERA)
ROWS_FIRST = (SENSOR, EXPOSURE, SCENE, LIGHT, CAMERA, BRIGHTNESS)


@dataclass(frozen=True)
class Axis:
    """What varies in a study, and its values as the page writes them."""

    name: str
    values: tuple[str, ...]


@dataclass(frozen=True)
class Comparison:
    """Value `a` of the axis `compared` against its value `b`, along another axis, in a row for each value of a third.

    Attributes
    ----------
    compared, along, rows : int
        Axes by their place. `along` may be of one value, and `rows` too: then there is one row.
    a, b : int
        Values by their place; equal where nothing varies.
    """

    compared: int
    along: int
    rows: int
    a: int
    b: int


@dataclass(frozen=True)
class Verdict:
    """How one picture does beside another in a metric.

    Attributes
    ----------
    outcome : str
        `AHEAD` or `BEHIND` where the 95 % interval of the lead is clear of 0, else `LEVEL`; `UNKNOWN` where there is
        no interval.
    lead : float or None
        Mean over seeds of each seed's difference, positive where the first is better.
    half : float or None
        Half the width of its interval.
    """

    outcome: str
    lead: float | None
    half: float | None


def axes_of(report: ReportData) -> tuple[Axis, ...]:
    """Return what varies, in the order of `ReportData.cells`."""
    return (
        Axis("Scene", tuple(scene.name for scene in report.scenes)),
        Axis("Light", tuple(text.spectrum_name(spectrum) for spectrum in report.spectra)),
        Axis("Sensor", tuple(text.plain_name(sensor.name) for sensor in report.sensors)),
        Axis("Exposure", tuple(text.exposure_name(exposure) for exposure in report.exposures)),
        Axis("Light level", tuple(level.name for level in report.levels)),
        Axis("Camera", tuple(text.camera_name(camera) for camera in report.cameras)),
    )


def first_comparison(report: ReportData) -> Comparison:
    """Choose what is compared before the reader does: cameras where there are several, else the next axis that varies.

    The same method on both mosaics comes first where the study holds it.
    """
    several = [index for index, axis in enumerate(axes_of(report)) if len(axis.values) > 1]

    def chosen(order: tuple[int, ...], *taken: int) -> int:
        free = [index for index in order if index not in taken]
        return next((index for index in free if index in several), free[0])

    compared = chosen(COMPARED_FIRST)
    along = chosen(ALONG_FIRST, compared)
    a, b = 0, min(1, len(axes_of(report)[compared].values) - 1)
    if compared == CAMERA and set(WHITE_PIXEL) <= set(report.cameras):
        a, b = (report.cameras.index(camera) for camera in WHITE_PIXEL)
    return Comparison(compared, along, chosen(ROWS_FIRST, compared, along), a, b)


def verdict(metric: text.Metric, cell: ReportCell, other: ReportCell) -> Verdict:
    """Say how a picture does beside another of the same seeds."""
    pairs = [one.by_seed.get(metric.key, ()) for one in (cell, other)]
    if not all(pairs):
        return Verdict(UNKNOWN, None, None)
    leads = (1 if metric.higher else -1) * (np.array(pairs[0]) - np.array(pairs[1]))
    if leads.size == 1:
        return Verdict(UNKNOWN, float(leads[0]), None)
    lead = mean_with_confidence(leads, CONFIDENCE)
    outcome = AHEAD if lead.low > 0 else BEHIND if lead.high < 0 else LEVEL
    return Verdict(outcome, lead.mean, (lead.high - lead.low) / 2)


def grid(report: ReportData) -> NDArray[np.object_]:
    """Return the cells as an array with a dimension for each axis."""
    cells = np.empty(len(report.cells), dtype=object)
    cells[:] = report.cells
    return cells.reshape([len(axis.values) for axis in axes_of(report)])


def pairs(report: ReportData, of: Comparison) -> Iterator[tuple[ReportCell, ReportCell]]:
    """Go through all conditions: the two cells that are compared in each."""
    cells = np.moveaxis(grid(report), of.compared, -1)
    for place in product(*map(range, cells.shape[:-1])):
        yield cells[(*place, of.a)], cells[(*place, of.b)]


def counts(report: ReportData, of: Comparison, metric: text.Metric) -> dict[str, int]:
    """Count the conditions by `Verdict.outcome`."""
    found = [verdict(metric, *pair).outcome for pair in pairs(report, of)]
    return {outcome: found.count(outcome) for outcome in (*OUTCOMES, UNKNOWN)}


def verdicts(report: ReportData, of: Comparison, metric: text.Metric, row: int) -> list[Verdict]:
    """Return the verdicts of a metric along the axis, in one row, of the first value of every other axis."""
    cells = grid(report)
    place = [0] * cells.ndim
    place[of.rows] = row
    found = []
    for position in range(cells.shape[of.along]):
        place[of.along] = position
        two = [cells[(*place[: of.compared], value, *place[of.compared + 1 :])] for value in (of.a, of.b)]
        found.append(verdict(metric, *two))
    return found


def student_t(seeds: int) -> float | None:
    """Quantile by which a mean's deviation becomes half its interval; None for one seed."""
    return float(student.isf((1 - CONFIDENCE) / 2, seeds - 1)) if seeds > 1 else None


def best(report: ReportData, metric: text.Metric) -> set[int]:
    """Return the cells, by place, that are ahead of every other camera in their condition."""
    count, found = len(report.cameras), set()
    for start in range(0, len(report.cells), count):
        cells = report.cells[start : start + count]
        for index, cell in enumerate(cells):
            others = [verdict(metric, cell, other).outcome for other in cells if other is not cell]
            if others and set(others) == {AHEAD}:
                found.add(start + index)
    return found
