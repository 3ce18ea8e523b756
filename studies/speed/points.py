"""A choice's time and error, and which choices no other beats in both."""

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from statistics import median
from typing import Any, TypeVar

T = TypeVar("T")


@dataclass(frozen=True)
class Times:
    """Of the first call, compilation included [s]; medians of the later ones, on the clock and of the processor [s]."""

    first_s: float
    seconds: float
    processor_s: float


@dataclass(frozen=True)
class Point:
    """One choice: its times, its error [e-]."""

    choice: str
    times: Times
    error_e: float


@dataclass(frozen=True)
class Stage:
    """One stage's choices.

    Attributes
    ----------
    name, question : str
    reference : str
        What errors are differences to, and what the times are ratios of.
    noise_e : float
        The sensor's own noise, root mean square, to judge errors by.
    points : tuple of Point
    reference_times : Times
    """

    name: str
    question: str
    reference: str
    noise_e: float
    points: tuple[Point, ...]
    reference_times: Times


def front(points: Sequence[Point]) -> tuple[Point, ...]:
    """Pareto front, quickest first: no other choice is at least as quick and as near, and better in one of the two."""
    best: list[Point] = []
    for point in sorted(points, key=lambda each: (each.times.seconds, each.error_e)):
        if not best or point.error_e < best[-1].error_e:
            best.append(point)
    return tuple(best)


def timed(calls: Mapping[str, Callable[[], T]], repeats: int) -> dict[str, tuple[T, Times]]:
    """Result and times of each call: all are made once, then take `repeats` turns, so that they meet one machine."""
    made: dict[str, T] = {}
    seconds: dict[str, list[tuple[float, float]]] = {name: [] for name in calls}
    for _ in range(repeats + 1):
        for name, call in calls.items():
            wall, processor = time.perf_counter(), time.process_time()
            made[name] = call()
            seconds[name].append((time.perf_counter() - wall, time.process_time() - processor))
    return {name: (made[name], _times(all_s)) for name, all_s in seconds.items()}


def _times(seconds: Sequence[tuple[float, float]]) -> Times:
    """Times of a first call and those after it; where there are none, it counts itself."""
    walls, processors = zip(*(seconds[1:] or seconds), strict=True)
    return Times(seconds[0][0], median(walls), median(processors))


def stage_json(stage: Stage) -> dict[str, Any]:
    """A stage as JSON takes it: times and errors, ratios beside them."""
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
