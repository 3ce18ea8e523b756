"""Make the values and pictures that `studies.pages.report` shows from the rows and files of a sweep."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import replace
from importlib import metadata
from itertools import product
from math import prod
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from render.loader import variant
from rodcone.errors import InputError, require_keys, unknown
from rodcone.jit import backend
from scenes.levels import DEMO_LEVELS
from sensor.config import LensConfig
from sensor.exposure import AUTO_INFORMATION, RULES
from sensor.optics import left_out
from sensor.presets import preset
from studies.pages.report_compare import axes_of, first_comparison
from studies.pages.report_data import ReportCell, ReportData, ReportLevel, ReportRender, ReportScene, ReportSensor
from studies.pages.report_pictures import ReportPictures, busiest, opened, read_pictures, view_order
from studies.pages.report_text import exposure_name, level_text, way_name, with_signs
from studies.photograph.clock import machine
from studies.study.gain import gain_text
from studies.study.model import samples_a_side
from studies.study.study import OWN, label
from studies.sweep.database import LastRun, last_run
from studies.sweep.prepare import PICTURES
from studies.sweep.provenance import in_words, made_by, require_alike, threads, versions
from studies.sweep.row import AXES, Row
from studies.sweep.stored import read_whole

# Most pictures of the first seed in a page. A larger study is shown in part, because the page compares any two values
# of an axis in words.
MOST_CELLS = 1000


def sweep_report(
    folder: Path, most_pictures: int | None = None, where: Mapping[str, str] | None = None, run: LastRun | None = None
) -> tuple[ReportData, ReportPictures]:
    """Return the values and pictures of a sweep for `studies.pages.report.render_report`.

    Parameters
    ----------
    folder : Path
        Folder of the sweep.
    most_pictures : int, optional
        Most pictures besides the truths; left out, as many as a page may hold. The numbers are always those of all
        cells.
    where : mapping of str to str, optional
        Axes, and the one value of each that is shown. If more than `MOST_CELLS` pictures remain, only a part is shown,
        and a note says which.
    run : LastRun, optional
        Last run of the folder; left out, it is read.

    Raises
    ------
    InputError
        For an unknown axis or value, a results database that is missing or has another version, a last run that has
        made no cell yet, cells made by different versions, variants or engines, or a picture that is gone.
    """
    run = run or last_run(folder)
    rows = run.rows
    brightness = {row.level: row.luminance_cd_m2 for row in reversed(run.rows)}
    require_alike(rows)
    levels = sorted(run.study["levels"], key=lambda level: brightness.get(level, np.inf))
    study, thinned = shown_part({**run.study, "levels": levels, "ways": _ways(run.study)}, where or {})
    names = [label(choice["source"]) for choice in study["scenes"]]
    of_views = {(row.scene, row.spectrum): row.truth for row in rows}
    truths = [of_views.get(view) for view in product(names, study["spectra"])]
    cells = _cells(study, rows, names)
    true = {name: opened(read_whole(folder / PICTURES, name)) for name in dict.fromkeys(truths) if name}
    sizes = [_size(true.get(truths[index * len(study["spectra"])] or "")) for index in range(len(names))]
    missing = run.wanted - len(rows)
    unmade = [f"{missing} of {run.wanted} cells are not made yet: rodcone sweep goes on with them."] if missing else []
    data = ReportData(
        rodcone=metadata.version("rodcone"),
        name=study["name"],
        title=study.get("title") or study["name"],
        compare=tuple(study.get("compare", ())),
        scenes=tuple(ReportScene(name, *size) for name, size in zip(names, sizes, strict=True)),
        spectra=tuple(study["spectra"]),
        sensors=tuple(sensor_of(name) for name in study["sensors"]),
        exposures=tuple(way_name(*way) for way in study["ways"]),
        balances=tuple(study["white_balances"]),
        levels=tuple(NAMED.get(level) or ReportLevel(level_text(level), "") for level in study["levels"]),
        cameras=tuple(study["processors"]),
        seeds=tuple(study["seeds"]),
        cells=tuple(cells),
        truths=tuple(truths),
        renders=tuple(render_of(rows, name) for name in names),
        stages=run.stages,
        environment=environment_of(rows),
        configuration=configuration(run.study),
        exposure_rule=_exposure_rules(study),
        left_out=lenses_left_out(rows, study["sensors"]),
        notes=(*dict.fromkeys(note for row in rows for note in _further(row).get("notes", ())), *unmade, *thinned),
        denoised=study["render"]["denoise"],
        looked_at=next((busiest(truth) for truth in true.values()), (0, 0)),
    )
    order = view_order([len(axis.values) for axis in axes_of(data)], first_comparison(data))
    per_truth = len(cells) // len(truths)
    pairs = [(name, truth) for at in order if (name := cells[at].picture) and (truth := truths[at // per_truth])]
    pictures, left_out = read_pictures(folder, pairs, true, most_pictures)
    shown = [cell if cell.picture in pictures.files else replace(cell, picture=None) for cell in cells]
    return replace(data, cells=tuple(shown), pictures_left_out=left_out), pictures


def _cells(study: Mapping[str, Any], row_list: Sequence[Row], scenes: Sequence[str]) -> list[ReportCell]:
    """Return a cell for each combination of the study's axes; a cell that isn't made yet has None for its rows."""
    by_place = {
        (r.scene, r.spectrum, r.sensor, way, r.white_balance, r.level, r.processor, r.seed): r
        for r in row_list
        for way in [(r.exposure, r.frames, r.gain)]
    }
    light = {(r.scene, r.spectrum, r.level): (r.luminance_cd_m2, r.illuminance_lux) for r in row_list}
    levels = study["levels"]
    sensors = [label(name) for name in study["sensors"]]
    axes = (study["spectra"], sensors, study["ways"], study["white_balances"], levels, study["processors"])
    cells = []
    for place in product(scenes, *axes):
        scene, spectrum, *_, level, camera = place
        rows = tuple(by_place.get((*place, seed)) for seed in study["seeds"])
        picture = rows[0].picture if rows[0] else None
        luminance_cd_m2, illuminance_lux = light.get((scene, spectrum, level), (None, None))
        cells.append(ReportCell(levels.index(level), camera, luminance_cd_m2, illuminance_lux, rows, picture))
    return cells


def shown_part(study: Mapping[str, Any], where: Mapping[str, str]) -> tuple[dict[str, Any], list[str]]:
    """Return a study with those values of each axis that a page shows, and a note that says what it leaves out.

    As long as more than `MOST_CELLS` pictures are left, every second value of the longest axis is dropped, but not its
    first. The axis of cameras counts with a third of its length, because a reader compares cameras.

    Parameters
    ----------
    study : mapping
        Study as the results database stores it, with exposures, frames and gains combined as ``ways``.
    where : mapping of str to str
        Axes, and the one value of each that is shown.
    """
    require_keys("axis", where, AXES)
    part = dict(study)
    for axis, wanted in where.items():
        name, at = _PLACES[axis]
        kept = [value for value in part[name] if _value(value, axis, at) == wanted]
        if not kept:
            values = dict.fromkeys(_value(value, axis, at) for value in part[name])
            raise unknown(f"where: {axis}", wanted, list(values))
        part[name] = kept
    while prod(len(part[name]) for name in _SHOWN) > MOST_CELLS:
        longest = max(_SHOWN, key=lambda name: len(part[name]) / (3 if name == "processors" else 1))
        part[longest] = part[longest][::2]
    before, after = (prod(len(of[name]) for name in _SHOWN) for of in (study, part))
    if after == before:
        return part, []
    lengths = [
        f"{len(part[name])} of {len(study[name])} {_SHOWN[name]}" for name in _SHOWN if part[name] != study[name]
    ]
    return part, [
        f"This page shows {after} of {before} pictures: {', '.join(lengths)}. Another part: rodcone report FOLDER "
        "--where AXIS=VALUE; all numbers: rodcone export FOLDER -o rows.csv."
    ]


# Axes of a study of which a page may show only some values, with their names in words. Then, for each axis of a row,
# the axis of the study that holds it, and its index if the values of that axis are tuples.
_SHOWN = {
    "scenes": "scenes",
    "spectra": "lights",
    "sensors": "sensors",
    "ways": "exposures, frames and gains",
    "white_balances": "white balances",
    "levels": "levels",
    "processors": "processors",
}
_PLACES: dict[str, tuple[str, int | None]] = {
    "scene": ("scenes", None),
    "spectrum": ("spectra", None),
    "level": ("levels", None),
    "exposure": ("ways", 0),
    "sensor": ("sensors", None),
    "white_balance": ("white_balances", None),
    "frames": ("ways", 1),
    "gain": ("ways", 2),
    "processor": ("processors", None),
}


def _value(value: Any, axis: str, at: int | None) -> str:
    """Return a value of a study's axis as its rows write it."""
    if axis == "scene":
        return label(value["source"])
    return label(value) if at is None else str(value[at])


