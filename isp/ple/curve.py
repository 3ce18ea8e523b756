"""Patches whose linear estimate falls below black are estimated again, on the curve that their samples really follow.

A component's estimate assumes that mean readings t lie on a straight line in the root u of the signal
(`isp.ple.tables`). In the dark this line falls below the reading of no light, whereas the true readings t(m g u^2) lie
on a curve that ends there. Therefore each sample, and the pilot, is moved by the line minus the curve at the last
estimate of u (0 if that is negative). At this u the line is then right, and the linear estimate is computed anew. After
`ROUNDS` such rounds the result is t at the last u.
"""

from functools import lru_cache
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from isp.ple.tables import Table
from isp.ple.units import readings
from rodcone.types import Singles

ROUNDS = 4
TOGETHER = 100  # patches estimated together: few, because malloc fetches fresh memory for each large array


def on_the_curve(
    components: Table, component: NDArray[np.int16], evidence: Singles, noise: Singles, straight: Singles
) -> Singles:
    """Estimate patches anew, so that the estimates lie on the curve of readings.

    Parameters
    ----------
    components : Table
        Components at the patches' light.
    component : (patch,) int16
        Number of each patch's component, sorted.
    evidence, noise : as for `isp.ple.pick.pick`
        With a pilot.
    straight : (patch, value) float32
        Estimates by `Estimator.linear`; it is overwritten.

    Returns
    -------
    (patch, value) float32
        Mean readings minus those of black, times the window.
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
    """Compute mean readings minus those of black, from twice the roots of expected electrons.

    The columns of `roots` belong to the channels in turn, whose dark noises are `dark_e`. A negative root counts as 0.
    The result overwrites `roots`.
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
    """Return three constants per value of a patch for `over_black`, and the curves `Readings.offset` minus black.

    The constants are 4 d^2 + 1/2 (d as in `isp.ple.units`), the number of the curve's steps per unit of twice a root,
    and the index of the first step of the value's channel, plus 1/2 for rounding. `repeats` is the number of pixels.
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
