"""Seconds told are those of the work that they are told for, first calls apart, and stages add up to the wall clock.

Nothing here is timed: the clock is one that work alone moves on.
"""

import json
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
import sweep_sample as SAMPLE
from command_line import in_new_python

from isp.processors.catalogue import PROCESSORS
from rodcone.jit import backend
from studies.pages.report_sweep import sweep_report
from studies.photograph import clock
from studies.photograph.clock import FIRST, OTHER, Clock, timed
from studies.sweep import run_cell as cell_run
from studies.sweep.cells import Cell
from studies.sweep.database import last_run
from studies.sweep.export import read_rows, results_json
from studies.sweep.row import Row


class Work:
    """A clock that stands still but for what is done: seconds by what did it."""

    def __init__(self) -> None:
        self.done: list[tuple[str, float]] = []

    def now(self) -> float:
        return 1000.0 + sum(seconds for _, seconds in self.done)

    def of(self, name: str) -> float:
        return sum(seconds for what, seconds in self.done if what == name)

    def taking(self, name: str, seconds: float, call: Callable[..., Any]) -> Callable[..., Any]:
        def working(*arguments: Any, **named: Any) -> Any:
            self.done.append((name, seconds))
            return call(*arguments, **named)

        return working


@pytest.fixture
def work(monkeypatch: pytest.MonkeyPatch) -> Work:
    """Exact captures take 1 s, developments 10 s, a cell's PSNR and so on 100 s, in a process that has made no call."""
    made = Work()
    monkeypatch.setattr(clock, "time", SimpleNamespace(perf_counter=made.now))
    monkeypatch.setattr(clock, "_CALLED", set())
    slow = {name: replace(one, picture=made.taking(name, 10.0, one.picture)) for name, one in PROCESSORS.items()}
    monkeypatch.setattr(cell_run, "processor_of", lambda name, _: slow[name])
    monkeypatch.setattr(cell_run, "expose", made.taking("capture", 1.0, cell_run.expose))
    monkeypatch.setattr(cell_run, "picture_quality", made.taking("measure", 100.0, cell_run.picture_quality))
    return made


def test_the_first_call_of_a_kind_is_told_apart_and_made_once(work: Work) -> None:
    call = work.taking("call", 2.0, lambda: "made")
    assert timed(call, "kind", 1) == ("made", None, 2.0)
    assert timed(call, "kind", 1) == ("made", 2.0, 0.0)
    assert timed(call, "kind", 2) == ("made", None, 2.0)
    assert len(work.done) == 3


def test_stages_and_other_are_the_seconds_since_the_clock_was_made(work: Work) -> None:
    of, pause = Clock(), work.taking("pause", 3.0, lambda: None)
    with of.stage("render"):
        pause()
    pause()
    ending = work.taking("pause", 3.0, [].pop)
    with pytest.raises(IndexError), of.stage("render"):
        ending()
    of.add("cells", 1.0)
    assert of.stages() == {"render": 6.0, "cells": 1.0, OTHER: 2.0}
    assert of.stages({"cells": 0.5, "more": 0.25}) == {"render": 6.0, "cells": 1.5, "more": 0.25, OTHER: 1.25}


def test_a_rows_seconds_are_each_of_its_own_step(work: Work, tmp_path: Path) -> None:
    SAMPLE.swept(SAMPLE.small_study(tmp_path), tmp_path / "out")
    found = read_rows(tmp_path / "out")
    own = [(row.capture_s, row.develop_s, row.measure_s) for row in found]
    assert own[0] == (None, None, None)
    assert own[-1] == (1.0, 10.0, 100.0)
    assert found[0].first_s == 111.0
    known = sum(step for row in own for step in row if step is not None)
    assert sum(row.first_s for row in found) == sum(seconds for _, seconds in work.done) - known
    assert known + sum(row.first_s for row in found) == 4 * 111.0, "each step once"


@pytest.mark.sample(1)
@pytest.mark.parametrize("workers", [1, 2])
def test_the_reports_stages_add_up_to_the_runs_wall_clock(workers: int, work: Work, tmp_path: Path) -> None:
    """A run that is ended and gone on with; of two workers, each second of work is half a second of the clock's."""

    def labelled(cells: Sequence[Cell]) -> Iterator[Row]:
        """As if so many workers took turns."""
        for place, row in enumerate(SAMPLE.here(cells)):
            yield replace(row, worker=place % workers)

    def ended(cells: Sequence[Cell]) -> Iterator[Row]:
        yield from labelled(cells[:2])
        raise KeyboardInterrupt

    study, out, start = SAMPLE.small_study(tmp_path), tmp_path / "out", work.now()
    with pytest.raises(KeyboardInterrupt):
        SAMPLE.swept(study, out, ended)
    assert SAMPLE.swept(study, out, labelled).made == 2
    stages = sweep_report(out)[0].stages
    assert sum(stages.values()) == pytest.approx(work.now() - start)
    own = {"captures": 3 * 1.0, "develop bayer": 3 * 10.0, "metrics": 3 * 100.0}
    own |= {FIRST: work.now() - start - sum(own.values())}
    for name, seconds in own.items():
        assert stages[name] == pytest.approx(seconds / workers), name
    assert stages[OTHER] == pytest.approx((work.now() - start) * (1 - 1 / workers))


