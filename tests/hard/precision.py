"""A search for the parameters at which a stage in single precision errs most."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from hard.case import Margin, worse, worst_of
from numpy.typing import ArrayLike

TRIES = 32  # random parameters of the first round
CLIMBS = 32  # steps from the worst found so far, ever shorter
FIRST_STEP, LAST_STEP = 0.3, 0.02  # of each parameter's range

Parameters = Mapping[str, float]


@dataclass(frozen=True)
class Found:
    """Errors of one stage at one set of parameters.

    Attributes
    ----------
    error_e, noise_e : float
        Error and the sensor's noise [e-] at the pixel where their ratio is largest.
    bound : Margin
        Error and the bound that the stage's arithmetic gives, at the pixel where their ratio is largest.
    """

    error_e: float
    noise_e: float
    bound: Margin

    @property
    def share_of_noise(self) -> float:
        """Error over noise."""
        return self.error_e / self.noise_e


@dataclass(frozen=True)
class Stage:
    """A step of the chain that runs in single precision.

    Attributes
    ----------
    name, bound : str
        The latter: the bound in words.
    ranges : mapping of str to (float, float)
        Parameters of the search, each over a range on a logarithmic scale.
    measure : callable
        Errors at parameters of the search.
    """

    name: str
    bound: str
    ranges: Mapping[str, tuple[float, float]]
    measure: Callable[[Parameters], Found]


@dataclass(frozen=True)
class Worst:
    """What a search found: the parameters with the largest error over noise, and the largest error over its bound."""

    stage: Stage
    parameters: Parameters
    found: Found
    bound: Margin
    tried: int


def beside_noise(error_e: ArrayLike, noise_e: ArrayLike, bound_e: ArrayLike) -> Found:
    """Largest error over noise, and over its bound, of arrays of one shape [e-]."""
    error = np.abs(np.asarray(error_e, dtype=np.float64)).ravel()
    noise, bound = (np.broadcast_to(np.asarray(a), np.shape(error_e)).ravel() for a in (noise_e, bound_e))
    index = int(np.argmax(error / noise))
    return Found(float(error[index]), float(noise[index]), worst_of(error, bound, "e⁻"))


def search(stage: Stage, rng: np.random.Generator, tries: int = TRIES, climbs: int = CLIMBS) -> Worst:
    """Random parameters first, then steps from the worst ones; a step is kept where it is worse still."""
    best = None
    best_position = np.zeros(len(stage.ranges))  # in the unit cube
    bound = Margin(0.0, 1.0, "e⁻")
    steps = np.geomspace(FIRST_STEP, LAST_STEP, climbs)
    for number in range(tries + climbs):
        position = rng.random(len(stage.ranges))
        if number >= tries:
            step = steps[number - tries] * rng.standard_normal(position.size)
            position = np.clip(best_position + step, 0.0, 1.0)
        found = stage.measure(_parameters(stage, position))
        bound = worse(bound, found.bound)
        if best is None or found.share_of_noise > best.share_of_noise:
            best, best_position = found, position
    return Worst(stage, _parameters(stage, best_position), best, bound, tries + climbs)


def _parameters(stage: Stage, position: np.ndarray) -> dict[str, float]:
    """Parameters at a position in the unit cube."""
    ends = zip(stage.ranges.items(), position, strict=True)
    return {name: float(low * (high / low) ** share) for (name, (low, high)), share in ends}
