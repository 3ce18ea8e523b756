"""A small study of a spectral picture file, for the tests of sweeps."""

import hashlib
import os
import sqlite3
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from render.exr import write_exr
from render.radiance import SpectralRadiance
from sensor.presets import preset
from studies.cells import Cell
from studies.ledger import COLUMNS, FILE
from studies.model import Plan, as_stated
from studies.row import TIME_AND_HOST, Row
from studies.study import SceneChoice, Study
from studies.sweep import Runner, Swept, sweep
from studies.workers import InThisProcess, run

NM = np.linspace(405.0, 765.0, 10)  # bands of 40 nm
SIZE = (16, 20)


def picture(path: Path, size: tuple[int, int] = SIZE) -> Path:
    """Greys and colours with soft edges, 1 to 20 in brightness."""
    rows, columns = np.mgrid[0 : size[0], 0 : size[1]] / np.array(size)[:, None, None]
    colour = 1 + 0.8 * np.sin(2 * np.pi * (NM[None, None] / 300.0 + rows[..., None]))
    values = colour * (0.05 + 0.95 * columns[..., None]) * 1e-3
    write_exr(path, SpectralRadiance(values.astype(np.float32), NM))
    return path


def small_study(folder: Path, **changes: Any) -> Study:
    """Bayer at two levels with two seeds: four cells of some milliseconds."""
    scene = folder / "scene.exr"
    if not scene.exists():
        picture(scene)
    made = Study((SceneChoice(str(scene), "E"),), ("1cd/m2", "25cd/m2"), processors=("bayer",), seeds=(0, 1))
    return replace(made, **changes)


def stated(study: Study) -> Plan:
    return as_stated(study, {name: preset(name).lens for name in study.sensors})


def here(cells: Sequence[Cell]) -> Iterator[Row]:
    """Run cells in this process, one after the other."""
    return run(cells, InThisProcess())


def swept(study: Study, out: Path, runner: Runner = here) -> Swept:
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
    """Pictures whose content isn't what they are named after; one in a `.part-` folder hasn't got its name yet."""
    found = [path for path in (out / "pictures").rglob("*.png") if not path.parent.name.startswith(".part-")]
    return [path for path in found if not hashlib.sha256(path.read_bytes()).hexdigest().startswith(path.stem)]


def parts_left(out: Path) -> list[str]:
    """Temporary files that an end left behind among the pictures and frames."""
    return [name for folder, folders, files in os.walk(out) for name in (*folders, *files) if name.startswith(".part")]
