"""Estimates of a render's Monte Carlo error, from the difference between its two halves."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rodcone.display import brief
from rodcone.types import Floats, Planes

SAMPLE_PIXELS = 1024  # pixels for the error's median; with 40 bands it is then known to about 1 %
LEAST_UNCOVERED = 1e-6  # least share of a pixel that no light covers; less is rounding


@dataclass(frozen=True)
class Halves:
    """Mean and half difference of two halves of the samples, whose paths are independent of each other.

    Attributes
    ----------
    mean : (..., h, w) float32
    difference : (..., h, w) float32
        Half the difference between the even and the odd half. It is a random draw of the error of `mean`, with all its
        correlations.
    """

    mean: Planes
    difference: Planes

    __repr__ = brief

    @classmethod
    def zeros(cls, *shape: int) -> "Halves":
        """Return halves of zeros, as they are before the first sample."""
        return cls(np.zeros(shape, np.float32), np.zeros(shape, np.float32))

    def copy(self) -> "Halves":
        """Copy both arrays, so that more samples can be added."""
        return Halves(self.mean.copy(), self.difference.copy())

    def __getitem__(self, index: int) -> "Halves":
        """Return a view of one entry of the first axis."""
        return Halves(self.mean[index], self.difference[index])

    def add(self, even: Planes, odd: Planes, weight: np.float32, at: slice | NDArray[np.intp]) -> None:
        """Add a chunk's two means (..., pixel) at some pixels: m += ((a + b) / 2 - m) w, d += ((a - b) / 2 - d) w.

        Parameters
        ----------
        even, odd : (..., pixel) float32
            Means a and b of the chunk's points in the two halves.
        weight : float32
            Weight w of the chunk in the mean of all points so far.
        at : slice or (pixel,) int
            The pixels, counted row by row. A pixel that occurs twice must have the same light both times.
        """
        for planes, combined in ((self.mean, np.add), (self.difference, np.subtract)):
            step = combined(even, odd)
            np.multiply(step, np.float32(0.5), out=step)
            rows = planes.reshape(-1, planes.shape[-2] * planes.shape[-1])
            for row, values in zip(rows, step.reshape(-1, step.shape[-1]), strict=True):
                before = row[at]
                np.subtract(values, before, out=values)
                np.multiply(values, weight, out=values)
                row[at] = np.add(before, values, out=values)


@dataclass(frozen=True)
class SharedPaths:
    """Two light groups that were rendered along the same paths, so that their errors aren't independent.

    Attributes
    ----------
    groups : (int, int)
        Indices of the two groups.
    correlation : (band, h, w) float32
        Correlation of their errors, -1 to 1.
    """

    groups: tuple[int, int]
    correlation: Planes

    __repr__ = brief

    def term(self, emitted: Floats, variance: Planes) -> Planes:
        """Compute twice the covariance of the two groups' light, a term of their sum's variance: (band, h, w).

        Parameters
        ----------
        emitted : (group, band) float64
        variance : (group, band, h, w) float32
        """
        first, second = self.groups
        factor = (2 * emitted[first] * emitted[second]).astype(np.float32)[:, None, None]
        return np.asarray(factor * self.correlation * np.sqrt(variance[first]) * np.sqrt(variance[second]))


def pooled(planes: Planes) -> Planes:
    """Average over 3x3 pixels along the last two axes; at the picture's edge the outermost pixels are repeated."""
    # Nine values are summed each time, because a running sum would carry on the rounding error of a bright pixel.
    wide = np.pad(planes, [(0, 0)] * (planes.ndim - 2) + [(1, 1), (1, 1)], mode="edge")
    rows = wide[..., :-2, :] + wide[..., 1:-1, :] + wide[..., 2:, :]
    return np.asarray((rows[..., :-2] + rows[..., 1:-1] + rows[..., 2:]) / planes.dtype.type(9))


