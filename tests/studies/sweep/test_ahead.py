"""Scenes made beside the cells of the scene before: the same results, one at a time, stopped and gone on with."""

import os
import threading
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
import sweep_sample as SAMPLE

from rodcone.errors import InputError
from studies.photograph import clock
from studies.study.study import SceneChoice, Study
from studies.sweep import run_sweep as sweep_run
from studies.sweep.ahead import Ahead, Spans
from studies.sweep.cells import Cell
from studies.sweep.database import last_run
from studies.sweep.export import read_rows
from studies.sweep.row import Row
from studies.sweep.run_sweep import Shares, sweep
from studies.sweep.workers import worker_processes

WAIT_S = 30.0  # a thread that never comes fails the test


def three_scenes(folder: Path) -> Study:
    """Three pictures of their own sizes, two cells each."""
    names = [str(SAMPLE.picture(folder / f"{side}.exr", (side, 20))) for side in (16, 20, 24)]
    return SAMPLE.small_study(folder, scenes=tuple(SceneChoice(name, "E") for name in names), seeds=(0,))


def swept_ahead(study: Study, out: Path, runner: Any = SAMPLE.here, step: Any = None) -> int:
    return sweep(study, out, SAMPLE.stated(study), runner, step, ahead=True).made


def test_stages_count_for_as_long_as_they_were_waited_for(monkeypatch: pytest.MonkeyPatch) -> None:
    times = iter([10.0, 14.0, 14.0, 20.0, 20.0, 21.0])
    monkeypatch.setattr(clock, "time", SimpleNamespace(perf_counter=lambda: next(times)))
    spans = Spans()
    for name in ("renders", "files", "renders"):
        with spans.stage(name):
            pass
    assert spans.within(0.0, 30.0) == {"renders": 5.0, "files": 6.0}
    assert spans.within(13.0, 15.0) == {"renders": 1.0, "files": 1.0}
    assert spans.within(20.5, 30.0) == {"renders": 0.5, "files": 0.0}


def test_the_next_scene_is_made_beside_the_cells_and_nothing_changes(tmp_path, monkeypatch):
    """The cells of a scene wait for the render of the next, which without a thread would never come."""
    study, begun, made = three_scenes(tmp_path), list[str](), dict[str, threading.Event]()
    make = sweep_run.make_scene

    def noted(job: Any, opened: Any, *given: Any) -> Any:
        begun.append(opened.choice.source)
        result = make(job, opened, *given)
        made.setdefault(opened.choice.source, threading.Event()).set()
        return result

    def waiting(cells: Sequence[Cell]) -> Iterator[Row]:
        places = [scene.source for scene in study.scenes]
        following = places[1:][places.index(cells[0].condition.scene.source) :][:1]
        for source in following:
            assert made.setdefault(source, threading.Event()).wait(WAIT_S)
        assert begun == places[1:][: len(begun)]
        assert set(begun) <= {*places[: places.index(cells[0].condition.scene.source) + 1], *following}  # one ahead
        yield from SAMPLE.here(cells)

    SAMPLE.swept(study, tmp_path / "one")
    monkeypatch.setattr(sweep_run, "make_scene", noted)
    assert swept_ahead(study, tmp_path / "ahead", waiting) == 6
    assert begun == [scene.source for scene in study.scenes[1:]]  # the first has no cells to wait beside
    assert SAMPLE.content(tmp_path / "ahead") == SAMPLE.content(tmp_path / "one")
    assert [row.scene for row in read_rows(tmp_path / "ahead")] == [x.label for x in study.scenes for _ in range(2)]
    stages = last_run(tmp_path / "ahead").stages
    assert min(stages.values()) >= 0
    begun.clear()
    assert swept_ahead(study, tmp_path / "ahead") == 0
    assert begun == []


def test_a_scene_that_fails_is_told_once_the_cells_before_it_are_stored(tmp_path, monkeypatch):
    study, make = three_scenes(tmp_path), sweep_run.make_scene

    def failing(job: Any, opened: Any, *given: Any) -> Any:
        if opened.choice == study.scenes[1]:
            raise InputError("scene: it is gone")
        return make(job, opened, *given)

    monkeypatch.setattr(sweep_run, "make_scene", failing)
    with pytest.raises(InputError, match="it is gone"):
        swept_ahead(study, tmp_path / "out")
    assert len(read_rows(tmp_path / "out")) == 2
    monkeypatch.setattr(sweep_run, "make_scene", make)
    assert swept_ahead(study, tmp_path / "out") == 4
    SAMPLE.swept(study, tmp_path / "one")
    assert SAMPLE.content(tmp_path / "out") == SAMPLE.content(tmp_path / "one")


