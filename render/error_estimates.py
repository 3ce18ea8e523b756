"""How far a render may be off: Monte Carlo noise, and light that varies within a band together with the scene.

Both are estimated from pixels spread evenly over the picture, and cost little beside relighting.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from render.scene import LightGroup
from render.spectrum import Spectrum
from rodcone.brief import brief
from rodcone.types import Floats, Planes

SAMPLE_PIXELS = 1024  # with 40 bands the median of the error is then known to about 1 %
SUB_BANDS = 64  # of a band, over which a light's moments are summed: 0.16 nm in a band of 10 nm


@dataclass(frozen=True)
class Halves:
    """What two halves of the samples give, whose paths are independent of each other.

    Attributes
    ----------
    mean : (..., h, w) float32
    difference : (..., h, w) float32
        Half the difference between the even and the odd half: one draw of the error of `mean`, all correlations kept.
    """

    mean: Planes
    difference: Planes

    __repr__ = brief

    @classmethod
    def zeros(cls, *shape: int) -> "Halves":
        """Halves before the first sample."""
        return cls(np.zeros(shape, np.float32), np.zeros(shape, np.float32))

    def copy(self) -> "Halves":
        """Halves that can be added to."""
        return Halves(self.mean.copy(), self.difference.copy())

    def __getitem__(self, index: int) -> "Halves":
        """View of one along the first axis."""
        return Halves(self.mean[index], self.difference[index])

    def add(self, even: Planes, odd: Planes, weight: np.float32) -> None:
        """Add a chunk's two means, in place: m += ((a + b) / 2 - m) w, d += ((a - b) / 2 - d) w."""
        for planes, twice in ((self.mean, even + odd), (self.difference, even - odd)):
            step = np.multiply(twice, np.float32(0.5), out=twice)
            np.subtract(step, planes, out=step)
            np.multiply(step, weight, out=step)
            np.add(planes, step, out=planes)


@dataclass(frozen=True)
class SharedPaths:
    """Two light groups that were rendered along the same paths, so that their errors aren't independent.

    Attributes
    ----------
    groups : (int, int)
        Which, by their order.
    correlation : (band, h, w) float32
        Of their errors, -1 to 1.
    """

    groups: tuple[int, int]
    correlation: Planes

    __repr__ = brief

    def term(self, emitted: Floats, variance: Planes) -> Planes:
        """Twice the covariance of the two groups' light: what it adds to the variance of the sum, (band, h, w).

        Parameters
        ----------
        emitted : (group, band) float64
        variance : (group, band, h, w) float32
        """
        one, other = self.groups
        factor = (2 * emitted[one] * emitted[other]).astype(np.float32)[:, None, None]
        return np.asarray(factor * self.correlation * np.sqrt(variance[one]) * np.sqrt(variance[other]))


def pooled(planes: Planes) -> Planes:
    """Means over 3x3 pixels, of the last two axes; at the picture's edge the nearest pixels count again."""
    # Sums of nine: a running sum would leave a rounding of its brightest pixel behind.
    wide = np.pad(planes, [(0, 0)] * (planes.ndim - 2) + [(1, 1), (1, 1)], mode="edge")
    rows = wide[..., :-2, :] + wide[..., 1:-1, :] + wide[..., 2:, :]
    return np.asarray((rows[..., :-2] + rows[..., 1:-1] + rows[..., 2:]) / planes.dtype.type(9))


def variance_of(difference: Planes, rates: NDArray[np.uint32]) -> Planes:
    """Variance of a mean of two halves, from half their difference: its square, pooled over 3x3 pixels.

    Pooled as the variance of one sample, since pixels (h, w) have samples in the ratio of `rates`. One difference has
    one degree of freedom; bands share their paths, and add none.
    """
    return pooled_by_sample(np.square(difference), rates)


def pooled_by_sample(squares: Planes, rates: NDArray[np.uint32]) -> Planes:
    """Squares of errors, pooled over 3x3 pixels whose samples are in the ratio of `rates`."""
    if rates.min() == rates.max():
        return pooled(squares)
    samples = rates.astype(np.float32)
    return np.asarray(pooled(squares * samples) / samples)


def shared_paths(
    groups: tuple[int, int], difference: Planes, variance: Planes, rates: NDArray[np.uint32]
) -> SharedPaths:
    """Correlation of the errors of two groups, from half the difference of the halves (group, band, h, w)."""
    one, other = groups
    both = np.sqrt(variance[one]) * np.sqrt(variance[other])
    product = pooled_by_sample(difference[one] * difference[other], rates)
    found = np.divide(product, both, out=np.zeros_like(both), where=both > 0)
    return SharedPaths(groups, np.clip(found, -1, 1, out=found))


