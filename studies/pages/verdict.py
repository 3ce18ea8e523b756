"""Decide which of two pictures is ahead, by a lead's interval over seeds and by whether a person sees the lead."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rodcone.types import Floats
from studies.metrics.confidence import half_width
from studies.metrics.metric import DECIDING, METRICS, PSNR, Metric

AHEAD, LEVEL, BEHIND, UNKNOWN = "ahead", "level", "behind", "unknown"
OUTCOMES = (AHEAD, LEVEL, BEHIND)

Figures = Mapping[str, Floats]  # by a metric's key, (level, seed); NaN where a figure is unknown


@dataclass(frozen=True)
class Leads:
    """Leads of one picture over another, arrays of one shape.

    Attributes
    ----------
    mean : array
        Mean lead over the seeds; it is positive if the first picture is better.
    half : array
        Half the width of the mean's 95 % interval (Student's t); NaN for one seed.
    outcome : array of str
        `AHEAD` or `BEHIND`: the interval doesn't contain 0, and a person sees the mean lead. `LEVEL`: a person sees no
        lead within the interval, or the interval doesn't contain 0 and a person doesn't see the mean lead. `UNKNOWN`:
        none of these, or there is only one seed.
    """

    mean: Floats
    half: Floats
    outcome: NDArray[np.str_]


def leads(metric: Metric, ours: Floats, theirs: Floats) -> Leads:
    """Compare the figures (..., seed) of two pictures; if one seed's figure is NaN, the outcome is unknown."""
    difference = (1.0 if metric.higher else -1.0) * (ours - theirs)
    mean = difference.mean(axis=-1)
    half = half_width(difference)
    size = np.abs(mean)
    clear = size > half
    visible = size >= metric.threshold
    invisible = size + half < metric.threshold
    cases = [np.isnan(half), clear & visible & (mean > 0), clear & visible, clear | invisible]
    return Leads(mean, half, np.select(cases, [UNKNOWN, AHEAD, BEHIND, LEVEL], UNKNOWN))


def same_light(ours: Figures, theirs: Figures) -> list[list[int]]:
    """Group neighbouring light levels into runs within which a person sees no change in either side's picture.

    Each level is compared with the first one of its run, by the metrics in `DECIDING`.
    """
    runs: list[list[int]] = []
    sides = [side[metric.key].mean(axis=-1) / metric.threshold for metric in DECIDING for side in (ours, theirs)]
    figures = np.nan_to_num(np.array(sides), nan=np.inf, posinf=np.inf).T
    for level, now in enumerate(figures):
        before = figures[runs[-1][0]] if runs else None
        if before is not None and np.isfinite(now).all() and (np.abs(now - before) < 1).all():
            runs[-1].append(level)
        else:
            runs.append([level])
    return runs


def counts(ours: Figures, theirs: Figures) -> dict[str, dict[str, int]]:
    """Count light levels by metric and outcome; a run of levels from `same_light` counts once, by its mean figures."""
    runs = same_light(ours, theirs)
    counted = {}
    for metric in METRICS:
        sides = (np.array([side[metric.key][run].mean(axis=0) for run in runs]) for side in (ours, theirs))
        outcomes = leads(metric, *sides).outcome.tolist()
        counted[metric.key] = {outcome: outcomes.count(outcome) for outcome in (*OUTCOMES, UNKNOWN)}
    return counted


def light_ratio(light_cd_m2: Sequence[float], better: Floats, worse: Floats) -> Floats:
    """Return the factor on each level's light with which `worse` has the PSNR of `better`, interpolated between levels.

    Parameters
    ----------
    light_cd_m2 : sequence of float
        Luminance of the levels, rising.
    better, worse : (level, seed) float64
        PSNR [dB].

    Returns
    -------
    (level, 3) float64
        The factor and the ends of its 95 % interval over seeds. They are NaN for one seed, if some seed's PSNR is
        reached at no level of the sweep, and at levels where more light no longer improves `worse` visibly.

    Notes
    -----
    PSNR is interpolated linearly in the logarithm of the light. If a PSNR is reached at several places, the nearest to
    the level counts. The interval is Student's, for the logarithms.
    """
    x = np.log(np.asarray(light_cd_m2, dtype=np.float64))
    rises = np.diff(worse.mean(axis=1)) >= PSNR.threshold
    logs = np.array(
        [
            [_offset(x, curve, wanted, level, rises) for curve, wanted in zip(worse.T, better[level], strict=True)]
            for level in range(len(x))
        ]
    )
    half = half_width(logs)
    mean = np.where(np.isnan(half), np.nan, logs.mean(axis=1))
    return np.asarray(np.exp(np.stack([mean, mean - half, mean + half], axis=1)))


def _offset(x: Floats, curve: Floats, target: float, level: int, rises: NDArray[np.bool_]) -> float:
    """Return the distance in log light from a level to the nearest place where a curve has the value `target`.

    It is NaN if the curve never has that value.
    """
    places = [
        x[i] + (target - curve[i]) / (curve[i + 1] - curve[i]) * (x[i + 1] - x[i])
        for i in np.flatnonzero(rises)
        if curve[i] <= target <= curve[i + 1] and curve[i] < curve[i + 1]
    ]
    return min((place - x[level] for place in places), key=abs, default=float("nan"))