@pytest.mark.sample(1)
@pytest.mark.parametrize("error", [KeyboardInterrupt, MemoryError])
def test_an_end_among_the_cells_stops_the_scene_that_is_being_made(error, tmp_path, monkeypatch):
    """It is waited for, so that the folder's lock outlives it; the next run ends as one that was never ended."""
    study, make = three_scenes(tmp_path), sweep_run.make_scene
    ended = list[str]()

    def endless(job: Any, opened: Any, clock: Any, progress: Any) -> Any:
        try:
            while True:
                progress(0.5, 0.1)
        finally:
            ended.append(opened.choice.source)

    monkeypatch.setattr(sweep_run, "make_scene", endless)
    with pytest.raises(error):
        swept_ahead(study, tmp_path / "out", partial(SAMPLE.ended_after, 1, error=error))
    assert ended == [study.scenes[1].source]
    monkeypatch.setattr(sweep_run, "make_scene", make)
    assert swept_ahead(study, tmp_path / "out") == 5
    SAMPLE.swept(study, tmp_path / "one")
    assert SAMPLE.content(tmp_path / "out") == SAMPLE.content(tmp_path / "one")


def test_the_share_only_grows_and_is_told_by_the_thread_that_sweeps(tmp_path: Path) -> None:
    told = list[tuple[str, float]]()

    def step(what: str, share: float) -> None:
        assert threading.current_thread() is threading.main_thread()
        told.append((what, share))

    swept_ahead(three_scenes(tmp_path), tmp_path / "out", step=step)
    shares = [share for _, share in told]
    assert shares == sorted(shares)
    assert shares[-1] == 1.0
    assert [what for what, _ in told if "cell 2 of 2" in what] == [f"scene {n} of 3: cell 2 of 2" for n in (1, 2, 3)]


def test_shares_are_those_of_renders_and_cells_over_all_scenes() -> None:
    told = list[float]()
    shares = Shares(lambda what, share: told.append(share), 4)
    shares.rendered(1, 0.5, 0.1)
    shares.made(1, "cell 1 of 4", 0.25)
    shares.coming = SimpleNamespace(share=0.4)  # type: ignore[assignment]
    shares.made(1, "cell 1 of 4", 0.25)
    shares.coming = None
    shares.rendered(2, 0.4, 0.1)
    # halves of renders and of cells that are done, over four scenes
    assert told == pytest.approx([(1.5 + 1.0) / 8, (2 + 1.25) / 8, (2 + 1.25 + 0.4) / 8, (2 + 2 + 0.4) / 8])


def test_what_a_thread_raises_is_raised_where_its_result_is_asked_for() -> None:
    def failing(spans: Spans, progress: Any) -> None:
        progress(0.25, 0.1)
        raise OSError(28, "No space left on device")

    with pytest.raises(OSError, match="No space left"):
        Ahead(failing).result(lambda share, error: None)


@pytest.mark.thorough
def test_processes_stay_from_one_scene_to_the_next_and_one_that_died_is_replaced(tmp_path: Path) -> None:
    cells = SAMPLE.made_cells(tmp_path)
    with worker_processes(1) as run_cells:
        first, second = ([row.worker for row in run_cells(part)] for part in (cells[:2], cells[2:3]))
        deadly = replace(cells[3], colours=Deadly())  # type: ignore[arg-type]
        rest = list[Row]()
        with pytest.raises(InputError, match="ended their worker"):
            rest.extend(run_cells([deadly]))
        third = [row.worker for row in run_cells(cells[3:])]
    assert rest == []
    assert len({*first, *second}) == 1
    assert len(third) == 1
    assert third[0] != first[0]


class Deadly:
    """What ends the process that unpacks it."""

    def __reduce__(self) -> tuple[Any, tuple[int]]:
        return os._exit, (1,)
