"""Sensors' files that were dropped on the page, each with the tables that it names in a folder of its own."""

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from rodcone.errors import InputError, read_errors
from rodcone.toml_file import parse_toml
from sensor.config import SensorConfig
from sensor.presets import preset

MOST_FILES, MOST_DROPS = 8, 100
_NAME = re.compile(r"\w[\w .+-]{0,99}\.(toml|csv)", re.IGNORECASE)


def write_dropped(files: Any, drops: Path) -> tuple[Path, SensorConfig]:
    """Write a sensor's ``.toml`` and its ``.csv`` files, by name, below `drops`; give the sensor's path and content.

    Raises
    ------
    InputError
        For other files, a table that was not dropped with the sensor, a file that describes no camera, or too many.
    """
    if not isinstance(files, dict) or not 1 <= len(files) <= MOST_FILES:
        raise InputError(f"sensor: no files by name; allowed: a .toml and the .csv files that it names, {MOST_FILES}")
    for name, text in files.items():
        if not _NAME.fullmatch(name) or not isinstance(text, str):
            raise InputError(f"sensor: {name!r} is not taken; allowed: text, .toml or .csv by a plain name; rename it")
    sensors = [name for name in files if name.lower().endswith(".toml")]
    if len(sensors) != 1:
        raise InputError(f"sensor: {len(sensors)} .toml files; allowed: one, with the .csv files that it names")
    _check_tables(sensors[0], files)
    if (number := len(list(drops.iterdir()))) >= MOST_DROPS:
        raise InputError(f"sensor: {number} were dropped; allowed: {MOST_DROPS}; start rodcone explore again")
    folder = drops / str(number)
    folder.mkdir()
    for name, text in files.items():
        (folder / name).write_text(text, "utf-8")
    path = folder / sensors[0]
    try:
        return path, preset(path)
    except InputError as error:
        raise InputError(str(error).replace(str(path), sensors[0])) from None


def _check_tables(name: str, files: Mapping[str, str]) -> None:
    """Refuse a sensor that names files which did not come with it: a message may not make the program read others."""
    with read_errors(f"sensor: {name!r} is no TOML", "correct it"):
        responses = parse_toml(files[name]).get("responses", {})
    named = responses.values() if isinstance(responses, dict) else ()
    missing = [table for table in named if isinstance(table, str) and table not in (*files, "included", "relative")]
    if missing:
        raise InputError(f"sensor: {name!r} names {missing[0]!r}; allowed: files beside it; drop both together")
