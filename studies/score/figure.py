"""A figure of merit: its value by formula, and its value by repeated measurements on simulated frames."""

import zlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from math import isfinite, nan

import numpy as np
import scipy

REPEATS = 8  # number of measurements, each on fresh chips
CONFIDENCE = 0.95


@dataclass(frozen=True)
class Merit:
    """One figure of merit of a camera.

    Attributes
    ----------
    name : str
        Name for the argument `only` of `score`, such as ``iso_12232.noise_speed_10``.
    title, unit : str
    standard : str
        Document that defines it, with the clause where it has one.
    conditions : str
        What was photographed, and how each choice that the standard leaves open was made.
    computed : float
        Value by formula; nan if there is no formula for this camera, or for a processor.
    measured, low, high : float
        Mean over simulated measurements, and the limits of its confidence interval. All are nan before the measurement;
        the limits stay nan for a figure that EMVA 1288 derives from others.
    missing : str
        Why the camera doesn't have the figure; empty if it has the figure.
    """

    name: str
    title: str
    unit: str
    standard: str
    conditions: str
    computed: float
    measured: float = nan
    low: float = nan
    high: float = nan
    missing: str = ""

    @property
    def agrees(self) -> bool | None:
        """Return whether the computed value lies within the measurement's interval; None if either is missing."""
        return self.low <= self.computed <= self.high if isfinite(self.low) and isfinite(self.computed) else None


@dataclass(frozen=True)
class Definition:
    """Figures of merit that are measured together, on the same frames.

    Attributes
    ----------
    merits : tuple of Merit
        Figures that are computed, and not measured yet.
    measure : callable
        Function that makes one measurement on fresh chips with a random generator, and returns each figure's value. It
        isn't called if all figures are missing.
    """

    merits: tuple[Merit, ...]
    measure: Callable[[np.random.Generator], Sequence[float]]


def measured(definition: Definition, seed: int) -> list[Merit]:
    """Measure figures `REPEATS` times, and add each mean with its interval by Student's t distribution.

    Figures that the camera doesn't have are returned unchanged.
    """
    if all(merit.missing for merit in definition.merits):
        return list(definition.merits)
    seeds = [np.random.SeedSequence((seed, stream(definition.merits[0].name), repeat)) for repeat in range(REPEATS)]
    values = np.array([definition.measure(np.random.default_rng(one)) for one in seeds])
    means, spreads = values.mean(axis=0), values.std(axis=0, ddof=1)
    halves = scipy.stats.t.ppf((1 + CONFIDENCE) / 2, REPEATS - 1) * spreads / REPEATS**0.5
    return [
        merit if merit.missing else replace(merit, measured=mean, low=mean - half, high=mean + half)
        for merit, mean, half in zip(definition.merits, means.tolist(), halves.tolist(), strict=True)
    ]


def stream(name: str) -> int:
    """Return the number of a figure's own random stream, by which a figure doesn't depend on the others of a call.

    It is a hash of the whole name. If figures had a common stream, they would lie outside their intervals together.
    """
    return zlib.crc32(name.encode())


def not_measured(rng: np.random.Generator) -> list[float]:
    """Raise an error: this is the measurement of figures that the camera doesn't have, and is never called."""
    raise AssertionError("a missing figure is measured")


def without_noise_bias(whole: Sequence[float], first: Sequence[float], second: Sequence[float]) -> list[float]:
    """Extrapolate figures of the mean of n frames to no noise: 2 E(all) - (E(one half) + E(other half)) / 2.

    If a figure isn't linear in the frames, noise adds some b / n to that of the mean of all frames, and b / (n / 2) to
    that of the mean of either half.
    """
    return [2 * all_frames - (a + b) / 2 for all_frames, a, b in zip(whole, first, second, strict=True)]
