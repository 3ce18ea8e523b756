"""The report of a sweep: its ledger's rows as the results that `report` takes, and the pictures to show."""

import json
from collections.abc import Iterator, Mapping, Sequence
from importlib import metadata
from io import BytesIO
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple

from PIL import Image

from rodcone.errors import InputError
from sensor.exposure import RULE
from studies.pages.report_cells import SCATTERED
from studies.pages.report_choice import chosen_conditions
from studies.pages.report_facts import configuration, environment_of, lenses_left_out, level_of, render_of, sensor_of
from studies.pages.results import DISPLAY_WHITE
from studies.study.study import label
from studies.sweep.database import FILE, last_study, read_ledger, rows
from studies.sweep.prepare import PICTURES
from studies.sweep.provenance import require_alike
from studies.sweep.row import Row
from studies.sweep.stored import read_whole

SHOWN_BYTES = 8e6  # of pictures in a page, where their number isn't given: some 11 MB of HTML, which any browser takes
_UNKNOWN = ("engines", "exposure_s", "balance", "mean_electrons", "seconds", "substitution", "budget_share", *SCATTERED)


class Ledger(NamedTuple):
    """What the last run of a sweep asked for, what there is of it, and the seconds by stage of all its runs."""

    study: dict[str, Any]
    stages: dict[str, float]
    wanted: int
    rows: list[Row]


def read_run(folder: Path) -> Ledger:
    """Read the last run of a sweep.

    Raises
    ------
    InputError
        Where there is no ledger, one of another version, or none of its cells is made yet, or they were made by
        different versions, variants or engines.
    """
    if not (folder / FILE).is_file():
        raise InputError(f"{folder}: it holds no {FILE}; allowed: the folder of a sweep; run rodcone sweep first")
    with read_ledger(folder) as base:
        found, wanted = rows(base), base.execute("SELECT count(*) FROM wanted").fetchone()[0]
        run = last_study(base)
    if not found or run is None:
        raise InputError(f"{folder}: its last run has made no cell yet; run rodcone sweep, which goes on")
    require_alike(found)
    return Ledger(*run, wanted, found)


def ledger_results(folder: Path, most_pictures: int | None = None) -> tuple[dict[str, Any], dict[str, bytes]]:
    """Results and pictures of a sweep, as `studies.pages.report.render_report` takes them.

    Parameters
    ----------
    folder : Path
        Of the sweep.
    most_pictures : int, optional
        Of all cameras together; left out, as many as have `SHOWN_BYTES`. The numbers are of all cells in any case.

    Raises
    ------
    InputError
        As `read_run`, and for a picture that is gone.
    """
    ledger = read_run(folder)
    study, cells = ledger.study, list(_cells(ledger))
    names = [label(choice["source"]) for choice in study["scenes"]]
    truths = _truths(ledger, names)
    pictures = {name: read_whole(folder / PICTURES, name) for name in truths if name is not None}
    sizes = {name: _size(pictures, truths[place * len(study["spectra"])]) for place, name in enumerate(names)}
    missing = ledger.wanted - len(ledger.rows)
    renders = [render_of(ledger.rows, name) for name in names]
    notes = [note for render in renders for note in render.get("notes", ())]
    if missing:
        notes.append(f"{missing} of {ledger.wanted} cells are not made yet: rodcone sweep goes on with them.")
    left = _choose(folder, cells, study, most_pictures)
    pictures |= {cell["picture"]: read_whole(folder / PICTURES, cell["picture"]) for cell in cells if cell["picture"]}
    results = {
        "rodcone": metadata.version("rodcone"),
        "name": study["name"],
        "seed": study["seeds"][0],
        "scene": names[0] if len(names) == 1 else f"{len(names)} scenes",
        "size": sizes[names[0]],
        "scenes": [{"name": name, "size": sizes[name]} for name in names],
        "spectra": study["spectra"],
        "exposures": study["exposures"],
        "truths": truths,
        "environment": environment_of(ledger.rows),
        "render": renders[0] if len(names) == 1 and "passes" in renders[0] else None,
        "renders": renders,
        "exposure_rule": RULE.format(longest=study["longest_exposure_s"] * 1e3),
        "display_white": DISPLAY_WHITE,
        "levels": [level_of(level) for level in study["levels"]],
        "sensors": [sensor_of(name) for name in study["sensors"]],
        "cameras": study["processors"],
        "cells": cells,
        "stages": [{"name": name, "seconds": seconds} for name, seconds in ledger.stages.items()],
        "left_out": lenses_left_out(ledger.rows, study["sensors"]),
        "notes": list(dict.fromkeys(notes)),
        "pictures_left_out": left,
        "configuration": configuration(study),
    }
    return results, pictures