def _ways(study: Mapping[str, Any]) -> list[tuple[str, int, str]]:
    """Return all combinations of exposure, number of frames and gain; the report lists each as one exposure."""
    gains = [gain_text(gain, None) for gain in study["gains"]] + [gain_text(None, iso) for iso in study["isos"]]
    return list(product(study["exposures"], study["frames"], gains or [OWN]))


def _exposure_rules(study: Mapping[str, Any]) -> str:
    rules = [rule for rule in study["exposures"] if rule in RULES] or [AUTO_INFORMATION]
    words = "; ".join((f"{exposure_name(rule)}: " if len(rules) > 1 else "") + RULES[rule] for rule in rules)
    return f"{words}, never longer than {study['longest_exposure_s'] * 1e3:g} ms"


def _size(truth: NDArray[np.uint8] | None) -> tuple[int, int]:
    """Return the height and width of a picture, or 1 and 1 if it isn't made yet."""
    return (1, 1) if truth is None else (truth.shape[0], truth.shape[1])


NAMED = {level.name: ReportLevel(level.name, with_signs(level.source)) for level in DEMO_LEVELS}


def render_of(rows: Sequence[Row], scene: str) -> ReportRender:
    """Return how a scene was rendered; all facts are unknown until a cell of it is made."""
    first = next((row for row in rows if row.scene == scene), None)
    if first is None:
        return ReportRender(scene)
    further = {name: _further(first)[name] for name in ("integrator", "stopped_by", "relative_mc_error")}
    return ReportRender(scene, first.spp, first.bands, first.render_s, **further)


