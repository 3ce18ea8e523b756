"""What holds for all tests: one thread in each of several workers, and which cases `make test` runs."""

import gc
import os
from collections import defaultdict
from collections.abc import Iterator
from typing import Any

import pytest
from browser import chromium

from rodcone.jit import backend, dr


def pytest_configure(config: pytest.Config) -> None:
    """Give each worker of pytest-xdist one thread of OpenMP and of Dr.Jit, if `make test-any-cpu` asks for no other."""
    gc.disable()  # until all items are there, none of which goes
    if "PYTEST_XDIST_WORKER" in os.environ:
        os.environ.setdefault("OMP_NUM_THREADS", "1")  # threads that wait for each other spin: FLIP five times as long
    if "PYTEST_XDIST_WORKER" in os.environ and "ANY_CPU_DRJIT_THREADS" not in os.environ and backend() == "llvm":
        dr.set_thread_count(1)


def pytest_collection_finish() -> None:
    """Have the garbage collector pass over all that the collection made."""
    gc.freeze()
    gc.enable()


def pytest_unconfigure() -> None:
    """Let the collector see it all again, or Dr.Jit reports at the end what was never freed."""
    gc.unfreeze()


@pytest.fixture(autouse=True)
def no_progress_lines(monkeypatch: pytest.MonkeyPatch) -> None:
    """Print no line of progress, nor how long kernels compiled: a busy or new machine would add them."""
    monkeypatch.setattr("rodcone.progress.LINE_EVERY_S", 1e6)
    monkeypatch.setattr("rodcone.progress.LEAST_COMPILE_S", 1e6)


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    """One Chromium for a module's tests."""
    with chromium() as started:
        yield started


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark `thorough` what `sample(n)` leaves out: of a test's cases all but n, spread evenly from the first on."""
    cases: dict[str, list[pytest.Item]] = defaultdict(list)
    for item in items:
        if item.get_closest_marker("sample"):
            cases[item.nodeid.split("[")[0]].append(item)
    for group in cases.values():
        marker = group[0].get_closest_marker("sample")
        count = min(marker.args[0], len(group)) if marker else 0
        sampled = {i * len(group) // count for i in range(count)}
        for index, item in enumerate(group):
            if index not in sampled:
                item.add_marker(pytest.mark.thorough)
