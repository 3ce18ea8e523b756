"""Measure time: a run's seconds by stage, and calls apart from the first of their kind. Describe the machine."""

import os
import platform
import time
from collections.abc import Callable, Hashable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from typing import Any, TypeVar

Result = TypeVar("Result")
FIRST, OTHER = "first calls", "other"


@contextmanager
def noting_times(note: Callable[[float, float], None]) -> Iterator[None]:
    """Call `note` with the start and end (`time.perf_counter`) of the ``with`` block, also if it ends in an error."""
    start = time.perf_counter()
    try:
        yield
    finally:
        note(start, time.perf_counter())


class Clock:
    """Clock that adds up the seconds of each stage of a run, and knows those spent outside all stages."""

    def __init__(self) -> None:
        self._start = time.perf_counter()
        self._seconds: dict[str, float] = {}

    def add(self, stage: str, seconds: float) -> None:
        """Add seconds to a stage."""
        self._seconds[stage] = self._seconds.get(stage, 0.0) + seconds

    def stage(self, name: str) -> AbstractContextManager[None]:
        """Add the seconds of the ``with`` block to a stage, also if it ends in an error."""
        return noting_times(lambda start, end: self.add(name, end - start))

    def stages(self, more: Mapping[str, float] | None = None) -> dict[str, float]:
        """Return the seconds by stage, with `more` added; `OTHER` is the rest of the time since the clock was made."""
        seconds = dict(self._seconds)
        for name, value in (more or {}).items():
            seconds[name] = seconds.get(name, 0.0) + value
        return {**seconds, OTHER: time.perf_counter() - self._start - sum(seconds.values())}


_CALLED = set[Hashable]()  # kinds of calls that `timed` has timed in this process


def timed(call: Callable[[], Result], *kind: Hashable) -> tuple[Result, float | None, float]:
    """Time a call; the first of its kind in a process is timed apart, because it compiles kernels and loads libraries.

    Parameters
    ----------
    call : callable
    *kind
        Values that decide which kernels the call needs; a call with other values is of another kind.

    Returns
    -------
    result, seconds, first_s
        Result of the call. `seconds` is the time of a later call, None for a first one; `first_s` is the time of a
        first call, 0 for a later one.
    """
    start = time.perf_counter()
    result = call()
    seconds = time.perf_counter() - start
    if kind in _CALLED:
        return result, seconds, 0.0
    _CALLED.add(kind)
    return result, None, seconds


def processor_name() -> str:
    """Return the model of the processor, because a float's last bits depend on it."""
    cpuinfo = Path("/proc/cpuinfo")
    lines = cpuinfo.read_text().splitlines() if cpuinfo.exists() else []
    names = (line.split(":", 1)[1].strip() for line in lines if "model name" in line)
    return next(names, platform.processor() or platform.machine())


def machine() -> str:
    """Return the processor, the operating system and the version of Python in words."""
    return f"{processor_name()}, {platform.platform()}, Python {platform.python_version()}"


def processor_facts() -> dict[str, Any]:
    """Return the processor's model, its number of cores, and how busy they were before the run."""
    facts: dict[str, Any] = {"processor": processor_name(), "cores": os.cpu_count()}
    if hasattr(os, "getloadavg"):
        facts["load before the run"] = round(os.getloadavg()[0], 1)
    return facts
