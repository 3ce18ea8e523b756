"""Single against double precision, stage by stage: the worst case, found by a search."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from studies.stress_case import Margin

TRIES = 32  # random places of the first round
CLIMBS = 32  # steps from the worst place found so far, ever shorter
FIRST_STEP, LAST_STEP = 0.3, 0.02  # of each parameter's range

Parameters = Mapping[str, float]


@dataclass(frozen=True)
class Found:
    """Where one stage's error is largest beside the sensor's noise.

    Attributes
    ----------
    error_e, noise_e : float
        Error and noise there [e-].
    bound : Margin
        Largest error beside the bound that the stage's arithmetic gives, at the place where it comes nearest.
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
        Error at a place of the search.
    """

    name: str
    bound: str
    ranges: Mapping[str, tuple[float, float]]
    measure: Callable[[Parameters], Found]


@dataclass(frozen=True)
class Worst:
    """The worst place that a search found: the largest error beside noise, and the nearest to its bound."""

    stage: Stage
    place: Parameters
    found: Found
    bound: Margin
    tried: int


def beside_noise(error_e: ArrayLike, noise_e: ArrayLike, bound_e: ArrayLike) -> Found:
    """Largest error beside noise, and beside its bound, of arrays of one shape [e-]."""
    error = np.abs(np.asarray(error_e, dtype=np.float64)).ravel()
    noise, bound = (np.broadcast_to(np.asarray(a), np.shape(error_e)).ravel() for a in (noise_e, bound_e))
    at = int(np.argmax(error / noise))
    near = int(np.argmax(error / bound))
    return Found(float(error[at]), float(noise[at]), Margin(float(error[near]), float(bound[near]), "e⁻"))


def search(stage: Stage, rng: np.random.Generator, tries: int = TRIES, climbs: int = CLIMBS) -> Worst:
    """Random places first, then steps from the worst one; a step is kept where it is worse still."""
    best, place, bound = None, np.zeros(0), Margin(0.0, 1.0, "e⁻")
    steps = np.geomspace(FIRST_STEP, LAST_STEP, climbs)
    for number in range(tries + climbs):
        tried = rng.random(len(stage.ranges))
        if number >= tries:
            tried = np.clip(place + steps[number - tries] * rng.standard_normal(place.size), 0.0, 1.0)
        found = stage.measure(_at(stage, tried))
        bound = max(bound, found.bound, key=lambda margin: margin.share)
        if best is None or found.share_of_noise > best.share_of_noise:
            best, place = found, tried
    assert best is not None
    return Worst(stage, _at(stage, place), best, bound, tries + climbs)


def run_stages(stages: Sequence[Stage], step: Callable[[str, float], None] = lambda what, share: None) -> list[Worst]:
    """Search each stage, each with draws of its own."""
    found = []
    for number, stage in enumerate(stages):
        step(f"single precision, {stage.name}", number / len(stages))
        found.append(search(stage, np.random.default_rng([8, number])))
    return found


def _at(stage: Stage, place: np.ndarray) -> dict[str, float]:
    """Parameters at a place of the unit cube."""
    ends = zip(stage.ranges.items(), place, strict=True)
    return {name: float(low * (high / low) ** share) for (name, (low, high)), share in ends}
