"""A sweep: makes every cell of a study that the results database lacks, and stores it in a folder of sweeps."""

import fcntl
import json
import os
import platform
import time
from collections import defaultdict
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping, Sequence
from contextlib import closing, contextmanager, suppress
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from functools import partial
from itertools import chain
from pathlib import Path
from typing import Any

from isp.processors.catalogue import require_libraries
from rodcone.errors import InputError
from rodcone.files import is_half_written
from rodcone.progress import Step, progress_bar, render_words
from studies.budget.ledger import Plan
from studies.photograph.clock import FIRST, Clock
from studies.study.lit_scene import OpenedScene, open_all
from studies.study.render_noise import noise_note
from studies.study.study import Study, conditions, label
from studies.sweep.ahead import Ahead
from studies.sweep.cells import Cell, RenderRecord
from studies.sweep.database import (
    FILE,
    add,
    done,
    forget_old,
    noisiest,
    note_keys,
    note_run,
    note_stages,
    open_results,
    want,
)
from studies.sweep.kept_plan import kept_plan
from studies.sweep.prepare import (
    FOLDERS,
    PICTURES,
    PILOTS,
    Job,
    coloured,
    known_cells,
    make_scene,
    note_scene,
    scene_cells,
)
from studies.sweep.row import Row
from studies.sweep.workers import InThisProcess, run

MARKER = ".rodcone-sweep"  # file that each sweep at work locks; the lock ends with its process, however that ends


@contextmanager
def locked_folder(out: Path) -> Iterator[None]:
    """Mark a folder as a sweep's and lock it within the ``with`` block; several sweeps may share the lock.

    If no other sweep is at work in it, files that an earlier run left half-written are removed first. The folder may be
    new, hold a sweep, or hold nothing but hidden files.

    Raises
    ------
    InputError
        For a folder that holds other files and no sweep.
    OSError
        Where it can't be written.
    """
    out.mkdir(parents=True, exist_ok=True)
    if not any((out / name).is_file() for name in (MARKER, FILE)):
        others = sorted(path.name for path in out.iterdir() if not path.name.startswith("."))
        if others:
            raise InputError(
                f"out: {out} holds other files, such as {others[0]!r}; allowed: a new or an empty folder, or that of "
                f"a sweep; write --out {out / 'sweep'}"
            )
    (out / MARKER).touch()
    with (out / MARKER).open("rb") as marker:
        with suppress(OSError):  # another sweep is at work, or this file system has no locks
            fcntl.flock(marker, fcntl.LOCK_EX | fcntl.LOCK_NB)
            _remove_half_written(out)
        with suppress(OSError):
            fcntl.flock(marker, fcntl.LOCK_SH)
        yield


def _remove_half_written(out: Path) -> None:
    """Remove files that a killed run left half-written; call it under the sweep's lock."""
    for top in (out / name for name in FOLDERS):
        # A linked folder is left alone, because others may share it, and this sweep's lock doesn't cover them.
        for folder, _, files in os.walk(top) if not top.is_symlink() else ():
            for file in files:
                path = Path(folder) / file
                if is_half_written(path):
                    path.unlink(missing_ok=True)


# Runs cells and yields their rows, as `partial(studies.sweep.workers.run_in_processes, workers=4)` does.
Runner = Callable[[Sequence[Cell]], Generator[Row, None, None]]
NOTE_S = 1.0  # seconds between two notes of the time taken so far, because a note with every row would cost a write
RENDER_SHARE = 0.5  # part of a scene's progress that its render counts for; its real part of the time isn't known


@dataclass(frozen=True)
class SweepResult:
    """Outcome of a sweep.

    Attributes
    ----------
    out : Path
        Folder of the results.
    cells, made : int
        Cells of the study, and how many of them this run made; the others were stored before.
    seconds : float
        Seconds of the whole run.
    notes : tuple of str
        Notes on what had to be assumed.
    """

    out: Path
    cells: int
    made: int
    seconds: float
    notes: tuple[str, ...]


def sweep(
    study: Study,
    out: str | Path,
    plan: Plan | None = None,
    runner: Runner | None = None,
    step: Step | None = None,
    *,
    clock: Clock | None = None,
    ahead: bool = False,
) -> SweepResult:
    """Make the missing cells of a study and store each in the results database of a folder.

    After Ctrl-C, a kill or a full disk the next call goes on with the cells that are still missing. Cells that other
    versions, another variant or other engines made are made anew.

    Parameters
    ----------
    study : Study
    out : str or Path
        Folder; made where it isn't there.
    plan : Plan, optional
        What each picture models, as `studies.budget.plan.plan` or `studies.budget.starting_points` decides it; left
        out, `plan` decides it, and its pilot renders stay in the folder.
    runner : callable, optional
        Function that takes cells, and yields a row when a cell is made; left out, cells are made in this process.
    step : callable, optional
        Function that is called with what is being done and the share that is done; left out, a notebook shows a bar.
    clock : Clock, optional
        Clock that was started when the work began, if something was done before.
    ahead : bool
        Render the next scene while the cells of one are made, for a runner whose cells are made in other processes.

    Raises
    ------
    InputError
        For a scene that can't be opened, a library that is missing, or a folder that holds other files and no sweep;
        before anything is rendered.
    OSError
        Where the folder can't be written, or the disk is full.
    """
    clock = clock or Clock()
    out = Path(out)
    for name in study.processors:
        require_libraries(name)
    scenes = open_all(study)
    runner = runner or (lambda cells: run(cells, InThisProcess()))
    with locked_folder(out), progress_bar(step) as show, open_results(out) as base:
        plan = plan or kept_plan(study, out / PILOTS, step)
        job = Job(study, plan, out, base, clock)
        now = datetime.now(UTC).isoformat(timespec="seconds")
        number = note_run(base, now, platform.node(), json.dumps(_noted(study)))
        cell_lists = [known_cells(job, opened) for opened in scenes.values()]
        count = len(conditions(study)) * len(study.processors) * len(study.seeds) // len(scenes)
        want(base, chain.from_iterable([cell.key for cell in cells or ()] or [None] * count for cells in cell_lists))
        count_made = 0
        shares = Shares(show, len(scenes))
        notes = dict[str, None]()
        with closing(_scenes(job, list(scenes.values()), cell_lists, shares, ahead=ahead)) as coming:
            for index, (opened, cells) in enumerate(zip(scenes.values(), coming, strict=True)):
                asked_keys = [cell.key for cell in cells]
                notes.update(dict.fromkeys(cells[0].render.notes))
                if not cell_lists[index]:
                    note_keys(base, index * count, asked_keys)
                stored = done(base, out / PICTURES, asked_keys)
                missing = coloured(job, opened, [cell for cell in cells if cell.key not in stored])
                count_made += _run(job, number, missing, runner, partial(shares.made, index))
        forget_old(base)
        notes.update(dict.fromkeys(_noise_notes(noisiest(base))))
        stages = clock.stages()
        note_stages(base, number, stages)
    return SweepResult(out, count * len(scenes), count_made, sum(stages.values()), tuple(notes))


