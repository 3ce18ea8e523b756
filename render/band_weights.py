"""Integrals of a curve and light that is known by its band means: the weight of each band, and the error that is left.

Light within a band is a transport T (what surfaces and paths make of a lamp) times the lamp's own spectrum S. T is
smooth, and S is known to the last line, so that the integral of a curve Q over the light is that of S Q times T, and T
is interpolated from its band means. As interpolation T is taken as a Gaussian process of wavelength: its covariance
gives the weights of the least expected squared error (Rasmussen & Williams, "Gaussian Processes for Machine Learning",
2.25; integrals as O'Hagan 1991, "Bayes-Hermite quadrature") and that error itself. Weights are at least 0, so that
they never turn up the noise of a band by the difference of two.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import scipy
from numpy.typing import NDArray

from rodcone.types import Floats

Curves = Callable[[Floats], Floats]  # wavelengths (n,) [nm] to values (curve, n)

# Covariance of T: Matern's of order 5/2, variance 1, on a mean that may be anything. With this length the expected
# error of chart patches is 0.7 to 2.4 times what it is (benchmarks/bands.py), and the weights hardly depend on it.
LENGTH_NM = 100.0
_MEAN_VARIANCE = 100.0  # holds the sum of weights while they are brought to 0 or more
_ROUNDING = 1e-9  # variance of what a band's mean is known to: keeps bands of 1 nm apart
_STEP_NM = 2.5  # longest piece that a quadratic rule takes
NARROW_NM = 2.0  # within a band up to so wide T is as good as constant
_NODES = np.array([-1.0, 1.0]) / 3**0.5  # Gauss-Legendre, exact for cubics
_IN_BAND, _IN_BAND_SHARES = np.polynomial.legendre.leggauss(4)
LEAST_LIGHT = 1e-6  # of the brightest band's: darker ones tell nothing of T
_TOUCH, _AS_WIDE = 0.02, 1.5  # gap over width, ratio of widths
_LEAST_NEGATIVE = 1e-9  # of the largest weight: rounding


class LampSpectrum(Protocol):
    """A spectrum by its points (`render.spectrum.Spectrum`): linear between them, 0 outside."""

    @property
    def wavelength_nm(self) -> Floats:
        """Increasing."""

    @property
    def values(self) -> Floats:
        """One each."""


@dataclass(frozen=True)
class BandPoints:
    """Where a curve and light are summed over bands.

    Attributes
    ----------
    nm : (n,) float64
    step_nm : (n,) float64
        Share of the integral.
    band : (n,) int
        Whose band each lies in.
    light : (n,) float64
        The light over its mean in the band; 0 in dark bands.
    mean : (band,) float64
        Mean of the light in each band.
    run : (band,) int
        Bands of one number tell of each other. Of a lamp that is known all do; of light that isn't, neighbours that
        touch and are about as wide: a narrow band may hold a line, that its neighbours know nothing of.
    """

    nm: Floats
    step_nm: Floats
    band: NDArray[np.intp]
    light: Floats
    mean: Floats
    run: NDArray[np.intp]

    @property
    def lit(self) -> NDArray[np.bool_]:
        """Which bands hold light, shape (band,)."""
        return np.asarray(self.mean > LEAST_LIGHT * self.mean.max(initial=0.0))


def points_of(knots_nm: Floats, wavelength_nm: Floats, width_nm: Floats, light: LampSpectrum | None) -> BandPoints:
    """Points on which bands are summed, two in each piece between knots; no light: the same at all wavelengths.

    Parameters
    ----------
    knots_nm : (n,) float64
        Where the curves have corners or steps; the light's own are added.
    """
    knots = knots_nm if light is None else np.concatenate([knots_nm, light.wavelength_nm])
    knots = np.unique(knots)
    nm, step, band = [], [], []
    for index, (centre, width) in enumerate(zip(wavelength_nm, width_nm, strict=True)):
        first, last = centre - width / 2, centre + width / 2
        even = np.linspace(first, last, 1 + max(1, int(np.ceil(width / _STEP_NM))))
        edges = np.unique(np.concatenate([even, knots[(knots > first) & (knots < last)]]))
        half = np.diff(edges)[:, None] / 2
        nm.append((edges[:-1, None] + half + half * _NODES).ravel())
        step.append(np.repeat(half.ravel(), _NODES.size))
        band.append(np.full(step[-1].size, index))
    at, steps, of_band = np.concatenate(nm), np.concatenate(step), np.concatenate(band)
    if light is None:
        return BandPoints(
            at, steps, of_band, np.ones_like(at), np.ones(wavelength_nm.size), _runs(wavelength_nm, width_nm)
        )
    values = np.interp(at, light.wavelength_nm, light.values, left=0.0, right=0.0)
    mean = np.bincount(of_band, steps * values, wavelength_nm.size) / width_nm
    lit = mean > LEAST_LIGHT * mean.max(initial=0.0)
    over = np.divide(1.0, mean, out=np.zeros_like(mean), where=lit)
    return BandPoints(at, steps, of_band, values * over[of_band], mean, np.zeros(wavelength_nm.size, np.intp))


def band_weights(
    curves: Curves, knots_nm: Floats, wavelength_nm: Floats, width_nm: Floats, light: LampSpectrum | None = None
) -> Floats:
    """Weights by which band means of light give the integral of each curve over it, shape (curve, band).

    Parameters
    ----------
    curves : callable
    knots_nm : (n,) float64
        Where the curves have corners or steps.
    wavelength_nm, width_nm : (band,) float64
    light : Spectrum, optional
        The lamp, up to a factor; None where it isn't known: the light itself is then taken as smooth.

    Returns
    -------
    (curve, band) float64
        0 or more where the curves are. Bands without any of the lamp's light count as if they were evenly lit.
    """
    points = points_of(knots_nm, wavelength_nm, width_nm, light)
    values = curves(points.nm)
    even = _sums(values * points.step_nm, points, wavelength_nm.size)
    lit = np.flatnonzero(points.lit)
    if not lit.size:
        return even
    products = values * (points.light * points.step_nm)
    if width_nm[lit].max() <= NARROW_NM or lit.size == 1:
        return np.where(points.lit, _sums(products, points, wavelength_nm.size), even)
    result = even
    result[:, lit] = interpolating(points, wavelength_nm, width_nm).weights(products)
    return result


@dataclass(frozen=True)
class Interpolation:
    """T at points by its means in the lit bands.

    Attributes
    ----------
    points : BandPoints
    lit : (lit,) int
        Indices of the bands.
    towards : (n, lit) float64
        Covariance of T at the points with its band means.
    among : (lit, lit) float64
        Covariance of the band means.
    """

    points: BandPoints
    lit: NDArray[np.intp]
    towards: Floats
    among: Floats

    @property
    def mean_light(self) -> Floats:
        """Mean of the lamp's light in the lit bands, shape (lit,)."""
        return self.points.mean[self.lit]

    def raw(self, products: Floats) -> Floats:
        """Weights of the transport's band means of the least error, which may be negative, shape (curve, lit).

        Parameters
        ----------
        products : (curve, n) float64
            Curve times the lamp's light over its band mean times step, at the points.
        """
        of_light = products * self.points.mean[self.points.band]
        factor = scipy.linalg.cho_factor(self.among)
        result = scipy.linalg.cho_solve(factor, (of_light @ self.towards).T).T
        # Universal kriging: whatever is the same all over a run is found exactly.
        each = self.points.run[self.lit][:, None] == np.unique(self.points.run[self.lit])
        even = scipy.linalg.cho_solve(factor, each.astype(np.float64))
        missing = self._totals(of_light) - result @ each
        return np.asarray(result + (missing / np.einsum("br,br->r", each, even)) @ even.T)

    def _totals(self, of_light: Floats) -> Floats:
        """Integral over each run where T is 1, shape (curve, run)."""
        runs = self.points.run[self.points.band][:, None] == np.unique(self.points.run[self.lit])
        return np.asarray(of_light @ runs)

    def weights(self, products: Floats) -> Floats:
        """Weights of the light's band means, of the least expected error among those that aren't negative."""
        of_transport = self.raw(products)
        run = self.points.run[self.lit]
        root = np.linalg.cholesky(self.among + _MEAN_VARIANCE * (run[:, None] == run)).T
        for row, product in zip(of_transport, products, strict=True):
            most = np.abs(row).max()
            if row.min() < -_LEAST_NEGATIVE * most and product.min() >= 0:
                least = scipy.optimize.nnls(root, root @ row / most, maxiter=100 * row.size)[0]
                row[:] = least * (row.sum() / least.sum())
            elif product.min() >= 0:
                np.maximum(row, 0.0, out=row)
        return np.asarray(of_transport / self.mean_light)

    def expected_error(self, products: Floats, weights: Floats) -> Floats:
        """Standard deviation of the integral's error, for transport of variance 1, shape (curve,)."""
        of_light = products * self.points.mean[self.points.band]
        of_transport = weights * self.mean_light
        nm = self.points.nm
        own = np.einsum("cx,xy,cy->c", of_light, _matern(nm[:, None] - nm), of_light, optimize=True)
        cross = np.einsum("cx,xb,cb->c", of_light, self.towards, of_transport, optimize=True)
        known = np.einsum("cb,bd,cd->c", of_transport, self.among, of_transport, optimize=True)
        return np.asarray(np.sqrt(np.maximum(own - 2 * cross + known, 0.0)))


