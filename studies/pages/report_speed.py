"""What each camera and each step costs in seconds, and how good the picture is for that."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import isfinite

from studies.pages import report_text as text
from studies.pages.report_data import ReportCell, ReportData


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


def speed_rows(report: ReportData) -> list[SpeedRow]:
    """Return for each sensor and camera the mean seconds of a picture's steps and its mean PSNR.

    PSNR is a mean over the conditions in which it is known for every camera of the sensor, so that all are compared on
    the same ones. Conditions that other variants or engines rendered or captured have rows of their own, whose sensor's
    name says so.
    """
    per_sensor = len(report.exposures) * len(report.balances) * len(report.levels)
    rows = []
    for slot, sensor in enumerate(report.sensors):
        parts: dict[str, list[Sequence[ReportCell]]] = {}
        for index, condition in enumerate(report.conditions):
            if index // per_sensor % len(report.sensors) == slot:
                parts.setdefault(_made_with(condition), []).append(condition)
        for way, conditions in parts.items():
            rows += _speed_of(text.plain_name(sensor.name) + (f", {way}" if len(parts) > 1 else ""), conditions)
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


def _mean(values: Sequence[float | None]) -> float | None:
    """Mean, unknown where one of the values is, or where there are none."""
    known = [value for value in values if value is not None]
    return sum(known) / len(known) if known and len(known) == len(values) else None
