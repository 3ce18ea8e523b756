"""A choice's time and error, and which choices no other beats in both."""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

T = TypeVar("T")


@dataclass(frozen=True)
class Point:
    """One choice: time of the first call (compilation included) and of the best later one [s], error [e-]."""

    choice: str
    first_s: float
    seconds: float
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
    reference_s : float
        Time of the reference.
    """

    name: str
    question: str
    reference: str
    noise_e: float
    points: tuple[Point, ...]
    reference_s: float


def front(points: Sequence[Point]) -> tuple[Point, ...]:
    """Pareto front, quickest first: no other choice is at least as quick and as near, and better in one of the two."""
    best: list[Point] = []
    for point in sorted(points, key=lambda each: (each.seconds, each.error_e)):
        if not best or point.error_e < best[-1].error_e:
            best.append(point)
    return tuple(best)


def timed(function: Callable[[], T], repeats: int) -> tuple[T, float, float]:
    """Result, seconds of the first call, and the least of the `repeats` after it."""
    start = time.perf_counter()
    result = function()
    first_s = time.perf_counter() - start
    later = []
    for _ in range(repeats):
        start = time.perf_counter()
        result = function()
        later.append(time.perf_counter() - start)
    return result, first_s, min(later, default=first_s)


def stage_json(stage: Stage) -> dict[str, Any]:
    """A stage as JSON takes it: times and errors, ratios beside them."""
    best = front(stage.points)
    return {
        "name": stage.name,
        "question": stage.question,
        "reference": stage.reference,
        "reference_s": stage.reference_s,
        "noise_e": stage.noise_e,
        "points": [
            {
                "choice": point.choice,
                "first_s": point.first_s,
                "seconds": point.seconds,
                "time_over_reference": point.seconds / stage.reference_s,
                "error_e": point.error_e,
                "share_of_noise_variance": (point.error_e / stage.noise_e) ** 2,
                "on_front": point in best,
            }
            for point in stage.points
        ],
    }
