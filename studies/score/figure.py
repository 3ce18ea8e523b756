"""A figure of merit: what a closed form says, and what repeated measurements on simulated frames say."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import isfinite, nan

import numpy as np
import scipy

REPEATS = 8  # measurements, each of a fresh chip
CONFIDENCE = 0.95


@dataclass(frozen=True)
class Merit:
    """One figure of merit of a camera.

    Attributes
    ----------
    name : str
        By which `only` asks for it, such as ``iso_12232.noise_speed_10``.
    title, unit : str
    standard : str
        Which document defines it, with the clause where it has one.
    conditions : str
        What was photographed, and how each choice was made that the standard leaves open.
    computed : float
        In closed form.
    measured, low, high : float
        Mean over simulated measurements, and the limits of its interval of `CONFIDENCE`; nan limits of a figure that
        EMVA 1288 derives from others.
    """

    name: str
    title: str
    unit: str
    standard: str
    conditions: str
    computed: float
    measured: float
    low: float
    high: float

    @property
    def agrees(self) -> bool | None:
        """Whether the closed form lies within the measurement's interval; None where there is no interval."""
        return self.low <= self.computed <= self.high if isfinite(self.low) else None


@dataclass(frozen=True)
class Definition:
    """A figure of merit before it is measured.

    Attributes
    ----------
    name, title, unit, standard, conditions
        As of `Merit`.
    computed : float
    measure : callable
        Takes a generator, measures the figure once on frames of a fresh chip, and returns it.
    """

    name: str
    title: str
    unit: str
    standard: str
    conditions: str
    computed: float
    measure: Callable[[np.random.Generator], float]


def measured(definition: Definition, seed: int) -> Merit:
    """Measure a figure `REPEATS` times, and give the mean with its interval by Student's t distribution."""
    if not isfinite(definition.computed):
        return _score(definition, [])
    # A stream per name, so that a figure doesn't depend on which others are asked for.
    name_key = int.from_bytes(definition.name.encode(), "little") % 2**63
    values = [
        definition.measure(np.random.default_rng(np.random.SeedSequence((seed, name_key, repeat))))
        for repeat in range(REPEATS)
    ]
    return _score(definition, values)


def _score(definition: Definition, values: Sequence[float]) -> Merit:
    mean, half = nan, nan
    if values and np.isfinite(values).all():
        mean = float(np.mean(values))
        spread = float(np.std(values, ddof=1)) / len(values) ** 0.5
        half = spread * float(scipy.stats.t.ppf((1 + CONFIDENCE) / 2, len(values) - 1))
    stated = {key: getattr(definition, key) for key in ("name", "title", "unit", "standard", "conditions", "computed")}
    return Merit(**stated, measured=mean, low=mean - half, high=mean + half)
