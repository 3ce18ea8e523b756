"""A figure of merit: what a closed form says, and what repeated measurements on simulated frames say."""

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
        Name by which `only` asks for it, such as ``iso_12232.noise_speed_10``.
    title, unit : str
    standard : str
        Document that defines it, with the clause where it has one.
    conditions : str
        What was photographed, and each choice that the standard leaves open.
    computed : float
        In closed form; nan where there is none: of the camera, or of what a processor does.
    measured, low, high : float
        Mean over simulated measurements, and the limits of its interval of `CONFIDENCE`; nan before it is measured, and
        the limits of a figure that EMVA 1288 derives from others.
    missing : str
        Why the camera doesn't have the figure; empty where it has it.
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
        """Return whether the closed form lies within the measurement's interval; None where either is missing."""
        return self.low <= self.computed <= self.high if isfinite(self.low) and isfinite(self.computed) else None


@dataclass(frozen=True)
class Definition:
    """Figures of merit that are measured together, on the same frames.

    Attributes
    ----------
    merits : tuple of Merit
        Computed, and not yet measured.
    measure : callable
        Takes a generator, and returns each figure as one measurement on fresh chips gives it. It isn't called where all
        figures are missing.
    """

    merits: tuple[Merit, ...]
    measure: Callable[[np.random.Generator], Sequence[float]]


def measured(definition: Definition, seed: int) -> list[Merit]:
    """Measure figures `REPEATS` times, and give each mean with its interval by Student's t distribution.

    Figures that the camera doesn't have come back as they are.
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
    """Return the number of a figure's own random stream, so that a figure doesn't depend on which others are asked for.

    It is a hash of the whole name, because figures with a common stream would miss their intervals together.
    """
    return zlib.crc32(name.encode())


def not_measured(rng: np.random.Generator) -> list[float]:
    """Stand in for the measurement of figures that the camera doesn't have."""
    raise AssertionError("a missing figure is measured")


def without_noise_bias(whole: Sequence[float], first: Sequence[float], second: Sequence[float]) -> list[float]:
    """Extrapolate figures of the mean of n frames to no noise: 2 E(all) - (E(one half) + E(other half)) / 2.

    Noise adds b / n to a figure that isn't linear in the frame, and b / (n / 2) to that of either half.
    """
    return [2 * all_frames - (a + b) / 2 for all_frames, a, b in zip(whole, first, second, strict=True)]
