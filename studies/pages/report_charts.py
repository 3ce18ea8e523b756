"""The report's charts: quality over light, Monte Carlo share, and quality over the seconds that it costs."""

from collections.abc import Mapping, Sequence
from math import isfinite
from typing import Any

from rodcone.errors import require_range
from studies.pages import report_text as text
from studies.pages.charts import Chart, Line, line_chart
from studies.pages.report_cells import groups

Cells = Sequence[Mapping[str, Any]]
LEAST_S = 1e-4  # a step that takes less is drawn here: clocks tell no finer


def shown_metrics(cells: Cells) -> list[text.Metric]:
    """Return the metrics that are known for some cell: those of targets are so on their own scene alone."""
    return [metric for metric in text.METRICS if any(cell[metric.key] is not None for cell in cells)]


def by_group(results: Mapping[str, Any], cells: Cells) -> list[Cells]:
    """Part the cells, which come in order, into one list for each group."""
    count = len(results["levels"]) * len(results["cameras"])
    return [cells[start : start + count] for start in range(0, len(cells), count)]


def group_charts(results: Mapping[str, Any], cells: Cells, metric: text.Metric, **options: Any) -> list[Chart]:
    """Return `metric` over luminance, one chart a group, all on one scale."""
    ends = [end for cell in cells for end in cell["intervals"].get(metric.key, ())]
    charts = []
    for group, own in zip(groups(results), by_group(results, cells), strict=True):
        known = [cell["luminance_cd_m2"] for cell in own[:: len(results["cameras"])]]
        stand_in = next((value for value in known if value is not None), 1.0)  # nothing is drawn at an unknown one
        luminance = [stand_in if value is None else value for value in known]
        for value in luminance:
            require_range("luminance_cd_m2", value, 1e-12, 1e12, "the axis is logarithmic: give a positive luminance")
        lines = [_line(results, own, camera, metric, options.get("percent", False)) for camera in results["cameras"]]
        charts.append(
            line_chart(
                f"{metric.name}, {group}",
                f"{metric.name} over scene luminance for {text.join([line.name for line in lines])}. "
                "The table of all pictures holds the numbers.",
                luminance,
                lines,
                shared=[*(cell[metric.key] for cell in cells), *ends],
                **options,
            )
        )
    return charts


def _line(results: Mapping[str, Any], cells: Cells, camera: str, metric: text.Metric, percent: bool) -> Line:
    """Return one camera's values over the levels, in words too."""
    own = [cell for cell in cells if cell["camera"] == camera]
    name = text.camera_name(camera)
    written = [text.percent(cell[metric.key]) if percent else text.metric_text(metric, cell) for cell in own]
    words = [f"{name}, {level['name']}: {value}" for level, value in zip(results["levels"], written, strict=True)]
    known = [cell["intervals"].get(metric.key) for cell in own]
    return Line(name, [cell[metric.key] for cell in own], words, known if any(known) else ())


def speed_rows(results: Mapping[str, Any], cells: Cells) -> list[dict[str, Any]]:
    """Return for each sensor and camera the mean seconds of a picture's steps and its mean PSNR, as numbers.

    PSNR is a mean over the conditions in which it is known for every camera of the sensor, so that all are judged on
    the same ones; ``gain_db`` is its lead over the camera that develops fastest. Conditions that other variants or
    engines rendered or captured have rows of their own, whose sensor's name says so.
    """
    rows = []
    for sensor in results["sensors"]:
        own = [[x for x in cells if (x["sensor"], x["camera"]) == (sensor["name"], c)] for c in results["cameras"]]
        parts: dict[str, list[Cells]] = {}
        for same in zip(*own, strict=True):
            parts.setdefault(_made_with(same), []).append(same)
        for way, conditions in parts.items():
            rows += _speed_of(sensor["name"] + (f", {way}" if len(parts) > 1 else ""), conditions)
    return rows


def _made_with(condition: Cells) -> str:
    """Engines of a condition's cells before development, in words."""
    known: dict[str, str] = next((cell["engines"] for cell in condition if cell.get("engines")), {})
    return ", ".join(f"{step} {known[step]}" for step in ("render", "capture") if step in known) or "not made yet"


def _speed_of(sensor: str, conditions: Sequence[Cells]) -> list[dict[str, Any]]:
    """Rows of `speed_rows` for conditions with one cell of each camera."""
    judged = [c for c in conditions if all(x["psnr_db"] is not None and isfinite(x["psnr_db"]) for x in c)]
    made = []
    for slot, first in enumerate(conditions[0]):
        seconds = [condition[slot]["seconds"] or {} for condition in conditions]
        steps = {step: _mean([one.get(step) for one in seconds]) for step in ("capture", "develop")}
        psnr = _mean([condition[slot]["psnr_db"] for condition in judged])
        made.append({"sensor": sensor, "camera": first["camera"], "psnr_db": psnr, "judged": len(judged), **steps})
    fastest = min(made, key=lambda row: row["develop"] if row["develop"] is not None else float("inf"))
    known = fastest["psnr_db"]
    return [{**row, "gain_db": None if known is None else row["psnr_db"] - known} for row in made]


def speed_charts(rows: Sequence[Mapping[str, Any]]) -> list[Chart]:
    """Return mean PSNR over the seconds of development, a chart a sensor, a mark a camera; none where unknown."""
    charts = []
    for sensor in dict.fromkeys(row["sensor"] for row in rows):
        own = [row for row in rows if row["sensor"] == sensor and None not in (row["develop"], row["psnr_db"])]
        if not own:
            continue
        lines = [
            Line(
                text.camera_name(row["camera"]),
                [row["psnr_db"] if place == at else None for at in range(len(own))],
                [_speed_words(row)] * len(own),
            )
            for place, row in enumerate(own)
        ]
        charts.append(
            line_chart(
                f"PSNR over development time, {sensor}",
                f"Mean PSNR over the seconds that a picture's development takes: {'; '.join(map(_speed_words, own))}.",
                [max(row["develop"], LEAST_S) for row in own],
                lines,
                shared=[row["psnr_db"] for row in rows],
                x_label="seconds to develop a picture",
            )
        )
    return charts


def _speed_words(row: Mapping[str, Any]) -> str:
    camera, psnr = text.camera_name(row["camera"]), text.fixed(row["psnr_db"], 1, "dB")
    return f"{camera}: {psnr} in {text.duration(row['develop'])}"


def _mean(values: Sequence[float | None]) -> float | None:
    """Mean, unknown where one of the values is, or where there are none."""
    known = [value for value in values if value is not None]
    return sum(known) / len(known) if known and len(known) == len(values) else None