@dataclass(frozen=True)
class GroupError:
    """A light group's error, which is half the difference of the halves, in two independent parts.

    Attributes
    ----------
    scattered : (band, h, w) float32
        Error of scattered light, scaled to a pixel of rate 1.
    rim : (band, h, w) float32
        Error at the rim of a visible lamp, where too many or too few of a pixel's samples meet the lamp.
    scale : (band, h, w) float32
        Square root of the ratio of scattered light to its mean over 3x3 pixels.
    """

    scattered: Planes
    rim: Planes
    scale: Planes

    def covariance(self, other: "GroupError", rates: NDArray[np.uint32]) -> Planes:
        """Estimate the covariance with another group's error, or the variance if `other` is itself: (band, h, w).

        The variance of scattered light is pooled over 3x3 pixels relative to the light, because across an edge variance
        over mean changes far less than variance. A lamp's rim is not pooled, since a lamp is thousands of times
        brighter than the dark beside it. One pixel's difference has one degree of freedom; its bands share their paths
        and add none.
        """
        scattered = pooled(self.scattered * other.scattered) * self.scale * other.scale
        return np.asarray(scattered / rates.astype(np.float32) + self.rim * other.rim)


def group_errors(
    light: Halves, seen: Sequence[Halves], coverage: Planes, rates: NDArray[np.uint32]
) -> list[GroupError]:
    """Separate the error of each group's light (group, band, h, w) into scattered light and rims of lamps.

    Parameters
    ----------
    light : Halves of (group, band, h, w)
    seen : sequence of Halves of (1 or band, h, w)
        Directly visible light of each group.
    coverage : (h, w) float32
        Share of the samples that meet a lamp first. Where more of them do, fewer meet what lies behind the lamp.
    rates : (h, w) uint32
        Number of samples of each pixel, up to a common factor.
    """
    root_rates = np.sqrt(rates.astype(np.float32))
    uncovered = np.where(coverage < 1 - LEAST_UNCOVERED, 1 - coverage, 0)
    errors = []
    for group, lamp in enumerate(seen):
        scattered = np.maximum(light[group].mean - lamp.mean, np.float32(0))
        lamp_light = np.broadcast_to(lamp.mean, scattered.shape) * uncovered
        behind = np.divide(scattered * coverage, lamp_light, out=np.zeros_like(scattered), where=lamp_light > 0)
        rim = lamp.difference * (1 - behind)
        means = pooled(scattered)
        scale = np.sqrt(np.divide(scattered, means, out=np.zeros_like(means), where=means > 0))
        errors.append(GroupError((light[group].difference - rim) * root_rates, rim, scale))
    return errors


def shared_paths(
    groups: tuple[int, int], errors: Sequence[GroupError], variance: Planes, rates: NDArray[np.uint32]
) -> SharedPaths:
    """Compute the correlation of two groups' errors from their covariance and known variances."""
    first, second = groups
    deviations = np.sqrt(variance[first]) * np.sqrt(variance[second])
    products = errors[first].covariance(errors[second], rates)
    correlation = np.divide(products, deviations, out=np.zeros_like(deviations), where=deviations > 0)
    return SharedPaths(groups, np.clip(correlation, -1, 1, out=correlation))


def relative_error(emitted: Floats, radiance: Planes, variance: Planes, shared: SharedPaths | None = None) -> float:
    """Compute the median over pixels and bands of standard error over mean; dark values don't count.

    Parameters
    ----------
    emitted : (group, band) float64
    radiance, variance : (group, band, h, w) float32
    shared : SharedPaths, optional
        Groups whose errors are correlated.
    """
    chosen = spread_pixels(radiance.shape[2:])
    of_chosen = replace(shared, correlation=shared.correlation[chosen]) if shared else None
    return median_error(emitted, radiance[chosen], variance[chosen], of_chosen)


def median_error(emitted: Floats, radiance: Planes, variance: Planes, shared: SharedPaths | None) -> float:
    """Compute `relative_error` from pixels that `spread_pixels` has already chosen."""
    total = (emitted[:, :, None, None] ** 2 * variance).sum(axis=0)
    if shared:
        total += shared.term(emitted, variance)
    values = (emitted[:, :, None, None] * radiance).sum(axis=0)
    lit = values > 0
    return float(np.median(np.sqrt(np.maximum(total[lit], 0.0)) / values[lit])) if lit.any() else 0.0


def spread_pixels(shape: tuple[int, ...]) -> tuple[Any, ...]:
    """Return an index (..., row, column) of about `SAMPLE_PIXELS` pixels at most, spread evenly over a picture."""
    step = max(1, round(np.sqrt(shape[0] * shape[1] / SAMPLE_PIXELS)))
    rows, columns = (np.arange(min(step // 2, length - 1), length, step) for length in shape)
    return ..., rows[:, None], columns
