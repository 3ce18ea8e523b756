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
    """One choice.

    Attributes
    ----------
    choice : str
    times : Times
    error_e : float
        RMS [e-].
    share : float or None
        Squared error over the sensor's noise variance, mean of the pixels' own; None: mean over mean.
    """

    choice: str
    times: Times
    error_e: float
    share: float | None = None


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


def front(pairs: Sequence[tuple[float, float]]) -> list[bool]:
    """Which of some (time, error) are on the Pareto front: no other is as fast and as accurate, and better in one.

    Of equal ones the first is.
    """
    flags, least = [False] * len(pairs), np.inf
    for index in sorted(range(len(pairs)), key=lambda place: pairs[place]):
        flags[index] = pairs[index][1] < least
        least = min(least, pairs[index][1])
    return flags


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


def share_of_noise_variance(point: Measured, stage: Stage) -> float:
    """Squared error of a choice over the sensor's own noise variance."""
    return (point.error_e / stage.noise_e) ** 2 if point.share is None else point.share


def stage_json(stage: Stage) -> dict[str, Any]:
    """Return a stage as JSON holds it: times and errors with their ratios."""
    shares = [share_of_noise_variance(point, stage) for point in stage.points]
    on_front = front([(point.times.seconds, share) for point, share in zip(stage.points, shares, strict=True)])
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
                "share_of_noise_variance": share,
                "on_front": best,
            }
            for point, share, best in zip(stage.points, shares, on_front, strict=True)
        ],
    }
