"""Speed against error as one self-contained page: a chart and a table for each stage. It has no script."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import ceil, floor, log10
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup

from studies.pages import report_text as text
from studies.pages.charts import Point as Mark
from studies.pages.charts import Scale, Tick, decades, line_path, spread, tick_text
from studies.pages.report import TEMPLATES

WIDTH, HEIGHT = 540.0, 300.0
LEFT, RIGHT, TOP, BOTTOM = 64.0, 190.0, 30.0, 44.0
LABEL_GAP = 15.0


@dataclass(frozen=True)
class Place:
    """One choice in the chart: its mark, its name and where that stands, and whether it is on the front."""

    mark: Mark
    name: str
    label_y: float
    on_front: bool


@dataclass(frozen=True)
class Plane:
    """Error over time, both logarithmic, in SVG units."""

    x_ticks: tuple[Tick, ...]
    y_ticks: tuple[Tick, ...]
    places: tuple[Place, ...]
    front: str
    noise: Tick | None
    width: float = WIDTH
    height: float = HEIGHT
    left: float = LEFT
    right: float = WIDTH - RIGHT
    top: float = TOP
    bottom: float = HEIGHT - BOTTOM


def bench_page(results: Mapping[str, Any]) -> str:
    """HTML of a bench's results as `rodcone bench --json` prints them."""
    environment = Environment(
        loader=FileSystemLoader(TEMPLATES),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    style = (TEMPLATES / "report.css").read_text(encoding="utf-8")
    drawn = [(stage, plane(stage)) for stage in results["stages"]]
    page = environment.get_template("bench.html.j2")
    # The style is a file of this package, never input.
    return page.render(results=results, stages=drawn, text=text, style=Markup(style))


def plane(stage: Mapping[str, Any]) -> Plane:
    """Lay out one stage's chart; the reference itself, which has no error, stands in the table alone."""
    points = [point for point in stage["points"] if point["error_e"] > 0 and point["seconds"] > 0]
    across = _scale([point["seconds"] for point in points], LEFT, WIDTH - RIGHT)
    up = _scale([point["error_e"] for point in points], HEIGHT - BOTTOM, TOP)
    marks = [
        Mark(
            across.at(point["seconds"]),
            up.at(point["error_e"]),
            f"{point['choice']}: {text.duration(point['seconds'])}, {text.significant(point['error_e'])} e⁻",
        )
        for point in points
    ]
    labels = spread([mark.y for mark in marks], LABEL_GAP, TOP, HEIGHT - BOTTOM)
    places = tuple(
        Place(mark, point["choice"], round(y, 2), point["on_front"])
        for mark, point, y in zip(marks, points, labels, strict=True)
    )
    front = sorted((place.mark for place in places if place.on_front), key=lambda mark: mark.x)
    inside = up.low <= stage["noise_e"] <= up.high
    return Plane(
        x_ticks=_ticks(across),
        y_ticks=_ticks(up),
        places=places,
        front=line_path(front),
        noise=Tick(up.at(stage["noise_e"]), "the sensor's own noise") if inside else None,
    )


def _scale(values: Sequence[float], start: float, stop: float) -> Scale:
    """Decades that hold all values."""
    low, high = (min(values), max(values)) if values else (1.0, 10.0)
    first, last = floor(log10(low) + 1e-9), ceil(log10(high) - 1e-9)
    return Scale(10.0**first, 10.0 ** max(last, first + 1), start, stop, log=True)


def _ticks(scale: Scale) -> tuple[Tick, ...]:
    return tuple(Tick(scale.at(value), tick_text(value)) for value in decades(scale.low, scale.high))
