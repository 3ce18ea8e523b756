"""What a ledger's rows and its study tell of renders, levels, sensors and time: parts of a report's results."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from rodcone.errors import InputError
from sensor.config import LensConfig
from sensor.optics import left_out
from sensor.presets import preset
from studies.pages.report_text import significant
from studies.pages.results import sensor_facts
from studies.study.levels import NAMED, parse_level
from studies.study.study import label
from studies.sweep.provenance import made_by, told
from studies.sweep.row import Row


def render_of(rows: Sequence[Row], scene: str) -> dict[str, Any]:
    """Return what is known of a scene's render; unknown where no cell of it is made yet."""
    first = next((row for row in rows if row.scene == scene), None)
    known = {
        "scene": scene,
        "spp": first and first.spp,
        "bands": first and first.bands,
        "seconds": first and first.render_s,
    }
    return known if first is None else known | {"variant": first.variant} | json.loads(first.render)


def level_of(text: str) -> dict[str, Any]:
    """Return a level as the study asks for it; what it is in the other unit depends on the scene."""
    value, unit = parse_level(text)
    if text in NAMED:
        return vars(NAMED[text]) | {"illuminance_lux": None}
    return {
        "name": significant(value, unit.replace("2", "²")),
        "luminance_cd_m2": value if unit == "cd/m2" else None,
        "illuminance_lux": value if unit == "lux" else None,
        "source": "asked for by the study",
    }


def sensor_of(name: str) -> dict[str, Any]:
    """Return the numbers of a sensor; unknown for a file that is no longer there."""
    try:
        return sensor_facts(name) | {"name": label(name)}
    except InputError:
        keys = ("read_noise_e", "dsnu_e", "full_well_e", "prnu", "pitch_um", "f_number", "bits")
        return {"name": label(name), **dict.fromkeys(keys)}


def environment_of(rows: Sequence[Row]) -> dict[str, str]:
    """Return what made the rows, whichever run did: versions, variants and engines, threads, machines."""
    found: dict[str, dict[str, None]] = {}
    for row in rows:
        for name, value in {**told(made_by(row)), "threads": str(row.threads), "machine": row.machine}.items():
            found.setdefault(name, {})[value] = None
    return {name: "; ".join(values) for name, values in found.items()}


def lenses_left_out(rows: Sequence[Row], sensors: Sequence[str]) -> list[str]:
    """Return what the lenses, as they were modelled, leave out, each once; of a sensor file that is gone nothing."""
    lines: list[str] = []
    for name, lens in dict.fromkeys((row.sensor, row.lens) for row in rows):
        try:
            sensor = preset(next(given for given in sensors if label(given) == name))
        except InputError:
            continue
        lines += left_out(replace(sensor, lens=LensConfig(**json.loads(lens))))
    return list(dict.fromkeys(lines))


def configuration(study: Mapping[str, Any]) -> dict[str, str]:
    """Return the study's tables as the report names them."""
    return {
        f"[{table}]": ", ".join(
            f"{name} = {'by default' if value is None else value}" for name, value in study[table].items()
        )
        for table in ("render", "lens", "budget")
    }
