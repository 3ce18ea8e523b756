"""The report of a sweep: its rows as the values that `report` shows, and the pictures."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from importlib import metadata
from io import BytesIO
from itertools import product
from pathlib import Path
from typing import Any

from PIL import Image

from rodcone.errors import InputError
from sensor.exposure import RULE
from studies.pages.report_cells import over_seeds
from studies.pages.report_choice import chosen_conditions
from studies.pages.report_data import ReportCell, ReportData, ReportScene
from studies.pages.report_facts import (
    configuration,
    environment_of,
    fallbacks,
    lenses_left_out,
    level_of,
    render_notes,
    render_of,
    sensor_of,
)
from studies.pages.report_text import group_names, view_names
from studies.pages.results import DISPLAY_WHITE
from studies.study.study import label
from studies.sweep.database import FILE, last_study, read_results, rows
from studies.sweep.prepare import PICTURES
from studies.sweep.provenance import require_alike
from studies.sweep.row import Row
from studies.sweep.stored import read_whole

SHOWN_BYTES = 8e6  # of pictures in a page, where their number isn't given: some 11 MB of HTML, which any browser takes


@dataclass(frozen=True)
class LastRun:
    """What the last run of a sweep asked for, how many cells that is, what is made of it, and the seconds by stage."""

    study: Mapping[str, Any]
    stages: Mapping[str, float]
    wanted: int
    rows: tuple[Row, ...]


def read_run(folder: Path) -> LastRun:
    """Read the last run of a sweep.

    Raises
    ------
    InputError
        Where there is no results database, one of another version, or none of its cells is made yet, or they were made
        by different versions, variants or engines.
    """
    if not (folder / FILE).is_file():
        raise InputError(f"{folder}: it holds no {FILE}; allowed: the folder of a sweep; run rodcone sweep first")
    with read_results(folder) as base:
        found, wanted = rows(base), base.execute("SELECT count(*) FROM wanted").fetchone()[0]
        run = last_study(base)
    if not found or run is None:
        raise InputError(f"{folder}: its last run has made no cell yet; run rodcone sweep, which goes on")
    require_alike(found)
    return LastRun(*run, wanted, tuple(found))


def ledger_results(folder: Path, most_pictures: int | None = None) -> tuple[ReportData, dict[str, bytes]]:
    """Values and pictures of a sweep, as `studies.pages.report.render_report` takes them.

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
    run = read_run(folder)
    study = run.study
    names = [label(choice["source"]) for choice in study["scenes"]]
    of_views = {(row.scene, row.spectrum): row.truth for row in run.rows}
    truths = [of_views.get(view) for view in product(names, study["spectra"])]
    cells = _cells(run, names)
    shown, left_out = _choose(folder, cells, study, most_pictures)
    wanted = dict.fromkeys(name for name in (*truths, *(cell.picture for cell in shown)) if name)
    pictures = {name: read_whole(folder / PICTURES, name) for name in wanted}
    sizes = [_size(pictures, truths[place * len(study["spectra"])]) for place in range(len(names))]
    missing = run.wanted - len(run.rows)
    unmade = [f"{missing} of {run.wanted} cells are not made yet: rodcone sweep goes on with them."] if missing else []
    data = ReportData(
        rodcone=metadata.version("rodcone"),
        name=study["name"],
        scenes=tuple(ReportScene(name, *size) for name, size in zip(names, sizes, strict=True)),
        spectra=tuple(study["spectra"]),
        sensors=tuple(sensor_of(name) for name in study["sensors"]),
        exposures=tuple(study["exposures"]),
        levels=tuple(level_of(level) for level in study["levels"]),
        cameras=tuple(study["processors"]),
        seeds=tuple(study["seeds"]),
        cells=tuple(shown),
        truths=tuple(truths),
        renders=tuple(render_of(run.rows, name) for name in names),
        stages=run.stages,
        environment=environment_of(run.rows),
        configuration=configuration(study),
        exposure_rule=RULE.format(longest=study["longest_exposure_s"] * 1e3),
        display_white=DISPLAY_WHITE,
        left_out=lenses_left_out(run.rows, study["sensors"]),
        notes=(*fallbacks(run.rows), *render_notes(run.rows), *unmade),
        pictures_left_out=left_out,
    )
    return data, pictures


def _cells(run: LastRun, names: Sequence[str]) -> list[ReportCell]:
    """Return a cell for each combination that was asked for; one that isn't made yet has no figure."""
    study = run.study
    sensors = [label(name) for name in study["sensors"]]
    found = {(r.scene, r.spectrum, r.sensor, r.exposure, r.level, r.processor, r.seed): r for r in run.rows}
    light = {(r.scene, r.spectrum, r.level): (r.luminance_cd_m2, r.illuminance_lux) for r in run.rows}
    views = view_names(names, study["spectra"])
    in_view = group_names(sensors, study["exposures"])
    titles = [name + (f", {view}" if view else "") for view in views for name in in_view]
    groups = product(names, study["spectra"], sensors, study["exposures"])
    cells = []
    for title, group in zip(titles, groups, strict=True):
        for level, camera in product(study["levels"], study["processors"]):
            of_seeds = [found.get((*group, level, camera, seed)) for seed in study["seeds"]]
            in_both_units = light.get((*group[:2], level), (None, None))
            cells.append(over_seeds(of_seeds, title, study["levels"].index(level), camera, in_both_units))
    return cells


def _size(pictures: Mapping[str, bytes], name: str | None) -> tuple[int, int]:
    """Height and width of a picture; of one not made yet 1 each."""
    if name is None:
        return 1, 1
    with Image.open(BytesIO(pictures[name])) as picture:
        return picture.height, picture.width


def _choose(
    folder: Path, cells: Sequence[ReportCell], study: Mapping[str, Any], most: int | None
) -> tuple[list[ReportCell], str]:
    """Leave pictures out of the cells until `most` are left; says in words which."""
    cameras = len(study["processors"])
    if most is None:
        files = [folder / PICTURES / cell.picture for cell in cells if cell.picture]
        sizes = [file.stat().st_size for file in files if file.is_file()]  # `read_whole` tells of one that is gone
        most = int(SHOWN_BYTES * len(sizes) / sum(sizes)) if sizes else len(cells)
    count = len(cells) // cameras
    chosen = chosen_conditions(count, len(study["levels"]), max(most // cameras, 1))
    if len(chosen) == count:
        return list(cells), ""
    shown = [cell if index // cameras in chosen else replace(cell, picture=None) for index, cell in enumerate(cells)]
    return shown, (
        f"To keep the page small, pictures of {len(chosen)} of {count} conditions are in it, numbers of all; the "
        "others are files beside the results database, and rodcone report --pictures N puts more into the page."
    )
