"""Messages between program and page: the first one, which describes the program, and the checks of each question.

Sensor files that are dropped on the page are stored in a folder of their own, with the tables that they name.
"""

import json
import re
from collections.abc import Iterable, Mapping, Sequence
from importlib.util import find_spec
from pathlib import Path
from types import MappingProxyType
from typing import Any, TypeAlias

import numpy as np

from isp.processors.catalogue import PROCESSORS, libraries
from render.illuminants import illuminant_names as illuminants
from rodcone.curve_file import ENDINGS
from rodcone.errors import InputError, read_errors, require_keys, require_name, require_whole
from rodcone.toml_file import parse_toml
from scenes.levels import DEMO_LEVELS
from sensor.config import SensorConfig
from sensor.config_file import OF_TABLES
from sensor.exposure import RULES
from sensor.lens.table import read_lens, shipped
from sensor.photodiodes import with_gain
from sensor.presets import preset, tile_named
from sensor.presets import preset_names as sensors
from studies.explore.controls import ADJUSTABLE, LENS, OF_TABLE, PIXEL, SETTINGS, TIME, Controls, mosaics_of, to_json
from studies.explore.slow import is_slow
from studies.explore.source import Source
from studies.explore.views import VIEWS, Bytes
from studies.study.gain import iso_speed
from studies.study.name_texts import texts_of
from studies.study.study import WHITE_BALANCES

Header: TypeAlias = dict[str, Any]

MOST_CHARACTERS = 200_000  # most characters of a message; three tables of spectra fit into it
MOST_OF_A_PAGE = 40  # most characters of a page's name
# Keys that each kind of message has, besides `kind`, `number` and, if pages share a connection, `page`. Kinds that come
# earlier in this mapping are answered first.
KINDS: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        "hello": (),
        "cancel": (),
        "scene": ("name",),
        "sensor": ("files",),
        "show": ("cameras", "views"),
        "pixel": ("cameras", "row", "column"),
        "histogram": ("cameras",),
        "dng": ("cameras",),
    }
)


def first_message(source: Source, scenes: Iterable[str] = (), dropped: Iterable[str] = ()) -> Header:
    """Return all that the page builds its controls from.

    `scenes` are those that the user may choose, `dropped` the sensor files that were dropped on the page.
    """
    named = dict.fromkeys((*sensors(), *dropped))
    return {
        "title": source.title,
        "controls": to_json(Controls()),
        "groups": source.groups,
        "illuminants": list(illuminants()),
        "rules": [*RULES, TIME],
        "white_balances": list(WHITE_BALANCES),
        "levels": {level.name: float(f"{level.luminance_cd_m2:.4g}") for level in DEMO_LEVELS},
        "scenes": list(scenes),
        "lenses": {name: lens_terms(name) for name in shipped()},
        "sensors": {name: sensor_terms(preset(name)) for name in named},
        "processors": {
            name: {
                "mosaics": list(mosaics_of(processor)),
                "slow": is_slow(name),
                "source": processor.source,
                "settings": {key: getattr(ADJUSTABLE[name], key) for key in SETTINGS} if name in ADJUSTABLE else {},
            }
            for name, processor in PROCESSORS.items()
            if not _missing(name)
        },
        "mosaics": _mosaics(),
        "views": list(VIEWS),
        "assumed": list(source.notes),
    }


def lens_terms(name: str) -> Header:
    """Return a shipped lens's name and f-number as the page shows them, and the sliders that the page then hides."""
    table = read_lens(name)
    return {"text": f"{name.replace('_', ' ')}, f/{table.f_number:.3g}", "states": list(OF_TABLE)}


def sensor_terms(sensor: SensorConfig) -> Header:
    """Return the terms of a sensor at which the page's sliders begin."""
    return {
        "lens": {term: getattr(sensor.lens, term) for term in LENS},
        "pixel": {term: getattr(sensor.pixel, term) for term in PIXEL},
        "bits": sensor.bits,
        "gain": sensor.gain,
        "row_time_us": sensor.row_time_us,
        "iso": iso_speed(with_gain(sensor, 1.0)),
        "tile": list(sensor.cfa),
    }


def _mosaics() -> Header:
    """Return the tile of each mosaic by name, with a sentence on it."""
    return {name: {"tile": list(tile_named(name)), "text": text} for name, text in texts_of("mosaics").items()}


def _missing(processor: str) -> bool:
    """Return whether a processor needs a library that isn't installed."""
    return any(find_spec(library) is None for library in libraries(processor))


