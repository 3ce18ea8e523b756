"""A sweep: every cell of a study that the ledger doesn't hold yet, made and noted."""

import json
import platform
import shutil
import sqlite3
import time
from collections.abc import Callable, Generator, Sequence
from contextlib import closing, suppress
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from pathlib import Path

from isp.processors import require_libraries
from studies.cell_run import Row
from studies.cells import Cell
from studies.digests import code_version
from studies.ledger import add, done, note_run, open_ledger, want
from studies.lit_scene import open_all
from studies.model import Plan
from studies.prepare import PICTURES, Job, scene_cells
from studies.results import environment
from studies.study import Study, check

Step = Callable[[str, float], None]  # what is being done, and the share of the whole (0..1)
Runner = Callable[
    [Sequence[Cell]], Generator[Row, None, None]
]  # such as `partial(studies.workers.run_in_processes, workers=4)`
LEFT_S = 3600.0  # after which a temporary file has no writer any more: writing one takes seconds
RENDER_SHARE = 0.5  # of the progress bar that a scene's render takes; how long it takes isn't known before


@dataclass(frozen=True)
class Swept:
    """What a sweep did.

    Attributes
    ----------
    out : Path
        Folder of the ledger.
    cells, made : int
        Cells of the study, and how many of them this run made; the others stood in the ledger.
    seconds : float
        Of the whole run.
    notes : tuple of str
        What had to be assumed.
    """

    out: Path
    cells: int
    made: int
    seconds: float
    notes: tuple[str, ...]


def sweep(study: Study, out: Path, plan: Plan, runner: Runner, step: Step = lambda what, share: None) -> Swept:
    """Make the missing cells of a study and note each in the ledger of a folder.

    Whatever ends it (Ctrl-C, a kill, a full disk), the next call goes on with the cells that are missing then.

    Parameters
    ----------
    study : Study
    out : Path
        Folder; made where it isn't there.
    plan : Plan
        Of `studies.model.as_stated`, `studies.plan.plan` or `reference_plan`.
    runner : callable
        Takes cells, gives rows as they come.
    step : callable

    Raises
    ------
    InputError
        For whatever in the study isn't allowed, before anything is rendered.
    OSError
        Where the folder can't be written, or the disk is full.
    """
    started = time.perf_counter()
    check(study)
    for name in study.processors:
        require_libraries(name)
    scenes = open_all(study)
    out.mkdir(parents=True, exist_ok=True)
    _clear(out)
    cells, made = [], 0
    with open_ledger(out) as base:
        _note(base, study)
        job = Job(study, plan, out, base)
        for index, opened in enumerate(scenes.values()):
            part = _part(step, index, len(scenes))
            of_scene = scene_cells(job, opened, _rendering(part))
            cells += of_scene
            want(base, (cell.key for cell in cells))
            kept = done(base, out / PICTURES)
            missing = [cell for cell in of_scene if cell.key not in kept]
            made += _run(base, missing, runner, part)
    notes = tuple(dict.fromkeys(note for opened in scenes.values() for note in opened.notes))
    return Swept(out, len(cells), made, time.perf_counter() - started, notes)


def _clear(out: Path) -> None:
    """Remove what a killed run had begun to write; another that is at work now has begun less than that ago."""
    for pattern in (".part-*", "*.part"):  # of `render.files.replacing` and `render.cache.save_transport`
        for path in list(out.rglob(pattern)):
            with suppress(OSError):  # another sweep may clear it too
                if time.time() - path.stat().st_mtime > LEFT_S:
                    shutil.rmtree(path) if path.is_dir() else path.unlink()


def _run(base: sqlite3.Connection, missing: Sequence[Cell], runner: Runner, part: Step) -> int:
    """Make cells and note each as it comes; gives their number."""
    began, count = time.perf_counter(), 0
    with closing(runner(missing)) as rows:
        for row in rows:
            add(base, row)
            count += 1
            part(_told(count, len(missing), time.perf_counter() - began), _after_render(count / len(missing)))
    return count


def _rendering(part: Step) -> Callable[[float, float], None]:
    return lambda share, error: part(f"render, relative error {error:.3f}", RENDER_SHARE * share)


def _note(base: sqlite3.Connection, study: Study) -> None:
    now = datetime.now(UTC).isoformat(timespec="seconds")
    note_run(base, now, platform.node(), json.dumps(asdict(study)), environment() | {"code": code_version()})


def _part(step: Step, index: int, count: int) -> Step:
    """Progress of one scene as part of the whole."""
    words = f"scene {index + 1} of {count}: " if count > 1 else ""
    return lambda what, share: step(words + what, (index + share) / count)


def _after_render(share: float) -> float:
    return RENDER_SHARE + (1 - RENDER_SHARE) * share


def _told(count: int, wanted: int, seconds: float) -> str:
    return f"cell {count} of {wanted}, {duration(seconds / count * (wanted - count))} left"


def duration(seconds: float) -> str:
    """Time in words, to the precision that an estimate has: ``40 s``, ``3 min``, ``2.5 h``."""
    if seconds < 100:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 6000 else f"{seconds / 3600:.1f} h"