def _cells(ledger: Ledger) -> Iterator[dict[str, Any]]:
    """A cell for each combination that was asked for; one that isn't made yet has no figure."""
    study = ledger.study
    axes = (study["spectra"], study["levels"], study["exposures"])
    found = {(r.scene, r.spectrum, r.level, r.exposure, r.sensor, r.processor, r.seed): r for r in ledger.rows}
    light = {
        (r.scene, r.spectrum, r.level): {"luminance_cd_m2": r.luminance_cd_m2, "illuminance_lux": r.illuminance_lux}
        for r in ledger.rows
    }
    for choice, spectrum, level, exposure, sensor, camera, seed in product(
        study["scenes"], *axes, study["sensors"], study["processors"], study["seeds"]
    ):
        row = found.get((label(choice["source"]), spectrum, level, exposure, label(sensor), camera, seed))
        yield {
            "scene": label(choice["source"]),
            "spectrum": spectrum,
            "level": study["levels"].index(level),
            "exposure": exposure,
            "sensor": label(sensor),
            "camera": camera,
            "seed": seed,
            **light.get((label(choice["source"]), spectrum, level), {}),
            **(dict.fromkeys(_UNKNOWN) | {"picture": None} if row is None else _figures(row)),
        }


def _figures(row: Row) -> dict[str, Any]:
    return {
        **{name: getattr(row, name) for name in (*SCATTERED, "exposure_s", "budget_share", "picture")},
        "substitution": None if row.substitution is None else bool(row.substitution),
        "balance": json.loads(row.balance),
        "mean_electrons": json.loads(row.mean_electrons),
        "engines": {"render": row.variant, "capture": row.readout_engine, "develop": row.development_engine},
        "seconds": {"capture": row.capture_s, "develop": row.develop_s, "measure": row.measure_s},
        "file": f"{PICTURES}/{row.picture}",
    }


def _truths(ledger: Ledger, names: Sequence[str]) -> list[str | None]:
    """File of each scene's truth under each spectrum; None where no cell of it is made yet."""
    found = {(row.scene, row.spectrum): row.truth for row in ledger.rows}
    return [found.get(view) for view in product(names, ledger.study["spectra"])]


def _size(pictures: Mapping[str, bytes], name: str | None) -> list[int]:
    """Height and width of a picture; of one not made yet 1 each."""
    if name is None:
        return [1, 1]
    with Image.open(BytesIO(pictures[name])) as picture:
        return [picture.height, picture.width]


def _choose(folder: Path, cells: Sequence[dict[str, Any]], study: Mapping[str, Any], most: int | None) -> str:
    """Leave pictures out of the cells until `most` are left; says in words which."""
    cameras, levels = len(study["processors"]), len(study["levels"])
    first_seed = [cell for cell in cells if cell["seed"] == study["seeds"][0]]
    held = [cell["picture"] for cell in first_seed if cell["picture"]]
    if most is None:
        mean = sum((folder / PICTURES / name).stat().st_size for name in held) / len(held) if held else 1.0
        most = int(SHOWN_BYTES / mean)
    # In the report's order levels run within a group; in the study's the exposures and sensors run within a level.
    order = sorted(first_seed, key=lambda cell: _place(cell, study))
    conditions = [order[start : start + cameras] for start in range(0, len(order), cameras)]
    chosen = chosen_conditions(len(conditions), levels, max(most // cameras, 1))
    for place, condition in enumerate(conditions):
        for cell in condition:
            if place not in chosen:
                cell["picture"] = None
    for cell in cells:
        if cell["seed"] != study["seeds"][0]:
            cell["picture"] = None
    if len(chosen) == len(conditions):
        return ""
    return (
        f"To keep the page small, pictures of {len(chosen)} of {len(conditions)} conditions are in it, numbers of all; "
        "the others are files beside the ledger, and rodcone report --pictures N puts more into the page."
    )


def _place(cell: Mapping[str, Any], study: Mapping[str, Any]) -> tuple[int, ...]:
    """Place of a cell in the report's order."""
    axes = (
        [label(choice["source"]) for choice in study["scenes"]],
        study["spectra"],
        [label(name) for name in study["sensors"]],
        study["exposures"],
        list(range(len(study["levels"]))),
        study["processors"],
    )
    names = ("scene", "spectrum", "sensor", "exposure", "level", "camera")
    return tuple(axis.index(cell[name]) for name, axis in zip(names, axes, strict=True))