def relative_error(emitted: Floats, radiance: Planes, variance: Planes, shared: SharedPaths | None = None) -> float:
    """Median over pixels and bands of standard error over mean; dark values out.

    Parameters
    ----------
    emitted : (group, band) float64
    radiance, variance : (group, band, h, w) float32
    shared : SharedPaths, optional
        Groups whose errors are correlated.
    """
    rows, columns = _spread(radiance.shape[2:])
    chosen = np.s_[..., rows[:, None], columns]
    total = (emitted[:, :, None, None] ** 2 * variance[chosen]).sum(axis=0)
    if shared:
        total += replace(shared, correlation=shared.correlation[chosen]).term(emitted, variance[chosen])
    values = (emitted[:, :, None, None] * radiance[chosen]).sum(axis=0)
    lit = values > 0
    return float(np.median(np.sqrt(np.maximum(total[lit], 0.0)) / values[lit])) if lit.any() else 0.0


def within_band_error(
    lights: Mapping[str, LightGroup], radiance: Planes, wavelength_nm: Floats, width_nm: Floats
) -> Floats:
    """Error of the product of band averages, over the radiance, RMS over pixels; shape (band,).

    The mean of transport T times emission S over a band is not the product of their means. With T expanded about the
    band's centre, T + s x + q/2 (x^2 - w^2/12), what is missed is s <S x> + q/2 <S (x^2 - w^2/12)>, x from the centre.
    Slope s and curvature q come from the neighbouring bands. The two terms are added without their signs; what T does
    within a band beyond a parabola stays unseen. A coloured emitter is averaged as it is rendered, so a flat
    factor on it misses nothing.

    Parameters
    ----------
    radiance : (group, band, h, w) float32
        At unit spectral emission.
    """
    rows, columns = _spread(radiance.shape[2:])
    missed = np.zeros((radiance.shape[1], rows.size, columns.size))
    seen = np.zeros_like(missed)
    for light, planes in zip(lights.values(), radiance, strict=True):
        transport = planes[:, rows[:, None], columns].astype(np.float64)
        slope, curvature = _derivatives(transport, wavelength_nm)
        mean, first, second = (
            moment[:, None, None] * light.power for moment in _moments(light.spectrum, wavelength_nm, width_nm)
        )
        missed += np.abs(slope * first) + np.abs(curvature * second) / 2
        seen += transport * mean
    missed_rms, seen_rms = (np.sqrt(np.mean(np.square(x), axis=(1, 2))) for x in (missed, seen))
    return np.asarray(np.divide(missed_rms, seen_rms, out=np.zeros_like(seen_rms), where=seen_rms > 0))


def _spread(shape: tuple[int, ...]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Rows and columns of at most about `SAMPLE_PIXELS` pixels, evenly spread over a picture."""
    step = max(1, round(np.sqrt(shape[0] * shape[1] / SAMPLE_PIXELS)))
    return np.arange(min(step // 2, shape[0] - 1), shape[0], step), np.arange(
        min(step // 2, shape[1] - 1), shape[1], step
    )


def _derivatives(values: Floats, wavelength_nm: Floats) -> tuple[Floats, Floats]:
    """Slope and curvature over wavelength (axis 0), from the parabola through each band and its two neighbours."""
    if wavelength_nm.size < 2:
        return np.zeros_like(values), np.zeros_like(values)
    slope = np.gradient(values, wavelength_nm, axis=0, edge_order=1 if wavelength_nm.size == 2 else 2)
    if wavelength_nm.size == 2:
        return slope, np.zeros_like(values)
    steps = np.diff(wavelength_nm)[:, None, None]
    curvature = 2 * np.diff(np.diff(values, axis=0) / steps, axis=0) / (steps[1:] + steps[:-1])
    return slope, np.pad(curvature, ((1, 1), (0, 0), (0, 0)), mode="edge")


def _moments(spectrum: Spectrum, wavelength_nm: Floats, width_nm: Floats) -> tuple[Floats, Floats, Floats]:
    """Mean of S, S x and S (x^2 - w^2/12) over each band, x from its centre; shape (band,) each."""
    places = (np.arange(SUB_BANDS) + 0.5) / SUB_BANDS - 0.5
    x = places * width_nm[:, None]
    sub_width = np.repeat(width_nm / SUB_BANDS, SUB_BANDS)
    values = spectrum.band_average((wavelength_nm[:, None] + x).ravel(), sub_width).reshape(x.shape)
    even = x**2 - np.mean(x**2, axis=1, keepdims=True)
    return values.mean(axis=1), (values * x).mean(axis=1), (values * even).mean(axis=1)
