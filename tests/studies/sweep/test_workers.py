"""Running cells: any executor, pools that outlive deaths, threads shared out, no process left behind."""

import os
import platform
import time
from concurrent.futures import BrokenExecutor, Executor, Future
from dataclasses import replace
from multiprocessing import active_children
from pathlib import Path
from typing import Any

import pytest
import sweep_sample as SAMPLE
from refusal import refusal

from rodcone.errors import InputError
from studies.sweep import workers
from studies.sweep.cells import Cell
from studies.sweep.workers import InThisProcess, WorkerLostError, run, run_in_processes


class Deadly:
    """Ends the process that unpickles it."""

    def __reduce__(self) -> Any:
        return os._exit, (9,)


class Breaking(Executor):
    """Executor that gives one result and breaks."""

    def __init__(self) -> None:
        self.calls = 0

    def submit(self, fn: Any, /, *args: Any, **kwargs: Any) -> Future[Any]:
        self.calls += 1
        future: Future[Any] = Future()
        if self.calls == 1:
            future.set_result(fn(*args, **kwargs))
        else:
            future.set_exception(BrokenExecutor("gone"))
        return future


@pytest.fixture
def cells(tmp_path: Path) -> list[Cell]:
    return SAMPLE.made_cells(tmp_path)


def test_what_was_ready_comes_before_the_error(cells: list[Cell], tmp_path: Path) -> None:
    bad = replace(cells[2], truth=tmp_path / "absent.npy")
    running = run([cells[0], bad, cells[1]], InThisProcess(), at_once=2)
    assert next(running).key == cells[0].key
    refusal(list, running, match="can't be read")


FAULTS = """(lambda np, used: [used(0).ru_minflt, *(
    sum(np.ones((128, 128)).sum() for _ in [[np.ones((128, 128)) for _ in range(8)]]) for _ in range(50)
), used(0).ru_minflt])(__import__("numpy"), __import__("resource").getrusage)"""


@pytest.mark.thorough
@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="the settings are glibc's")
def test_a_worker_keeps_the_memory_of_small_frames() -> None:
    """Nine arrays of 32 pages, made fifty times: a worker that gave them back would fault 14 400 times."""
    with workers._pool(1, 1) as pool:
        first, *_, last = pool.submit(eval, FAULTS).result()
    assert last - first < 1000


def test_a_broken_executor_tells_which_cells_it_held(cells: list[Cell]) -> None:
    running = run(cells, Breaking(), at_once=3)
    assert next(running).key == cells[0].key
    with pytest.raises(WorkerLostError) as lost:
        next(running)
    assert {cell.key for cell in lost.value.cells} == {cell.key for cell in cells[1:3]}


@pytest.mark.thorough
def test_a_cell_that_ends_its_worker_is_given_up_and_all_others_are_made(cells, monkeypatch):
    monkeypatch.setattr(workers, "MOST_DEATHS", 2)
    deadly = replace(cells[1], colours=Deadly())  # type: ignore[arg-type]
    made = []
    with pytest.raises(InputError, match=r"1 ended their worker 2 times, the first bayer of Condition\(") as told:
        made.extend(row.key for row in run_in_processes([cells[0], deadly, *cells[2:]], 1))
    assert sorted(made) == sorted(cell.key for cell in (cells[0], *cells[2:]))
    assert "\n" not in str(told.value)
    assert active_children() == []


@pytest.mark.thorough
def test_a_worker_that_can_not_leave_is_ended(monkeypatch: pytest.MonkeyPatch) -> None:
    """As one whose neighbour was killed with the queue's lock in its hands, just when all cells were done."""
    monkeypatch.setattr(workers, "LEAVE_S", 0.5)
    began = time.monotonic()
    with workers._pool(2, 1) as pool:
        endless = pool.submit(time.sleep, 600)
        while not endless.running():
            time.sleep(0.05)
    assert isinstance(endless.exception(), BrokenExecutor)
    assert active_children() == []
    assert time.monotonic() - began < 60
