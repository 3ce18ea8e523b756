"""Samples in units of noise: the transform to readings, the mean reading of expected electrons, and its inverse.

The transform is the generalised Anscombe transform (`isp.anscombe`) for `LIFT` times the dark noise s. It is steepest
below 0 electrons. A sample far below 0 would therefore be moved even farther from its neighbours, and would become a
dark speck in the estimate. Therefore samples below -`FLOOR` s count as -`FLOOR` s.

Mean and variance of a reading t(X) follow from the distribution of the sample X around e expected electrons,

    X = e + v (z + k (z^2 - 1) / 6),   v^2 = e + s^2,   k = e / v^3,   z normal,

which has the mean, variance and skewness of shot and dark noise (Cornish & Fisher 1938). For s below 1 e- they are sums
over Poisson's counts instead. In bright light the mean is 2 sqrt(e + d^2 + 1/8) with d = `LIFT` s, and the variance 1.
"""

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from isp.anscombe import stabilise
from rodcone.types import Floats

# With the dark noise itself the transform turns dark samples into outliers; with twice the noise it is nearly straight.
LIFT = 2.0
FLOOR = 0.7  # how far below 0 e- the smallest sample may lie [dark noises]
_KNOTS, _STEPS = 200, 8192  # points at which the curves are computed, and entries of the tables that interpolate them
_LARGEST_ROOT = 8.0  # root of electrons over dark noise (at least 1 e-) from which on curves keep their last value
_FEWEST = np.finfo(np.float64).tiny
_NORMAL = np.linspace(-6.0, 6.0, 193)


@dataclass(frozen=True, eq=False)
class Readings:
    """Mean, slope and variance of readings as functions of expected electrons e, and the mean's inverse.

    Attributes
    ----------
    dark_e : float
        Dark noise s [e-].
    most : (2,) tuple of float
        sqrt(e) at which the first three curves end, and the mean reading there, at which `excess` ends.
    offset, steepness, variances : (step,) float64
        Curves in equal steps of sqrt(e), with R = sqrt(e + d^2 + 1/8): the mean minus 2 R, the slope times R, and the
        variance divided by (e + s^2 + 1/8) / R^2.
    excess : (step,) float64
        Curve in equal steps of the mean reading t: electrons minus (t^2 / 4 - d^2 - 1/8).
    """

    dark_e: float
    most: tuple[float, float]
    offset: Floats
    steepness: Floats
    variances: Floats
    excess: Floats

    def mean(self, electrons: NDArray[Any]) -> Floats:
        """Return the mean reading of expected electrons, which are 0 or more."""
        return 2.0 * _limit(electrons, self.dark_e) + self.offset[self._step(electrons)]

    def slope(self, electrons: NDArray[Any]) -> Floats:
        """Return the slope of the mean reading over expected electrons [1/e-]."""
        return self.steepness[self._step(electrons)] / _limit(electrons, self.dark_e)

    def variance(self, electrons: NDArray[Any]) -> Floats:
        """Return the variance of a reading that comes from shot and dark noise."""
        return np.asarray(self.variances[self._step(electrons)] * _straight(electrons, self.dark_e))

    def moments(self, electrons: NDArray[Any]) -> tuple[Floats, Floats, Floats]:
        """Return the mean, slope and variance of a reading together."""
        limit = _limit(electrons, self.dark_e)
        step = self._step(electrons)
        straight = _straight(electrons, self.dark_e)
        return 2.0 * limit + self.offset[step], self.steepness[step] / limit, self.variances[step] * straight

    def electrons(self, readings: NDArray[Any]) -> Floats:
        """Return the electrons whose mean reading this is; negative below the mean reading of 0 electrons."""
        values = np.maximum(readings, 0.0)
        plain = 0.25 * np.square(values, dtype=np.float64) - ((LIFT * self.dark_e) ** 2 + 0.125)
        return np.asarray(plain + self.excess[_nearest(values, self.most[1])])

    def _step(self, electrons: NDArray[Any]) -> NDArray[np.intp]:
        return _nearest(np.sqrt(electrons), self.most[0])


def transform(electrons: NDArray[Any], dark_e: float) -> NDArray[Any]:
    """Transform samples [e-] to readings, in the samples' own type."""
    return stabilise(np.maximum(electrons, electrons.dtype.type(-FLOOR * dark_e)), LIFT * dark_e, 0.0)


@lru_cache(maxsize=256)
def readings(dark_e: float) -> Readings:
    """Tabulate mean, slope and variance of a transformed sample over expected electrons, and the mean's inverse.

    They hold for one dark noise [e-]. Below 1 e- they are sums over Poisson's counts, from there on over the skewed
    normal distribution of the module's text.
    """
    roots = np.linspace(0.0, _LARGEST_ROOT * max(dark_e, 1.0), _KNOTS)
    electrons = roots[:, None] ** 2
    density = np.exp(-0.5 * _NORMAL**2)
    density /= density.sum()
    if dark_e < 1.0:
        counts = np.arange(2 * electrons[-1, 0])
        factorials = np.concatenate([[0.0], np.cumsum(np.log(counts[1:]))])  # logarithms of the factorials
        # Without electrons, the logarithm is so low that every count but 0 has a share of 0.
        shares = np.exp(counts * np.log(np.maximum(electrons, _FEWEST)) - electrons - factorials)
        values = transform(counts[:, None] + dark_e * _NORMAL, dark_e)
    else:
        spread = np.sqrt(electrons + dark_e**2)
        skewness = electrons / spread**3
        shares = np.eye(_KNOTS)
        values = transform(electrons + spread * (_NORMAL + skewness / 6 * (_NORMAL**2 - 1)), dark_e)
    mean, square = (shares @ (values**power @ density) for power in (1, 2))
    # From knots to steps of equal length, over roots and over readings.
    limit = _limit(electrons[:, 0], dark_e)
    curves = (
        mean - 2 * limit,
        np.gradient(mean, electrons[:, 0]) * limit,
        (square - mean**2) / _straight(electrons[:, 0], dark_e),
    )
    most = float(roots[-1]), float(mean[-1])
    at_roots, at_readings = (np.linspace(0.0, end, _STEPS) for end in most)
    plain = 0.25 * mean**2 - ((LIFT * dark_e) ** 2 + 0.125)
    offset, steepness, variances = (np.interp(at_roots, roots, curve) for curve in curves)
    return Readings(dark_e, most, offset, steepness, variances, np.interp(at_readings, mean, electrons[:, 0] - plain))


def _limit(electrons: NDArray[Any], dark_e: float) -> Floats:
    """Return sqrt(e + d^2 + 1/8), which is half of the mean reading in bright light."""
    return np.asarray(np.sqrt(np.asarray(electrons, np.float64) + ((LIFT * dark_e) ** 2 + 0.125)))


def _straight(electrons: NDArray[Any], dark_e: float) -> NDArray[Any]:
    """Return the variance that a reading would have if the transform were straight."""
    base = electrons + (dark_e**2 + 0.125)
    return np.asarray(base / (base + (LIFT**2 - 1) * dark_e**2))


def _nearest(values: NDArray[Any], most: float) -> NDArray[np.intp]:
    """Return the index of the nearest of `_STEPS` steps from 0 to `most`; beyond `most`, the last one."""
    steps = values * values.dtype.type((_STEPS - 1) / most) + values.dtype.type(0.5)
    return np.asarray(np.minimum(steps, values.dtype.type(_STEPS - 1)).astype(np.intp))
