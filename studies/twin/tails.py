"""Tails of a camera's dark noise: how far its histogram exceeds a normal one, and the random telegraph noise in it.

In the model of `sensor.pixel.PixelConfig.telegraph_e` some pixels have a trap; over these the height of the jumps is
exponentially distributed with the mean A. The state of a trap is random in each frame. So two frames of a pixel with a
trap differ by 0, 1 or 2 heights, up or down, with the probabilities 3/8, 1/2 and 1/8. Besides normal noise the
differences therefore have, for the share s of pixels with a trap, Laplace distributions with the scales A and 2 A.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import exp, log, sqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize
from scipy.special import expit, log_ndtr, logit, ndtr

from rodcone.types import Floats
from sensor.cameras.numbers import SourcedValue
from sensor.emva1288.from_frames import NORMAL_95, Interval

BLOCKS = 16  # the rows are divided into this many blocks; errors follow from leaving out one block after the other
LEAST_TOLD = 4.0  # tails count above this many standard errors; by chance at most 1 camera in 1e4 has such tails
LEAST_NOISE_DN = 0.7  # below this noise, rounding alone makes the histogram differ from a normal one
MOST_SHARE = 0.5  # if more than this share of pixels may have a trap, pixels differ in their normal noise instead


@dataclass(frozen=True)
class Telegraph:
    """Share of pixels with a trap, and the mean height of their jumps [DN]."""

    share: Interval
    height_dn: Interval


def noise_histograms(frames: Sequence[NDArray[Any]]) -> Floats:
    """Count the absolute differences between pairs of frames, pixel by pixel, (block of rows, difference in DN)."""
    pairs = [np.abs(a.astype(np.int32) - b) for a, b in zip(frames[::2], frames[1::2], strict=False)]
    most = max(int(pair.max()) for pair in pairs) + 1
    parts = [np.array_split(pair, BLOCKS) for pair in pairs]
    counts = [[np.bincount(part[n].ravel(), minlength=most) for part in parts] for n in range(BLOCKS)]
    return np.asarray(np.sum(counts, axis=1), dtype=np.float64)


def is_rounding(histograms: Floats) -> bool:
    """Return whether the noise is so small that rounding alone shapes the histogram."""
    return sqrt(_moment(histograms.sum(axis=0), 2)) < sqrt(2) * LEAST_NOISE_DN


def excess_kurtosis(histograms: Floats) -> tuple[float, float]:
    """Return the excess kurtosis of the differences, 0 for normal noise, and its standard error for normal noise."""
    whole = histograms.sum(axis=0)
    return _moment(whole, 4) / _moment(whole, 2) ** 2 - 3.0, sqrt(24 / float(whole.sum()))


def tail_ratio(histograms: Floats) -> tuple[float, float]:
    """Return the mean square of the differences over the square of their mean size, and its standard error.

    It is pi / 2 for normal noise, and more with tails (Geary 1935). The kurtosis of noise with tails depends on few
    pixels, so that it differs by a factor of two from one chip to the next; this ratio doesn't.
    """
    return _with_error(histograms, lambda counts: np.array([_moment(counts, 2) / _moment(counts, 1) ** 2]))[0]


def telegraph_of(histograms: Floats) -> Telegraph | None:
    """Fit random telegraph noise to the differences; return None if there is none.

    There is none if the tails can't be distinguished from those of normal noise or of rounding, or if the interval of
    the share of pixels with a trap reaches beyond `MOST_SHARE`.
    """
    excess, error = excess_kurtosis(histograms)
    whole = histograms.sum(axis=0)
    spread = sqrt(_moment(whole, 2))
    if not excess > LEAST_TOLD * error or is_rounding(histograms):
        return None
    best = _fit(whole, np.array([log(0.8 * spread), logit(0.1), log(spread)]))
    *_, share, height = _with_error(histograms, lambda counts: _fit(counts, best))
    ends = [[value + side * NORMAL_95 * error for side in (0, -1, 1)] for value, error in (share, height)]
    if expit(ends[0][2]) > MOST_SHARE:
        return None
    return Telegraph(Interval(*(float(expit(x)) for x in ends[0])), Interval(*(exp(min(x, 700.0)) for x in ends[1])))


def telegraph_numbers(frames: Sequence[NDArray[Any]], gain_dn_per_e: float, most_e: float) -> dict[str, SourcedValue]:
    """Return a preset's numbers for the random telegraph noise in dark frames; return an empty dict without tails.

    The height in electrons is at most `most_e`.
    """
    found = telegraph_of(noise_histograms(frames))
    if found is None:
        return {}
    share, height_e = found.share.value, found.height_dn.value / gain_dn_per_e
    source = f"histogram of the differences of {len(frames)} dark frames"
    ends_e = [end / gain_dn_per_e for end in (found.height_dn.low, found.height_dn.high)]
    return {
        "telegraph_share": SourcedValue(share, f"{source}, {found.share.low:.2g} to {found.share.high:.2g}, 95 %"),
        "telegraph_e": SourcedValue(
            min(height_e, 0.999 * most_e / sqrt(share)), f"{source}, {ends_e[0]:.3g} to {ends_e[1]:.3g} e-, 95 %"
        ),
    }


def _moment(counts: Floats, order: int) -> float:
    return float(counts @ np.arange(counts.size, dtype=np.float64) ** order / counts.sum())


def _with_error(histograms: Floats, measured: Callable[[Floats], Floats]) -> list[tuple[float, float]]:
    """Measure the sum of all blocks; standard errors follow from leaving out one block at a time (the jackknife)."""
    whole = histograms.sum(axis=0)
    without = np.array([measured(whole - one) for one in histograms])
    errors = np.sqrt((BLOCKS - 1) * np.var(without, axis=0))
    return list(zip(measured(whole).tolist(), errors.tolist(), strict=True))


def _fit(counts: Floats, start: Floats) -> Floats:
    """Return the most likely logarithm of the normal noise's spread, logit of the share and logarithm of the height."""

    def loss(numbers: Floats) -> float:
        spread, height = np.exp(numbers[[0, 2]])  # heights far below the spread can't be found
        return -float(counts @ np.log(_shares(counts.size, spread, expit(numbers[1]), max(height, spread / 50))))

    return np.asarray(minimize(loss, start, method="Nelder-Mead", options={"xatol": 1e-3, "fatol": 1e-2}).x)


def _shares(size: int, spread: float, share: float, height: float) -> Floats:
    """Compute the share of differences of each size in DN; the last one includes all larger sizes."""
    edges = np.arange(size, dtype=np.float64) - 0.5
    edges[0] = 0.0
    beyond = 2 * (1 - 5 / 8 * share) * ndtr(-edges / spread)
    for weight, scale in ((share / 2, height), (share / 8, 2 * height)):
        beyond += 2 * weight * _normal_laplace(edges, spread, scale)
    return np.asarray(np.maximum(-np.diff(beyond, append=0.0), 1e-300))


def _normal_laplace(edges: Floats, spread: float, scale: float) -> Floats:
    """Compute the probability that the sum of normal noise and Laplace-distributed noise lies above each edge."""
    ratio = spread / scale
    above = ratio**2 / 2 - edges / scale + log_ndtr(edges / spread - ratio)
    below = ratio**2 / 2 + edges / scale + log_ndtr(-edges / spread - ratio)
    return np.asarray(ndtr(-edges / spread) + (np.exp(above) - np.exp(below)) / 2)
