"""What every benchmark shares: the machine and versions that its figures belong to, and how calls are timed."""

import platform
from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import NDArray

from rodcone.jit import backend, dr
from rodcone.llvm import LIBLLVM
from studies.photograph.clock import processor_facts
from studies.speed.points import laps


def print_environment() -> None:
    """Print processor, cores, load, versions and engine."""
    print("\n".join(f"{name}: {fact}" for name, fact in processor_facts().items()))
    library = LIBLLVM.name if LIBLLVM else "none"
    print(f"{dr.thread_count()} threads; Python {platform.python_version()}, NumPy {np.__version__}")
    print(f"Dr.Jit {dr.__version__} on {backend()}, LLVM library {library}")


def seconds_of(function: Callable[[], object]) -> tuple[float, float]:
    """Seconds of one call: on the clock, and of the processor (all threads together)."""
    wall, processor = laps({"": function}, 0)[""][1][0].tolist()
    return wall, processor


def in_turn(functions: Mapping[str, Callable[[], object]], rounds: int) -> dict[str, NDArray[np.float64]]:
    """Seconds of each call, (round, 2): clock, processor. All take turns, after one call each that doesn't count."""
    return {name: seconds[1:] for name, (_, seconds) in laps(functions, rounds).items()}


def beside(name: str, times: Mapping[str, NDArray[np.float64]], yardstick: str) -> str:
    """Medians, and the medians of the ratios to the yardstick's call of the same round."""
    (wall, cpu), ratios = np.median(times[name], axis=0), times[name] / times[yardstick]
    (low, _), (wall_ratio, cpu_ratio), (high, _) = np.percentile(ratios, [25, 50, 75], axis=0)
    return (
        f"{name:44s} {wall:8.3f} s ({wall_ratio:5.2f} x, middle half {low:.2f} to {high:.2f}), "
        f"processor {cpu:8.3f} s ({cpu_ratio:5.2f} x)"
    )
