"""A choice's time and error, and which choices no other beats in both."""

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

T = TypeVar("T")


@dataclass(frozen=True)
class Times:
    """Seconds of a call.

    Attributes
    ----------
    first_s : float
        First call, compilation included.
    seconds, processor_s : float
        Medians of the later calls: on the clock, and of the processor (all threads together).
    """

    first_s: float
    seconds: float
    processor_s: float


@dataclass(frozen=True)
class Measured:
    """One choice: its times, and its error [e-]."""

    choice: str
    times: Times
    error_e: float


@dataclass(frozen=True)
class Stage:
    """One stage of the chain, and its choices.

    Attributes
    ----------
    name, question : str
    reference : str
        What errors are differences from, and what the times are divided by.
    noise_e : float
        Root mean square of the sensor's own noise, to compare the errors with.
    points : tuple of Measured
    reference_times : Times
    """

    name: str
    question: str
    reference: str
    noise_e: float
    points: tuple[Measured, ...]
    reference_times: Times


def front(points: Sequence[Measured]) -> tuple[Measured, ...]:
    """Pareto front, fastest first: no other choice is as fast and as accurate, and better in one of the two."""
    best: list[Measured] = []
    for point in sorted(points, key=lambda each: (each.times.seconds, each.error_e)):
        if not best or point.error_e < best[-1].error_e:
            best.append(point)
    return tuple(best)


def laps(calls: Mapping[str, Callable[[], T]], repeats: int) -> dict[str, tuple[T, NDArray[np.float64]]]:
    """Last result and seconds of each call, (1 + repeats, 2): on the clock, and of the processor.

    The calls take turns: where other programs run, all of them meet much the same machine.
    """
    results: dict[str, T] = {}
    seconds: dict[str, list[tuple[float, float]]] = {name: [] for name in calls}
    for _ in range(repeats + 1):
        for name, call in calls.items():
            wall, processor = time.perf_counter(), time.process_time()
            results[name] = call()
            seconds[name].append((time.perf_counter() - wall, time.process_time() - processor))
    return {name: (results[name], np.array(seconds[name])) for name in calls}


def timed(calls: Mapping[str, Callable[[], T]], repeats: int) -> dict[str, tuple[T, Times]]:
    """Last result and times of each call; without repeats the first call counts."""
    made = {}
    for name, (result, seconds) in laps(calls, repeats).items():
        made[name] = result, Times(float(seconds[0, 0]), *np.median(seconds[min(repeats, 1) :], axis=0).tolist())
    return made


def stage_json(stage: Stage) -> dict[str, Any]:
    """Return a stage as JSON holds it: times and errors with their ratios."""
    best = front(stage.points)
    return {
        "name": stage.name,
        "question": stage.question,
        "reference": stage.reference,
        "reference_s": stage.reference_times.seconds,
        "reference_processor_s": stage.reference_times.processor_s,
        "noise_e": stage.noise_e,
        "points": [
            {
                "choice": point.choice,
                **vars(point.times),
                "time_over_reference": point.times.seconds / stage.reference_times.seconds,
                "processor_over_reference": point.times.processor_s / stage.reference_times.processor_s,
                "error_e": point.error_e,
                "share_of_noise_variance": (point.error_e / stage.noise_e) ** 2,
                "on_front": point in best,
            }
            for point in stage.points
        ],
    }