def unsent(pictures: Sequence[Bytes], sent: list[Bytes]) -> list[bytes]:
    """Return pictures as bytes, empty for one that the page has already.

    `sent` holds the pictures that were sent last, and is updated.
    """
    repeats = [len(sent) > place and np.array_equal(sent[place], picture) for place, picture in enumerate(pictures)]
    sent[:] = pictures
    return [b"" if same else picture.tobytes() for same, picture in zip(repeats, pictures, strict=True)]


def read_message(text: str) -> Header:
    """Parse a message, and check its kind, its keys and its number."""
    if len(text) > MOST_CHARACTERS:
        raise InputError(f"message: {len(text)} characters; allowed: {MOST_CHARACTERS}; send a shorter table")
    try:
        message = json.loads(text, parse_constant=_refuse)
    except (ValueError, RecursionError):
        raise InputError("message: it is no JSON; allowed: an object; send one") from None
    if not isinstance(message, dict) or not isinstance(message.get("kind"), str):
        raise InputError("message: it has no kind; allowed: an object with a kind; send one")
    require_name("message: kind", message["kind"], KINDS)
    keys = ("kind", "number", *KINDS[message["kind"]])
    require_keys("message", message, (*keys, "page"))
    page = message.get("page", "")
    if not isinstance(page, str) or len(page) > MOST_OF_A_PAGE:
        raise InputError(f"page: it is no short text; allowed: {MOST_OF_A_PAGE} characters; draw a name at random")
    if set(keys) - message.keys():
        raise InputError(f"message: {sorted(set(keys) - message.keys())[0]!r} is missing; add it")
    require_whole("number", message["number"], 0, 2**53, "count requests")
    cameras = message.get("cameras", [{}])
    if not isinstance(cameras, list) or not 1 <= len(cameras) <= 2:
        raise InputError("cameras: they are no list of one or two; send one or two")
    return message


def is_superseded_by(message: Header, pending: Header) -> bool:
    """Return whether a pending message is answered before this one.

    That is so if the pending one is newer and of the same kind, or if its kind comes earlier in `KINDS`.
    """
    if pending["kind"] == message["kind"]:
        return bool(pending["number"] > message["number"])
    kinds = list(KINDS)
    return kinds.index(pending["kind"]) < kinds.index(message["kind"])


def _refuse(constant: str) -> None:
    raise ValueError(constant)


def read_views(value: object, cameras: int) -> list[tuple[int, str]]:
    """Check the views of a message; return the number of the camera and the name of each."""
    pairs = value if isinstance(value, list) and 1 <= len(value) <= 4 else [value]
    views = []
    for pair in pairs:
        camera, view = pair if isinstance(pair, list) and len(pair) == 2 else (None, None)
        if type(camera) is not int or camera not in range(cameras) or not isinstance(view, str) or view not in VIEWS:
            raise InputError(f"views: {pair!r} is not allowed; give up to four of [camera, view], cameras from 0")
        views.append((camera, view))
    return views


MOST_FILES, MOST_DROPS = 8, 100
_NAME = re.compile(rf"\w[\w .+-]{{0,99}}\.(toml|{'|'.join(x[1:] for x in ENDINGS)})", re.IGNORECASE)


def write_dropped(files: object, drops: Path) -> tuple[Path, SensorConfig]:
    """Write a sensor's ``.toml`` and its tables of curves into a folder below `drops`; return the sensor and its path.

    Raises
    ------
    InputError
        For other files, too many files, a table that wasn't dropped with its sensor, or a file that describes no
        camera.
    """
    if not isinstance(files, dict) or not 1 <= len(files) <= MOST_FILES:
        raise InputError(
            f"sensor: no files by name; allowed: a .toml and the tables of curves that it names, {MOST_FILES}"
        )
    for name, text in files.items():
        if not _NAME.fullmatch(name) or not isinstance(text, str):
            raise InputError(
                f"sensor: {name!r} is not taken; allowed: text, .toml or tables by a plain name; rename it"
            )
    sensors = [name for name in files if name.lower().endswith(".toml")]
    if len(sensors) != 1:
        raise InputError(f"sensor: {len(sensors)} .toml files; allowed: one, with the tables that it names")
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
    """Refuse a sensor whose tables weren't dropped with it, because a message may not make the program read others."""
    with read_errors(f"sensor: {name!r} is no TOML", "correct it"):
        responses = parse_toml(files[name]).get("responses", {})
    named = [responses.get(key) for key in OF_TABLES] if isinstance(responses, dict) else []
    missing = [table for table in named if isinstance(table, str) and table not in (*files, "included", "relative")]
    if missing:
        raise InputError(f"sensor: {name!r} names {missing[0]!r}; allowed: files beside it; drop both together")
