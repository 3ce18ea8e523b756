"""The ramp that a camera's columns share: how much they disturb it when they convert, from pairs of flat frames.

By the model of `sensor.readout.shared_ramp_e`, the signal behind a reading y is x = y - step F(y) + rise I(y). F is the
share of the row's columns that read less than y, and I is its integral up to y. The right two numbers make K the same
under each light, and for dim and bright pixels of a row. K is the variance of x, less read noise's, over its mean.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from rodcone.types import Floats
from sensor.emva1288.estimators import QUANTISATION_DN2

GROUPS = 10  # groups of pixels from dim to bright within their rows
LEAST_LIGHTS = 6  # least number of lights, of which half are fitted
MOST_LEFT = 0.5  # largest share of the misfit that may be left under the lights and in the rows that weren't fitted
MOST_RISE = 10.0


@dataclass(frozen=True)
class Ramp:
    """How columns disturb the ramp that they share.

    Attributes
    ----------
    step_dn, rise : float
        `PixelConfig.ramp_step_e` in DN, and `PixelConfig.ramp_rise`.
    gain_dn_per_e : float
        K of the signals before the ramp.
    before, left : float
        Root mean square deviation of K from its mean, over the lights and rows that weren't fitted, without and with
        the ramp.
    """

    step_dn: float
    rise: float
    gain_dn_per_e: float
    before: float
    left: float


@dataclass(frozen=True)
class _Moments:
    """Moments of y, F and I under one light, by half of the rows and group of pixels.

    Attributes
    ----------
    variance_dn2 : (half, group, 3, 3) float64
        Temporal covariances, without those of rounding.
    mean_dn : (half, group, 3) float64
    """

    variance_dn2: Floats
    mean_dn: Floats

    def noise_dn2(self, weights: Floats) -> Floats:
        """Return the temporal variance of a weighted sum of y, F and I [DN^2], (half, group)."""
        return np.asarray(np.einsum("hgij,i,j->hg", self.variance_dn2, weights, weights))


def ramp_of(
    lights: Sequence[Sequence[NDArray[Any]]], dark: Sequence[NDArray[Any]], flat: Floats, white_dn: float
) -> Ramp | None:
    """Fit a ramp to pairs of frames; return None if it doesn't make K even where it wasn't fitted.

    Every other light is fitted in the upper half of the rows, and the other lights are judged in the lower half.

    Parameters
    ----------
    lights : sequence of pairs of (h, w) arrays
        Two frames under each light, from dim to bright, far from clipping, of a camera without a mosaic.
    dark : pair of (h, w) arrays
        Two frames in the dark, whose noise, before the ramp, is subtracted from that under each light.
    flat : (h, w) float64
        Mean of many flat frames, which says which pixels of a row are bright.
    white_dn : float
        Largest reading.
    """
    if len(lights) < LEAST_LIGHTS:
        return None
    within_rows = flat - flat.mean(axis=1, keepdims=True)
    groups = np.digitize(within_rows, np.quantile(within_rows, np.arange(1, GROUPS) / GROUPS))
    moments = [_moments(pair, groups, int(white_dn)) for pair in lights]
    in_dark = _moments(dark, groups, int(white_dn))

    def gains(numbers: Floats, first: int) -> Floats:
        """Return K of half of the lights, in half of the rows, by group."""
        weights = np.array([1.0, -numbers[0], numbers[1]])
        black, read_dn2 = (in_dark.mean_dn @ weights).mean(), in_dark.noise_dn2(weights).mean()
        light = moments[first::2]
        signal = np.array([one.mean_dn[first] @ weights for one in light]) - black
        return np.asarray((np.array([one.noise_dn2(weights)[first] for one in light]) - max(read_dn2, 0.0)) / signal)

    def misfits(numbers: Floats, first: int) -> Floats:
        found = gains(numbers, first)
        return np.asarray((found / found.mean() - 1).ravel())

    bounds = ([0.0, 0.0], [np.inf, MOST_RISE])
    best = np.asarray(least_squares(lambda numbers: misfits(numbers, 0), [0.01, 0.01], bounds=bounds).x)
    before, left = (float(np.mean(misfits(numbers, 1) ** 2)) for numbers in (np.zeros(2), best))
    if not left < MOST_LEFT * before:
        return None
    gain = float(np.mean([gains(best, first).mean() for first in (0, 1)]))
    return Ramp(float(best[0]), float(best[1]), gain, before**0.5, left**0.5)


def _moments(pair: Sequence[NDArray[Any]], groups: NDArray[np.intp], most: int) -> _Moments:
    """Compute the moments of a pair of frames of one light."""
    (first, first_slopes), (second, second_slopes) = (_terms(frame, most) for frame in pair[:2])
    changes = first - second
    changes -= changes.mean(axis=(1, 2), keepdims=True)  # of light
    means = (first + second) / 2
    halves = np.array_split(np.arange(groups.shape[0]), 2)
    shape = len(halves), GROUPS, 3
    variance, mean = np.empty((*shape, 3)), np.empty(shape)
    for half, rows in enumerate(halves):
        for group in range(GROUPS):
            chosen = groups[rows] == group
            change, slopes = changes[:, rows][:, chosen], [x[:, rows][:, chosen] for x in (first_slopes, second_slopes)]
            rounding = sum(slope @ slope.T for slope in slopes) / 2 * QUANTISATION_DN2
            variance[half, group] = (change @ change.T / 2 - rounding) / change.shape[1]
            mean[half, group] = means[:, rows][:, chosen].mean(axis=1)
    return _Moments(variance, mean)


def _terms(frame: NDArray[Any], most: int) -> tuple[Floats, Floats]:
    """Return y, F and I of each pixel, and their slopes over y; both (3, h, w)."""
    dn = frame.astype(np.int64)
    counts = np.array([np.bincount(row, minlength=most + 1) for row in dn]) / frame.shape[1]
    share = np.cumsum(counts, axis=1) - counts / 2
    integral = np.cumsum(share, axis=1) - share / 2
    terms = [np.take_along_axis(term, dn, axis=1) for term in (share, integral)]
    slopes = [np.take_along_axis(np.gradient(term, axis=1), dn, axis=1) for term in (share, integral)]
    return np.stack([dn.astype(np.float64), *terms]), np.stack([np.ones(dn.shape), *slopes])
