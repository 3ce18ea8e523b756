"""The command `rodcone schema`."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal, get_type_hints

from rodcone.files import check_place, require_ending, write_files
from sensor.config import LensConfig, SensorConfig
from sensor.config_file import SensorTable
from sensor.pixel import BINNINGS, MERGED, SWITCHED
from studies.study.json_schema import DIALECT, schema_of
from studies.study.study import AUTOMATIC, STARTING_POINTS, BudgetShares, SceneChoice, Study

Kind = Literal["sensor", "study"]
_TEXTS = {"type": "array", "items": {"type": "string"}}
_MOSAIC = {
    "anyOf": [{"type": "string"}, _TEXTS],
    "description": "A mosaic's name (rodcone list mosaics), or the rows of one tile.",
}


def schema(kind: Kind, /, *, out: Path | None = None) -> None:
    """Print the JSON Schema of sensor or study files, by which an editor completes keys and marks mistakes.

    Parameters
    ----------
    kind
        sensor or study.
    out
        File to write it to in place of printing it, ending in .json.
    """
    text = json.dumps(file_schema(kind), indent=2, ensure_ascii=False) + "\n"
    if out is None:
        print(text, end="")
        return
    require_ending(out, ".json")
    check_place(out)
    write_files({out: text})
    print(out)


def file_schema(kind: Kind) -> dict[str, Any]:
    """Return the schema of a kind of file, from the dataclasses that it is read into."""
    table = sensor_schema() if kind == "sensor" else study_schema()
    return {"$schema": DIALECT, "title": f"rodcone {kind} file", **table}


def sensor_schema() -> dict[str, Any]:
    """Return the schema of a sensor file.

    If a pixel is read several times, its readings state the noise; a lens by data states its own f-number.
    """
    stated = get_type_hints(SensorConfig)
    # Fields that the table leaves for the sensor to check have the types of the sensor's fields.
    levels = ("bits", "black_level_dn", "white_level_dn", "window_nm")
    named = (*levels, "gain", "converter_noise_dn", "gain_limit", "row_time_us")
    known: dict[Any, Mapping[str, Any]] = {
        (SensorTable, "cfa"): _MOSAIC,
        (LensConfig, "table_digest"): {},  # left out, because the reader of the file computes it
        (SensorTable, "binning"): {"enum": list(BINNINGS)},
        (SensorTable, "readout"): {"enum": [MERGED, SWITCHED]},
    }
    settings = {name: _setting(stated[name]) for name in named}
    known |= {(SensorTable, name): setting for name, setting in settings.items()}
    table = schema_of(SensorTable, known)
    pixel = table["properties"]["pixel"]
    of_readings = [name for name in pixel["required"] if name in ("read_noise_e", "dsnu_e", "full_well_e")]
    pixel["required"] = [name for name in pixel["required"] if name not in of_readings]
    table["anyOf"] = [{"required": ["readings"]}, {"properties": {"pixel": {"required": of_readings}}}]
    lens = table["properties"]["lens"]
    by_data = {"required": ["table"], "properties": {"table": {"minLength": 1}}}
    lens["anyOf"] = [{"required": lens.pop("required")}, by_data]
    return table


def _setting(kind: object) -> dict[str, Any]:
    """Return the schema of a plain type, as one field of a table."""
    if kind == tuple[float, float]:
        numbers: dict[str, Any] = {"type": "number"}
        return {"type": "array", "prefixItems": [numbers, numbers], "minItems": 2, "maxItems": 2}
    return {"type": "integer" if "int" in str(kind) else "number"}


def study_schema() -> dict[str, Any]:
    """Return the schema of a study file, in which one value may stand for a list of one."""
    scene = {"anyOf": [{"type": "string"}, schema_of(SceneChoice, {})]}
    known: dict[Any, Mapping[str, Any]] = {
        SceneChoice: scene,
        (Study, "trust_code"): {},  # left out, because no file may give this consent
        (BudgetShares, "model"): {"enum": [AUTOMATIC, *STARTING_POINTS]},
    }
    return schema_of(Study, known, single=True)
