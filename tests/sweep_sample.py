"""A small study of a spectral picture file, for the tests of sweeps."""

import hashlib
import os
import sqlite3
from collections.abc import Iterator, Sequence
from dataclasses import fields, replace
from pathlib import Path
from typing import Any, get_type_hints

import numpy as np

from render.radiance import SpectralRadiance
from render.radiance_files.exr import write_exr
from studies.budget.ledger import Plan
from studies.budget.starting_points import plan_from_settings
from studies.study.lit_scene import open_all
from studies.study.study import SceneChoice, Study
from studies.sweep.cells import Cell
from studies.sweep.database import COLUMNS, FILE, open_results
from studies.sweep.prepare import Job, scene_cells
from studies.sweep.row import Row
from studies.sweep.run_sweep import MARKER, Runner, SweepResult, sweep
from studies.sweep.workers import InThisProcess, run

RENDER = (
    '{"integrator": "file", "stopped_by": "samples", "relative_mc_error": 0.01, '
    '"relative_level_error": null, "first_nm": 390.0, "last_nm": 770.0, "width_nm": 20.0, "brightest_share": null, '
    '"notes": []}'
)
TIME_AND_HOST = (
    "render_s", "capture_s", "develop_s", "measure_s", "first_s", "threads", "finished", "host", "machine", "worker",
)  # fmt: skip
EMPTY: dict[Any, Any] = {str: "", int: 0, float: 0.0}

NM = np.linspace(405.0, 765.0, 10)  # bands of 40 nm
SIZE = (16, 20)


def picture(path: Path, size: tuple[int, int] = SIZE) -> Path:
    """Greys and colours with soft edges, 1 to 20 in brightness."""
    rows, columns = np.mgrid[0 : size[0], 0 : size[1]] / np.array(size)[:, None, None]
    colour = 1 + 0.8 * np.sin(2 * np.pi * (NM[None, None] / 300.0 + rows[..., None]))
    values = colour * (0.05 + 0.95 * columns[..., None]) * 1e-3
    write_exr(SpectralRadiance(values.astype(np.float32), NM), path)
    return path


def small_study(folder: Path, **changes: Any) -> Study:
    """Bayer at two levels with two seeds: four cells of some milliseconds."""
    scene = folder / "scene.exr"
    if not scene.exists():
        picture(scene)
    made = Study((SceneChoice(str(scene), "E"),), ("1cd/m2", "25cd/m2"), processors=("bayer",), seeds=(0, 1))
    return replace(made, **changes)


def stated(study: Study) -> Plan:
    return plan_from_settings(study)


def here(cells: Sequence[Cell]) -> Iterator[Row]:
    """Run cells in this process, one after the other."""
    return run(cells, InThisProcess())


def ended_after(count: int, cells: Sequence[Cell], error: type[BaseException] = KeyboardInterrupt) -> Iterator[Row]:
    """Run that ends with an error after so many cells, where there are any."""
    yield from here(cells[:count])
    if cells:
        raise error


def swept(study: Study, out: Path, runner: Runner = here) -> SweepResult:
    return sweep(study, out, stated(study), runner)


def content(out: Path) -> list[tuple[Any, ...]]:
    """All that a ledger holds of cells but times and host, and the bytes of each picture."""
    names = [name for name in COLUMNS if name not in TIME_AND_HOST]
    with sqlite3.connect(out / FILE) as base:
        rows = base.execute(f"SELECT {', '.join(names)} FROM cells ORDER BY key").fetchall()
    base.close()
    place = names.index("picture")
    return [(*row, (out / "pictures" / row[place]).read_bytes()) for row in rows]


def half_pictures(out: Path) -> list[Path]:
    """Pictures whose content isn't what they are named after; `.rodcone-...` has no name yet."""
    found = [path for path in (out / "pictures").rglob("*.png") if not path.name.startswith(".rodcone-")]
    return [path for path in found if not hashlib.sha256(path.read_bytes()).hexdigest().startswith(path.stem)]


def parts_left(out: Path) -> list[str]:
    """Temporary files that an end left behind among the pictures and frames."""
    return [name for _, _, files in os.walk(out) for name in files if name.startswith(".rodcone-") and name != MARKER]


def row(processor: str, seed: int, **values: Any) -> Row:
    """A row in which all that is not given is empty."""
    hints = get_type_hints(Row)
    plain = {field.name: EMPTY.get(hints[field.name]) for field in fields(Row)}
    place = {
        "render": RENDER,
        "scene": "desk",
        "spectrum": "own",
        "level": "1cd/m2",
        "exposure": "auto",
        "sensor": "mine.toml",
        "white_balance": "gray-world",
        "frames": 1,
    }
    return Row(
        **plain
        | place
        | {"mean_electrons": "{}", "versions": '{"rodcone": "0.1.0"}'}
        | {"processor": processor, "seed": seed}
        | values
    )


def made_cells(folder: Path, study: Study | None = None, plan: Plan | None = None) -> list[Cell]:
    """Cells of a study, the small one by default, with their shared files made in the folder."""
    study = study or small_study(folder)
    with open_results(folder) as base:
        job = Job(study, plan or stated(study), folder, base)
        return [cell for opened in open_all(study).values() for cell in scene_cells(job, opened, lambda *_: None)]


# A number of every kind, and what a spreadsheet or a reader of 32 bits would change.
ROW = row(
    "bayer",
    2**40,
    key="00ff",
    scene="desk, lit.exr",
    level="25cd/m2",
    sensor="low_noise",
    luminance_cd_m2=25.0,
    exposure_s=0.1 + 0.2,
    psnr_db=float("inf"),
    ssim=-0.25,
    snr_db=-3.5,
    variant="llvm_ad_spectral",
    readout_engine="numpy",
    development_engine="llvm",
    versions='{"numpy": "2.4.6", "rodcone": "0.1.0+abc"}',
    finished="2026-01-01T00:00:00+00:00",
    host="here",
)
