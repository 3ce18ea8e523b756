"""The schemas agree with the readers: what one takes the other takes, and of a mistake both complain."""

import json
import tomllib
from copy import deepcopy
from pathlib import Path
from typing import Any

import pytest
from command_line import call

from rodcone.errors import InputError
from sensor.config_file import read_sensor
from sensor.presets import preset_file, preset_names
from studies.commands.schema import file_schema
from studies.study.study_file import EXAMPLES, read_study

jsonschema = pytest.importorskip("jsonschema", reason="needs jsonschema, which nbclient brings (extra dev)")

SENSORS = [Path(preset_file(name)) for name in preset_names()] + sorted((EXAMPLES / "sensors").glob("*.toml"))
STUDIES = sorted(EXAMPLES.glob("*.toml"))
# Way to a key, a wrong value; None takes a key away.
WRONG_SENSORS = [
    (("pixel", "pitch"), 2.2),
    (("pixel", "pitch_um"), None),
    (("pixel", "prnu"), 1.7),
    (("pixel", "full_well_e"), "15000"),
    (("window_nm",), [380.0]),
    (("binning",), "sum"),
    (("readout",), "both"),
    (("bits",), 12.5),
    (("temperature",), {"chip_c": 50.0, "measured_c": 20.0}),
    (("lens",), None),
    (("lens", "f_number"), None),  # and no table
]
WRONG_STUDIES = [
    (("level",), "1lux"),
    (("levels",), None),
    (("render", "spp"), 0),
    (("render", "size"), "small"),
    (("budget", "model"), "cheap"),
    (("trust_code",), True),
    (("frames",), [1.5]),
]


def changed(content: dict[str, Any], way: tuple[str, ...], value: Any) -> dict[str, Any]:
    result = deepcopy(content)
    table = result
    for step in way[:-1]:
        table = table.setdefault(step, {})
    if value is None:
        del table[way[-1]]
    else:
        table[way[-1]] = value
    return result


def complaints(kind: Any, content: dict[str, Any]) -> list[str]:
    return [each.message for each in jsonschema.Draft202012Validator(file_schema(kind)).iter_errors(content)]


@pytest.mark.parametrize(("kind", "files"), [("sensor", SENSORS), ("study", STUDIES)])
def test_every_file_that_comes_along_is_allowed(kind: str, files: list[Path]) -> None:
    jsonschema.Draft202012Validator.check_schema(file_schema(kind))  # type: ignore[arg-type]
    assert len(files) > 10
    wrong = {path.name: found for path in files if (found := complaints(kind, tomllib.loads(path.read_text("utf-8"))))}
    assert wrong == {}


def test_what_the_readers_refuse_the_schemas_refuse(tmp_path: Path) -> None:
    sensor = {
        "bits": 14,
        "pixel": tomllib.loads(Path(preset_file("low_noise")).read_text("utf-8"))["pixel"],
        "lens": {"f_number": 2.8},
    }
    study = {"scenes": ["still_life"], "levels": "1lux"}  # one value for a list of one
    for kind, good, cases, read in (
        ("sensor", sensor, WRONG_SENSORS, read_sensor),
        ("study", study, WRONG_STUDIES, read_study),
    ):
        path = tmp_path / f"{kind}.toml"
        path.write_text(as_toml(good), "utf-8")
        read(path)  # type: ignore[operator]
        assert complaints(kind, good) == []
        for way, value in cases:
            bad = changed(good, way, value)
            path.write_text(as_toml(bad), "utf-8")
            with pytest.raises(InputError):
                read(path)  # type: ignore[operator]
            assert complaints(kind, bad), f"{kind}: {'.'.join(way)} = {value}"


def as_toml(content: dict[str, Any]) -> str:
    plain = [f"{key} = {json.dumps(value)}" for key, value in content.items() if not isinstance(value, dict)]
    tables = [f"[{key}]\n{as_toml(value)}" for key, value in content.items() if isinstance(value, dict)]
    return "\n".join([*plain, *tables])


def test_the_command_prints_the_schema_or_writes_it(tmp_path: Path) -> None:
    code, out, _ = call(["schema", "sensor"])
    assert code == 0
    assert json.loads(out)["properties"]["pixel"]["properties"]["prnu"]["maximum"] == 1.0
    assert "share of the area" in json.loads(out)["properties"]["pixel"]["properties"]["fill_factor"]["description"]
    code, out, _ = call(["schema", "study", "--out", str(tmp_path / "study.schema.json")])
    assert (code, out.strip()) == (0, str(tmp_path / "study.schema.json"))
    assert json.loads((tmp_path / "study.schema.json").read_text("utf-8")) == file_schema("study")