def test_a_render_counts_once_however_many_cells_share_it(work, tmp_path, monkeypatch):
    module = sys.modules["studies.sweep.prepare"]
    make = work.taking("render", 7.0, module.make_transport)

    def slow(*given: Any) -> Any:
        transport, notes = make(*given)
        return replace(transport, seconds=7.0), notes

    monkeypatch.setattr(module, "make_transport", slow)
    SAMPLE.swept(SAMPLE.small_study(tmp_path), tmp_path / "out")
    stages = sweep_report(tmp_path / "out")[0].stages
    assert work.of("render") == stages["renders"] == 7.0
    assert [row.render_s for row in read_rows(tmp_path / "out")] == [7.0] * 4, "of the render that they share"
    assert sum(stages.values()) == pytest.approx(sum(seconds for _, seconds in work.done))


def test_the_results_stages_are_the_runs_and_their_rows_name_their_engines(work: Work, tmp_path: Path) -> None:
    study = SAMPLE.small_study(tmp_path, processors=("interleaved", "bayer"), seeds=(0,))
    start = work.now()
    SAMPLE.swept(study, tmp_path / "out")
    results = json.loads(results_json(last_run(tmp_path / "out")))
    assert sum(results["stages"].values()) == pytest.approx(work.now() - start)
    assert results["stages"]["captures"] == 3 * 1.0
    assert (results["stages"]["develop interleaved"], results["stages"]["develop bayer"]) == (10.0, 10.0)
    seconds = [(row["capture_s"], row["develop_s"], row["measure_s"]) for row in results["rows"]]
    assert seconds.count((1.0, 10.0, 100.0)) == 2
    assert [row["first_s"] for row in results["rows"] if row["develop_s"] is None] == [111.0, 10.0]
    engines = {row["processor"]: (row["readout_engine"], row["development_engine"]) for row in results["rows"]}
    assert engines == {"interleaved": ("numpy", backend()), "bayer": ("numpy", "numpy")}


COMPILED = """
import json, sys
from dataclasses import replace
from pathlib import Path
from rodcone.jit import dr
sys.path.insert(0, sys.argv[1])
import sweep_sample as SAMPLE
from studies.sweep import run_cell as cell_run
from studies.sweep.run_sweep import sweep
from studies.sweep.workers import InThisProcess, run
dr.set_flag(dr.JitFlag.KernelHistory, True)
told, again = [], cell_run.timed

def counting(call, *kind):
    made = []
    def counted():
        dr.kernel_history()
        result = call()
        history = [one for one in dr.kernel_history() if "cache_hit" in one]
        made.append(sum(not one["cache_hit"] or one["cache_disk"] for one in history))
        return result
    result = again(counted, *kind)
    told.append([kind[0], *made, result[1] is None])
    return result

cell_run.timed = counting
folder = Path(sys.argv[2])
levels = ("0.01cd/m2", "25cd/m2", "600cd/m2", "3000cd/m2", "1000000cd/m2")
study = SAMPLE.small_study(folder, processors=("interleaved", "bayer"), levels=levels, exposures=("20ms",), seeds=(0,))
plan = SAMPLE.stated(study)
plan = replace(plan, images={place: replace(model, exact=False) for place, model in plan.images.items()})
sweep(study, folder / "out", plan, lambda cells: run(cells, InThisProcess()))
print(json.dumps(told))
"""


@pytest.mark.thorough
@pytest.mark.skipif(backend() == "numpy", reason="nothing is compiled without a backend")
def test_no_kernel_is_compiled_or_loaded_within_the_seconds_told(tmp_path: Path) -> None:
    """From darkness over some saturated pixels to all, by Dr.Jit's own history, in a process that starts without."""
    told = json.loads(in_new_python(COMPILED, Path(__file__).resolve().parents[2], tmp_path).splitlines()[-1])
    assert {step for step, compiled, first in told if compiled and first} == {"capture", "develop"}
    assert [step for step, compiled, first in told if compiled and not first] == []
