"""What a sweep's rows and its study tell of renders, levels, sensors and engines: parts of a report."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import fields, replace
from typing import Any

from render.loader import variant
from rodcone.errors import InputError
from rodcone.jit import backend
from scenes.levels import DEMO_LEVELS
from sensor.config import LensConfig
from sensor.optics import left_out
from sensor.presets import preset
from studies.pages.report_data import ReportLevel, ReportRender, ReportSensor
from studies.pages.report_text import level_text, with_signs
from studies.photograph.clock import machine
from studies.study.study import label
from studies.sweep.provenance import in_words, made_by, threads, versions
from studies.sweep.row import Row

NAMED = {level.name: ReportLevel(level.name, with_signs(level.source)) for level in DEMO_LEVELS}


def render_of(rows: Sequence[Row], scene: str) -> ReportRender:
    """Return how a scene was rendered; unknown where no cell of it is made yet."""
    first = next((row for row in rows if row.scene == scene), None)
    if first is None:
        return ReportRender(scene)
    names = {field.name for field in fields(ReportRender)}
    further = {name: fact for name, fact in _further(first).items() if name in names}
    return ReportRender(scene, first.spp, first.bands, first.render_s, first.variant, **further)


def render_notes(rows: Sequence[Row]) -> list[str]:
    """Return what had to be assumed of the renders, each once."""
    return list(dict.fromkeys(note for row in rows for note in _further(row).get("notes", ())))


def _further(row: Row) -> dict[str, Any]:
    """Facts of the render beside those with columns of their own."""
    facts: dict[str, Any] = json.loads(row.render)
    return facts


def level_of(text: str) -> ReportLevel:
    """Return a level as the study asks for it."""
    return NAMED.get(text) or ReportLevel(level_text(text), "asked for by the study")


def sensor_of(name: str) -> ReportSensor:
    """Return a sensor's numbers; none of a file that is no longer there."""
    try:
        return ReportSensor(label(name), preset(name))
    except InputError:
        return ReportSensor(label(name), None)


def environment() -> dict[str, Any]:
    """What makes numbers in this process, as JSON holds it: versions, engines and machine."""
    return {**versions(), "variant": variant(), "engine": backend(), "threads": threads(), "machine": machine()}


def environment_of(rows: Sequence[Row]) -> dict[str, str]:
    """Return what made the rows, whichever run did: versions, variants and engines, threads, machines."""
    environment: dict[str, dict[str, None]] = {}
    for row in rows:
        for name, value in {**in_words(made_by(row)), "threads": str(row.threads), "machine": row.machine}.items():
            environment.setdefault(name, {})[value] = None
    return {name: "; ".join(values) for name, values in environment.items()}


def lenses_left_out(rows: Sequence[Row], sensors: Sequence[str]) -> tuple[str, ...]:
    """Return what the lenses, as they were modelled, leave out, each once; of a sensor file that is gone nothing."""
    lines: list[str] = []
    for name, lens in dict.fromkeys((row.sensor, row.lens) for row in rows):
        try:
            sensor = preset(next(given for given in sensors if label(given) == name))
        except InputError:
            continue
        lines += left_out(replace(sensor, lens=LensConfig(**json.loads(lens))))
    return tuple(with_signs(line) for line in dict.fromkeys(lines))


def configuration(study: Mapping[str, Any]) -> dict[str, str]:
    """Return the study's tables as the report names them."""
    return {
        f"[{table}]": ", ".join(
            f"{name} = {'by default' if value is None else value}" for name, value in study[table].items()
        )
        for table in ("render", "lens", "budget")
    }
