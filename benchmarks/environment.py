"""What every benchmark shares: the machine and versions that its figures belong to, and how calls are timed."""

import os
import platform
import time
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rodcone.jit import backend, dr
from rodcone.llvm import LIBLLVM


def print_environment() -> None:
    """Print processor, cores, versions, engine and load."""
    processor = platform.processor() or platform.machine()
    cpuinfo = Path("/proc/cpuinfo")
    if cpuinfo.exists():
        names = [line.split(":", 1)[1].strip() for line in cpuinfo.read_text().splitlines() if "model name" in line]
        processor = names[0] if names else processor
    library = LIBLLVM.name if LIBLLVM else "none"
    print(f"{processor}, {os.cpu_count()} cores, {dr.thread_count()} threads; Python {platform.python_version()}")
    print(f"NumPy {np.__version__}, Dr.Jit {dr.__version__} on {backend()}, LLVM library {library}")
    if hasattr(os, "getloadavg"):
        print(f"load before the run: {os.getloadavg()[0]:.1f}")


def seconds_of(function: Callable[[], object]) -> tuple[float, float]:
    """Seconds of one call: on the clock, and of the processor (all threads together)."""
    wall, cpu = time.perf_counter(), time.process_time()
    function()
    return time.perf_counter() - wall, time.process_time() - cpu


def in_turn(functions: Mapping[str, Callable[[], object]], rounds: int) -> dict[str, NDArray[np.float64]]:
    """Seconds of each call, (round, 2): clock, processor. All take turns, after one call each that doesn't count.

    Where other programs run, a call is twice as long as a minute before; calls in turn meet much the same machine.
    """
    for function in functions.values():
        function()
    laps = [[seconds_of(function) for function in functions.values()] for _ in range(rounds)]
    return dict(zip(functions, np.moveaxis(np.array(laps), 1, 0), strict=True))


def beside(name: str, times: Mapping[str, NDArray[np.float64]], yardstick: str) -> str:
    """Medians, and the medians of the ratios to the yardstick's call of the same round."""
    (wall, cpu), ratios = np.median(times[name], axis=0), times[name] / times[yardstick]
    (low, _), (wall_ratio, cpu_ratio), (high, _) = np.percentile(ratios, [25, 50, 75], axis=0)
    return (
        f"{name:44s} {wall:8.3f} s ({wall_ratio:5.2f} x, middle half {low:.2f} to {high:.2f}), "
        f"processor {cpu:8.3f} s ({cpu_ratio:5.2f} x)"
    )