def _further(row: Row) -> dict[str, Any]:
    """Return those facts of the render that have no column of their own."""
    facts: dict[str, Any] = json.loads(row.render)
    return facts


def sensor_of(name: str) -> ReportSensor:
    """Return a sensor's numbers; None in their place for a file that is no longer there."""
    try:
        return ReportSensor(label(name), preset(name))
    except InputError:
        return ReportSensor(label(name), None)


def environment() -> dict[str, Any]:
    """Return what makes numbers in this process as values for JSON: versions, engines and machine."""
    return {**versions(), "variant": variant(), "engine": backend(), "threads": threads(), "machine": machine()}


def environment_of(rows: Sequence[Row]) -> dict[str, str]:
    """Return the versions, variants, engines, threads and machines that made the rows, over all runs."""
    environment: dict[str, dict[str, None]] = {}
    for row in rows:
        for name, value in {**in_words(made_by(row)), "threads": str(row.threads), "machine": row.machine}.items():
            environment.setdefault(name, {})[value] = None
    return {name: "; ".join(values) for name, values in environment.items()}


def lenses_left_out(rows: Sequence[Row], sensors: Sequence[str]) -> tuple[str, ...]:
    """Return what the lenses as modelled leave out, each effect once, and nothing for a sensor file that is gone."""
    lines: list[str] = []
    for scene, name, lens in dict.fromkeys((row.scene, row.sensor, row.lens) for row in rows):
        try:
            sensor = preset(next(given for given in sensors if label(given) == name))
        except InputError:
            continue
        sensor = replace(sensor, lens=LensConfig(**json.loads(lens)))
        lines += left_out(sensor, samples_a_side(scene, [sensor]))
    return tuple(with_signs(line) for line in dict.fromkeys(lines))


def configuration(study: Mapping[str, Any]) -> dict[str, str]:
    """Return the study's tables as the report names them."""
    return {
        f"[{table}]": ", ".join(
            f"{name} = {'by default' if value is None else value}" for name, value in study[table].items()
        )
        for table in ("render", "lens", "budget")
    }