def interpolating(points: BandPoints, wavelength_nm: Floats, width_nm: Floats) -> Interpolation:
    """Interpolation of T from its means in the lit bands."""
    lit = np.flatnonzero(points.lit)
    within = (wavelength_nm[lit, None] + width_nm[lit, None] / 2 * _IN_BAND).ravel()  # (lit x node)
    shares = _IN_BAND_SHARES / 2

    def means(covariance: Floats) -> Floats:  # over each band, along the last axis
        return np.asarray(covariance.reshape(len(covariance), lit.size, shares.size) @ shares)

    run = points.run[lit]
    towards = means(_matern(points.nm[:, None] - within)) * (points.run[points.band][:, None] == run)
    among = means(means(_matern(within[:, None] - within)).T) * (run[:, None] == run)
    return Interpolation(points, lit, towards, among + _ROUNDING * np.eye(lit.size))


def _runs(wavelength_nm: Floats, width_nm: Floats) -> NDArray[np.intp]:
    """Number of the run that each band lies in: neighbours that touch and are about as wide."""
    gaps = np.abs(np.diff(wavelength_nm) - (width_nm[1:] + width_nm[:-1]) / 2)
    wider = np.maximum(width_nm[1:], width_nm[:-1]) / np.minimum(width_nm[1:], width_nm[:-1])
    return np.concatenate([[0], np.cumsum((gaps > _TOUCH * width_nm[1:]) | (wider > _AS_WIDE))]).astype(np.intp)


def _matern(distance_nm: Floats) -> Floats:
    scaled = np.abs(distance_nm) * (5**0.5 / LENGTH_NM)
    return np.asarray((1 + scaled + scaled**2 / 3) * np.exp(-scaled))


def _sums(products: Floats, points: BandPoints, bands: int) -> Floats:
    return np.array([np.bincount(points.band, row, bands) for row in products])
