"""The report's charts: quality over light, Monte Carlo share, and quality over the seconds that it costs."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import isfinite

from studies.budget.budget import MOST_SHARE
from studies.pages import report_text as text
from studies.pages.charts import Chart, ChartLine, line_chart
from studies.pages.report_data import ReportCell, ReportData

LEAST_S = 1e-4  # a step that takes less is drawn here: clocks tell no finer
SHARE = text.Metric("mc_share", "Monte Carlo share", 1, "", higher=False)


@dataclass(frozen=True)
class SpeedRow:
    """Mean seconds of a camera's steps for one sensor, its mean PSNR, and its lead over the fastest camera.

    `conditions` is the number that the means are over.
    """

    sensor: str
    camera: str
    capture_s: float | None
    develop_s: float | None
    psnr_db: float | None
    gain_db: float | None
    conditions: int


def shown_metrics(cells: Sequence[ReportCell]) -> list[text.Metric]:
    """Return the metrics that are known for some cell: those of targets are so on their own scene alone."""
    return [metric for metric in text.METRICS if any(cell.figures[metric.key] is not None for cell in cells)]


def group_charts(report: ReportData, metric: text.Metric) -> list[Chart]:
    """Return `metric` over luminance, one chart a group, all on one scale."""
    ends = [end for cell in report.cells for end in cell.intervals.get(metric.key, ())]
    share = metric is SHARE
    charts = []
    for own in report.by_group:
        known = [cell.luminance_cd_m2 for cell in own[:: len(report.cameras)]]
        stand_in = next((value for value in known if value is not None), 1.0)  # nothing is drawn at an unknown one
        names = [text.camera_name(camera) for camera in report.cameras]
        charts.append(
            line_chart(
                f"{metric.name}, {own[0].group}",
                f"{metric.name} over scene luminance for {', '.join(names)}. The table of all pictures holds the "
                "numbers.",
                [stand_in if value is None else value for value in known],
                [_line(report, own[slot :: len(names)], metric) for slot in range(len(names))],
                shared=[*(cell.figures[metric.key] for cell in report.cells), *ends],
                percent=share,
                rule=(MOST_SHARE, f"aim {text.percent(MOST_SHARE)}") if share else None,
            )
        )
    return charts


def _line(report: ReportData, cells: Sequence[ReportCell], metric: text.Metric) -> ChartLine:
    """Return one camera's values over the levels, in words too."""
    name = text.camera_name(cells[0].camera)
    values = [cell.figures[metric.key] for cell in cells]
    written = [text.percent(value) for value in values]
    if metric is not SHARE:
        written = [text.metric_text(metric, cell) for cell in cells]
    words = [f"{name}, {level.name}: {value}" for level, value in zip(report.levels, written, strict=True)]
    known = [cell.intervals.get(metric.key) for cell in cells]
    return ChartLine(name, values, words, known if any(known) else ())


def speed_rows(report: ReportData) -> list[SpeedRow]:
    """Return for each sensor and camera the mean seconds of a picture's steps and its mean PSNR.

    PSNR is a mean over the conditions in which it is known for every camera of the sensor, so that all are compared on
    the same ones. Conditions that other variants or engines rendered or captured have rows of their own, whose sensor's
    name says so.
    """
    per_sensor = len(report.exposures) * len(report.levels)
    rows = []
    for slot, sensor in enumerate(report.sensors):
        parts: dict[str, list[Sequence[ReportCell]]] = {}
        for index, condition in enumerate(report.conditions):
            if index // per_sensor % len(report.sensors) == slot:
                parts.setdefault(_made_with(condition), []).append(condition)
        for way, conditions in parts.items():
            rows += _speed_of(sensor.name + (f", {way}" if len(parts) > 1 else ""), conditions)
    return rows


def _made_with(condition: Sequence[ReportCell]) -> str:
    """Variant and engine of a condition's cells before development, in words."""
    first = next((cell.first for cell in condition if cell.first), None)
    return f"render {first.variant}, capture {first.readout_engine}" if first else "not made yet"


def _speed_of(sensor: str, conditions: Sequence[Sequence[ReportCell]]) -> list[SpeedRow]:
    """Rows of `speed_rows` for conditions with one cell of each camera."""
    psnrs = [[cell.figures["psnr_db"] for cell in condition] for condition in conditions]
    compared = [values for values in psnrs if all(value is not None and isfinite(value) for value in values)]
    made = []
    for slot, cell in enumerate(conditions[0]):
        firsts = [condition[slot].first for condition in conditions]
        capture_s = _mean([first.capture_s if first else None for first in firsts])
        develop_s = _mean([first.develop_s if first else None for first in firsts])
        made.append((cell.camera, capture_s, develop_s, _mean([values[slot] for values in compared])))
    fastest_db = min(made, key=lambda row: float("inf") if row[2] is None else row[2])[3]
    gains = [None if psnr_db is None or fastest_db is None else psnr_db - fastest_db for *_, psnr_db in made]
    return [SpeedRow(sensor, *row, gain, len(compared)) for row, gain in zip(made, gains, strict=True)]


def speed_charts(rows: Sequence[SpeedRow]) -> list[Chart]:
    """Return mean PSNR over the seconds of development, a chart a sensor, a mark a camera; none where unknown."""
    charts = []
    for sensor in dict.fromkeys(row.sensor for row in rows):
        own = [(row, row.develop_s) for row in rows if row.sensor == sensor and row.psnr_db is not None]
        known = [(row, seconds) for row, seconds in own if seconds is not None]
        if not known:
            continue
        words = [
            f"{text.camera_name(row.camera)}: {text.fixed(row.psnr_db, 1, 'dB')} in {text.duration(seconds)}"
            for row, seconds in known
        ]
        lines = []
        for slot, (row, _) in enumerate(known):
            values = [row.psnr_db if slot == index else None for index in range(len(known))]
            lines.append(ChartLine(text.camera_name(row.camera), values, [words[slot]] * len(known)))
        charts.append(
            line_chart(
                f"PSNR over development time, {sensor}",
                f"Mean PSNR over the seconds that a picture's development takes: {'; '.join(words)}.",
                [max(seconds, LEAST_S) for _, seconds in known],
                lines,
                shared=[row.psnr_db for row in rows],
                x_label="seconds to develop a picture",
            )
        )
    return charts


def _mean(values: Sequence[float | None]) -> float | None:
    """Mean, unknown where one of the values is, or where there are none."""
    known = [value for value in values if value is not None]
    return sum(known) / len(known) if known and len(known) == len(values) else None
