"""Patches under black: a component knows readings along a line in the root u of a signal, which falls under black.

Samples read t(m g u^2), a curve. Each sample, and the pilot, is moved by the line less the curve at the last estimate
of u, 0 or more: there the line is right. After `ROUNDS` the patch is t at the last u.
"""

from functools import lru_cache
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from isp.ple.tables import Table
from isp.ple.units import readings
from rodcone.types import Singles

ROUNDS = 4
TOGETHER = 100  # patches, so that arrays are small ones to malloc: others are fresh memory each time


def on_the_curve(
    components: Table, component: NDArray[np.int16], evidence: Singles, noise: Singles, straight: Singles
) -> Singles:
    """Bring estimates of patches to the curve of their readings.

    Parameters
    ----------
    components : Table
    component : (patch,) int16
        Sorted.
    evidence, noise : as for `isp.ple.pick.pick`
    straight : (patch, value) float32
        Estimates by `Estimator.linear`; it is overwritten.

    Returns
    -------
    (patch, value) float32
        Over black, times the window.
    """
    taper, dark_e = components.taper, components.sampling.dark_e
    average = components.average.T.astype(np.float32)
    slope, start = (part[component] for part in components.roots)
    bounds = np.flatnonzero(np.diff(component, prepend=-1, append=-1)).tolist()
    parts = [(slice(*ends), int(component[ends[0]])) for ends in pairwise(bounds)]
    sure = np.concatenate([1.0 / (noise[part, None] + components.whitening(k).spread) for part, k in parts]).astype(
        np.float32
    )
    for _ in range(ROUNDS):
        bend = straight / taper
        bend -= over_black(straight * slope + start, dark_e)
        rows = evidence.copy()
        rows[:, : len(components.rows)] += bend[:, components.rows]
        rows[:, -4:] += bend @ average
        for part, k in parts:
            rows[part, -4:] = rows[part] @ components.whitening(k).reads[:, -4:] * sure[part]
            np.matmul(rows[part], components.estimator(k).linear, out=straight[part])
    return over_black(straight * slope + start, dark_e) * taper


def over_black(roots: Singles, dark_e: tuple[float, ...]) -> Singles:
    """Return mean readings less those of black, from twice the roots of expected electrons, channels in turn.

    A negative root counts as 0. The result overwrites `roots`.
    """
    bases, steps, firsts, offsets = _side_by_side(dark_e, roots.shape[1] // len(dark_e))
    # clip is three times as fast as minimum and maximum
    over = np.clip(roots, 0.0, np.inf, out=roots)
    places = over * steps
    np.clip(places, 0.0, offsets.size // len(dark_e) - 1, out=places)
    places += firsts
    np.square(over, out=over)
    over += bases
    np.sqrt(over, out=over)
    over += offsets.take(places.astype(np.intp))
    return over


@lru_cache(maxsize=256)
def _side_by_side(dark_e: tuple[float, ...], repeats: int) -> tuple[Singles, ...]:
    """Return what `over_black` needs for each value, and all steps of `Readings.offset` less black.

    For each value that is 4 d^2 + 1/2, the number of steps per unit of twice a root, and its channel's first step.
    """
    curves = [readings(noise_e) for noise_e in dark_e]
    black = np.array([curve.mean(np.zeros(1))[0] for curve in curves])
    offsets = np.stack([curve.offset for curve in curves])
    bases = (black - offsets[:, 0]) ** 2
    count = offsets.shape[1]
    steps = [(count - 1) / (2.0 * curve.most[0]) for curve in curves]
    firsts = count * np.arange(len(curves)) + 0.5
    by_value = np.tile([bases, steps, firsts], repeats).astype(np.float32)
    return *by_value, (offsets - black[:, None]).astype(np.float32).ravel()