def _noise_notes(worst: Iterable[Row]) -> list[str]:
    """Write a note for each scene whose render's noise shows beside a sensor's, about the row where it shows most."""
    notes = [(row, noise_note(row.mc_share, row.spp)) for row in worst]
    return [f"{row.scene}, {row.level}, {row.sensor}, {row.processor}: {note}" for row, note in notes if note]


def _noted(study: Study) -> dict[str, Any]:
    """Return the study as the results database stores it, with files under the names that rows have for them."""
    named = {axis: [label(value) for value in getattr(study, axis)] for axis in ("processors", "spectra")}
    return asdict(study) | named | {"scenes": [asdict(scene) | {"source": scene.label} for scene in study.scenes]}


def _scenes(
    job: Job, scenes: Sequence[OpenedScene], known: Sequence[list[Cell] | None], shares: "Shares", *, ahead: bool
) -> Generator[list[Cell], None, None]:
    """Yield the cells of each scene; with `ahead` the next scene is made meanwhile, unless its cells are known."""
    coming: Ahead[tuple[RenderRecord, list[Cell]]] | None = None
    following = known[0]
    try:
        for index, opened in enumerate(scenes):
            cells = following
            rendered = partial(shares.rendered, index)
            if coming is not None:
                (record, cells), waited_s = coming.result(rendered)
                coming = None
                note_scene(job, opened, record)
                for name, seconds in waited_s.items():
                    job.clock.add(name, seconds)
            elif cells is None:
                cells = scene_cells(job, opened, rendered)
            if index + 1 < len(scenes):
                following = known[index + 1] or known_cells(job, scenes[index + 1])  # it may just have been made
                if ahead and following is None:
                    coming = Ahead(partial(make_scene, job, scenes[index + 1]))
            shares.coming = coming
            yield cells
    finally:
        if coming is not None:
            coming.stop()


class Shares:
    """Progress of a sweep: the mean over all scenes of the share of each scene, render and cells, that is done."""

    def __init__(self, step: Step, count: int) -> None:
        self._step, self._count = step, count
        self.coming: Ahead[Any] | None = None  # the next scene, made beside the cells

    def rendered(self, index: int, share: float, error: float) -> None:
        """Show the progress of a scene's render while the sweep waits for it."""
        self._show(index, render_words(error, share), RENDER_SHARE * share)

    def made(self, index: int, what: str, share: float) -> None:
        """Show the progress of a scene's cells, once it is rendered."""
        rendered = 1.0 + (0.0 if self.coming is None else self.coming.share)
        self._show(index, what, RENDER_SHARE * rendered + (1 - RENDER_SHARE) * share)

    def _show(self, index: int, what: str, share: float) -> None:
        words = f"scene {index + 1} of {self._count}: " if self._count > 1 else ""
        self._step(words + what, (index + share) / self._count)


@contextmanager
def noting_stages(job: Job, run: int, more: Mapping[str, float]) -> Iterator[None]:
    """Store the run's seconds by stage at the end of the ``with`` block, also after an error.

    `more` holds seconds by stage that are added to those of the run's clock.
    """
    try:
        yield
    finally:
        note_stages(job.base, run, job.clock.stages(more))


def _run(job: Job, run: int, missing: Sequence[Cell], runner: Runner, part: Step) -> int:
    """Make cells, and store each as it comes with the time taken so far; return their number."""
    count = 0
    workers = set[tuple[str, int]]()
    seconds = defaultdict[str, float](float)
    on_the_clock = dict[str, float]()
    noted_s = time.monotonic()
    with noting_stages(job, run, on_the_clock), closing(runner(missing)) as coming:
        for count, row in enumerate(coming, start=1):
            add(job.base, row)
            workers.add((row.host, row.worker))
            seconds["captures"] += row.capture_s or 0.0
            seconds[f"develop {row.processor}"] += row.develop_s or 0.0
            seconds["metrics"] += row.measure_s or 0.0
            seconds[FIRST] += row.first_s
            # The workers work at the same time, so their seconds are divided by their number, which gives wall time.
            on_the_clock.update((name, value / len(workers)) for name, value in seconds.items())
            if time.monotonic() - noted_s >= NOTE_S:
                noted_s = time.monotonic()
                note_stages(job.base, run, job.clock.stages(on_the_clock))
            part(f"cell {count} of {len(missing)}", count / len(missing))
    for name, value in on_the_clock.items():
        job.clock.add(name, value)
    return count
