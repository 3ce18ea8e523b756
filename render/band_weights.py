"""Integrals of a curve times light that is known only by its band means: a weight per band, and the error that remains.

Light within a band is a transport T (what surfaces and paths make of a lamp) times the lamp's own spectrum S. T is
smooth, and S is known to the last line. The integral of a curve Q over the light is therefore the integral of S Q T, in
which T is interpolated from its band means. For the interpolation, T is treated as a Gaussian process of wavelength:
its covariance gives the weights of least expected squared error, and that error (Rasmussen & Williams, "Gaussian
Processes for Machine Learning", 2.25; integrals as O'Hagan 1991, "Bayes-Hermite quadrature"). Weights are at least 0.
If the best ones would raise a render's noise by more than 5 %, the weights of least error within that limit are used.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Protocol

import numpy as np
import scipy
from numpy.typing import NDArray

from rodcone.types import Floats

Curves = Callable[[Floats], Floats]  # wavelengths (n,) [nm] to values (curve, n)

# Covariance of T: Matern's of order 5/2, variance 1, on a mean that may be anything. With this length the expected
# error of chart patches is 0.7 to 2.4 times the true one (benchmarks/bands.py), and the weights hardly depend on it.
LENGTH_NM = 100.0
_MEAN_VARIANCE = 100.0  # assumed variance of T's mean; it keeps the weights' sum while negative ones are removed
_ROUNDING = 1e-9  # variance of a band mean's own error, without which the covariance of bands of 1 nm is singular
_STEP_NM = 2.5  # longest piece that the quadrature covers with one pair of nodes
NARROW_NM = 2.0  # T is as good as constant within a band of at most this width
_NODES = np.array([-1.0, 1.0]) / 3**0.5  # Gauss-Legendre, exact for cubics
_IN_BAND, _IN_BAND_SHARES = np.polynomial.legendre.leggauss(4)  # nodes and weights of means over a band
_LEAST_BESIDE_DARK = 1e-2  # a lamp is one of few lines if bands beside dark ones hold more than this share of its light
LEAST_LIGHT = 1e-6  # share of the brightest band's light, below which a band is dark and says nothing about T
_TOUCH, _AS_WIDE = 0.02, 1.5  # neighbouring bands: largest gap over their width, and largest ratio of their widths
_LEAST_NEGATIVE = 1e-9  # share of the largest weight that a negative weight may have by rounding
MOST_NOISE = 1.05  # largest noise of weights, over that of products of averages
_MEASURED = 3e-4  # error of a file's band means, as a share of the brightest band's mean
_RIDGES = (1e-8, 10.0)  # smallest and largest ridge tried, in units of T's variance
_HALVINGS = 12  # steps of the search between them, which finds a ridge within 0.5 %


class LampSpectrum(Protocol):
    """A spectrum by its points (`render.spectrum.Spectrum`): linear between them, 0 outside."""

    @property
    def wavelength_nm(self) -> Floats:
        """Return the wavelengths of the points [nm], increasing."""

    @property
    def values(self) -> Floats:
        """Return the spectrum's value at each point."""


@dataclass(frozen=True)
class BandPoints:
    """Where a curve and light are summed over bands.

    Attributes
    ----------
    nm : (n,) float64
        Wavelength of each point.
    step_nm : (n,) float64
        Weight of each point in an integral over wavelength.
    band : (n,) int
        Index of the band in which each point lies.
    light : (n,) float64
        The light over its mean in the band; 0 in dark bands.
    mean : (band,) float64
        Mean of the light in each band.
    run : (band,) int
        Number of the run that a band belongs to: T is interpolated within a run. Under a known lamp all bands are one
        run. Under unknown light only neighbours that touch and are about equally wide are, because a narrow band may
        hold a line, which its neighbours don't show.
    """

    nm: Floats
    step_nm: Floats
    band: NDArray[np.intp]
    light: Floats
    mean: Floats
    run: NDArray[np.intp]

    @property
    def lit(self) -> NDArray[np.bool_]:
        """Return which bands contain light, shape (band,)."""
        return np.asarray(self.mean > LEAST_LIGHT * self.mean.max(initial=0.0))


def of_few_lines(energy: Floats) -> bool:
    """Return whether a lamp consists of few lines: over a hundredth of its light lies in bands beside dark ones.

    The transport in such dark bands says how surfaces reflect at the line.

    Parameters
    ----------
    energy : (band,) float64
        The lamp's light in each band.
    """
    dark = np.concatenate([[False], energy <= LEAST_LIGHT * energy.max(initial=0.0), [False]])
    return bool(energy[dark[:-2] | dark[2:]].sum() > _LEAST_BESIDE_DARK * energy.sum())


def points_of(knots_nm: Floats, wavelength_nm: Floats, width_nm: Floats, light: LampSpectrum | None) -> BandPoints:
    """Place the points at which integrals over bands are summed: two in each piece between knots.

    Parameters
    ----------
    knots_nm : (n,) float64
        Wavelengths at which the curves have corners or steps; the light's own are added.
    light : LampSpectrum, optional
        The lamp. If it is left out, light is the same at all wavelengths.
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
    curves: Curves,
    knots_nm: Floats,
    wavelength_nm: Floats,
    width_nm: Floats,
    light: LampSpectrum | None = None,
    most_noise: float = MOST_NOISE,
) -> Floats:
    """Return the weights that turn band means of light into the integral of each curve over it, shape (curve, band).

    Parameters
    ----------
    curves : callable
    knots_nm : (n,) float64
        Where the curves have corners or steps.
    wavelength_nm, width_nm : (band,) float64
    light : Spectrum, optional
        The lamp, up to a factor. None means that it isn't known; the light itself is then assumed to be smooth.
    most_noise : float
        Largest noise of the weights, over the noise of plain products of averages. Each band is assumed to have an
        independent relative error of the same size.

    Returns
    -------
    (curve, band) float64
        At least 0 for a curve that is at least 0. Bands that the lamp leaves dark count as if they were evenly lit.
    """
    points = points_of(knots_nm, wavelength_nm, width_nm, light)
    values = curves(points.nm)
    even = _sums(values * points.step_nm, points, wavelength_nm.size)
    lit = np.flatnonzero(points.lit)
    if not lit.size:
        return even
    if width_nm[lit].max() <= NARROW_NM or lit.size == 1:
        products = values * (points.light * points.step_nm)
        return np.where(points.lit, _sums(products, points, wavelength_nm.size), even)
    result = even
    result[:, lit] = interpolating(points, wavelength_nm, width_nm, lit).weights(values, most_noise) / points.mean[lit]
    return result


def transport_weights(
    curves: Curves,
    knots_nm: Floats,
    wavelength_nm: Floats,
    width_nm: Floats,
    light: LampSpectrum,
    most_noise: float = MOST_NOISE,
) -> tuple[Floats, Floats]:
    """Return the weights that turn band means of transport into the integral of each curve over a lamp's light on it.

    Parameters are those of `band_weights`. For a lamp of few lines dark bands count too, because reflection beside a
    line shows what reflection is at the line. Some weights may then be negative.

    Returns
    -------
    weights : (curve, band) float64
    deviation : (curve,) float64
        Expected error of each integral, for transport of variance 1.
    """
    points = points_of(knots_nm, wavelength_nm, width_nm, light)
    values = curves(points.nm)
    lit = np.flatnonzero(points.lit)
    if not lit.size or width_nm[lit].max() <= NARROW_NM:
        products = values * (points.light * points.step_nm)
        return _sums(products, points, wavelength_nm.size) * points.mean, np.zeros(len(values))
    if of_few_lines(points.mean * width_nm):
        known = interpolating(points, wavelength_nm, width_nm, np.arange(wavelength_nm.size))
        found = known.signed_weights(values, most_noise)
    else:
        known = interpolating(points, wavelength_nm, width_nm, lit)
        found = known.weights(values, most_noise)
    weights = np.zeros((len(values), wavelength_nm.size))
    weights[:, known.known] = found
    return weights, known.expected_error(values, found)


def transport_of_light(
    wavelength_nm: Floats, width_nm: Floats, light: LampSpectrum, finer_nm: Floats, finer_width_nm: Floats
) -> Floats:
    """Return the weights by which true band means of light give T's means in finer bands, shape (finer band, band).

    A renderer's or a spectrometer's value is the mean of the product S T in a band, so that it depends on T mainly at
    the lamp's lines. T in the finer bands is the expectation of the Gaussian process given these means, where the
    process's own mean may be anything (universal kriging).

    Parameters
    ----------
    wavelength_nm, width_nm : (band,) float64
        Bands in which the light is known. A band that the lamp leaves dark isn't used.
    light : Spectrum
        The lamp.
    finer_nm, finer_width_nm : (finer band,) float64
    """
    points = points_of(np.zeros(0), wavelength_nm, width_nm, light)
    lit = np.flatnonzero(points.lit)
    shares = np.zeros((lit.size, points.nm.size))  # share of each point in its band's mean, weighted by the lamp
    row = np.searchsorted(lit, points.band).clip(max=lit.size - 1)
    at = np.flatnonzero(lit[row] == points.band)
    shares[row[at], at] = (points.light * points.step_nm / width_nm[points.band])[at]
    among = shares @ _matern(points.nm[:, None] - points.nm) @ shares.T
    trusted = among + np.diag((_MEASURED * points.mean.max() / points.mean[lit]) ** 2)
    towards = _means(shares @ _matern(points.nm[:, None] - _nodes(finer_nm, finer_width_nm))).T
    factor = scipy.linalg.cho_factor(trusted)
    known = scipy.linalg.cho_solve(factor, towards.T).T
    even = scipy.linalg.cho_solve(factor, np.ones(lit.size))
    known += np.outer(1.0 - known.sum(axis=1), even / even.sum())
    result = np.zeros((finer_nm.size, wavelength_nm.size))
    result[:, lit] = known / points.mean[lit]
    return result


@dataclass(frozen=True)
class Interpolation:
    """Interpolation of T at points from its means in bands.

    Attributes
    ----------
    points : BandPoints
    known : (known,) int
        Indices of the bands whose means are known.
    towards : (n, known) float64
        Covariance of T at the points with its band means.
    among : (known, known) float64
        Covariance of the band means.
    """

    points: BandPoints
    known: NDArray[np.intp]
    towards: Floats
    among: Floats

    def weights(self, values: Floats, most_noise: float) -> Floats:
        """Return the weights of T's band means in the integral of curves over the light, shape (curve, known).

        Of all weights that are at least 0 and whose noise is allowed, these have the least expected error.

        Parameters
        ----------
        values : (curve, n) float64
            The curves at the points.
        most_noise : float
            As in `band_weights`.
        """
        result = self._of_ridge(values, 0.0)
        run = self.points.run[self.known]
        root = np.linalg.cholesky(self.among + _MEAN_VARIANCE * (run[:, None] == run)).T
        for row, curve, average in zip(result, values, self._averages(values), strict=True):
            if curve.min() < 0 or not row.any():
                continue
            target = row.copy()
            any_sign = row.min() < -_LEAST_NEGATIVE * np.abs(row).max()
            best = _least(root, target, 0.0) if any_sign else np.maximum(row, 0.0)
            row[:] = _within_noise(best, partial(_least, root, target), most_noise * _noise(average))
        return result

    def signed_weights(self, values: Floats, most_noise: float) -> Floats:
        """Return weights as `weights` does, except that some may be negative."""
        result = self._of_ridge(values, 0.0)
        for row, one, average in zip(result, values, self._averages(values), strict=True):
            row[:] = _within_noise(row, partial(self._of_ridge, one[None]), most_noise * _noise(average))
        return result

    def _of_ridge(self, values: Floats, ridge: float) -> Floats:
        """Return the weights that minimise the expected error plus `ridge` times their squares, shape (curve, known).

        They may be negative.
        """
        of_light = self._of_light(values)
        factor = scipy.linalg.cho_factor(self.among + ridge * np.eye(self.known.size))
        result = scipy.linalg.cho_solve(factor, (of_light @ self.towards).T).T
        # Universal kriging: a T that is constant over a run is integrated exactly.
        run = self.points.run[self.known]
        each = run[:, None] == np.unique(run)
        even = scipy.linalg.cho_solve(factor, each.astype(np.float64))
        total = of_light @ (self.points.run[self.points.band][:, None] == np.unique(run))  # if T is 1
        missing = total - result @ each
        return np.asarray(result + (missing / np.einsum("br,br->r", each, even)) @ even.T)

    def _averages(self, values: Floats) -> Floats:
        """Return the plain weights, each the product of a curve's and the light's average, shape (curve, band)."""
        return _sums(values * self.points.step_nm, self.points, self.points.mean.size) * self.points.mean

    def expected_error(self, values: Floats, weights: Floats) -> Floats:
        """Return the standard deviation of the integral's error by given weights, for T of variance 1: (curve,)."""
        of_light = self._of_light(values)
        nm = self.points.nm
        own = np.einsum("cx,xy,cy->c", of_light, _matern(nm[:, None] - nm), of_light, optimize=True)
        cross = np.einsum("cx,xb,cb->c", of_light, self.towards, weights, optimize=True)
        known = np.einsum("cb,bd,cd->c", weights, self.among, weights, optimize=True)
        return np.asarray(np.sqrt(np.maximum(own - 2 * cross + known, 0.0)))

    def _of_light(self, values: Floats) -> Floats:
        return np.asarray(values * (self.points.light * self.points.mean[self.points.band] * self.points.step_nm))


def interpolating(
    points: BandPoints, wavelength_nm: Floats, width_nm: Floats, known: NDArray[np.intp]
) -> Interpolation:
    """Prepare the interpolation of T from its means in the bands of indices `known`."""
    within = _nodes(wavelength_nm[known], width_nm[known])
    run = points.run[known]
    towards = _means(_matern(points.nm[:, None] - within)) * (points.run[points.band][:, None] == run)
    among = band_covariance(wavelength_nm[known], width_nm[known]) * (run[:, None] == run)
    return Interpolation(points, known, towards, among + _ROUNDING * np.eye(known.size))


def band_covariance(wavelength_nm: Floats, width_nm: Floats) -> Floats:
    """Compute the covariance of the band means of a T of variance 1, shape (band, band)."""
    within = _nodes(wavelength_nm, width_nm)
    return _means(_means(_matern(within[:, None] - within)).T)


def _nodes(wavelength_nm: Floats, width_nm: Floats) -> Floats:
    """Return the wavelengths of the nodes by which means over bands are computed, shape (band x node,)."""
    return np.asarray((wavelength_nm[:, None] + width_nm[:, None] / 2 * _IN_BAND).ravel())


def _means(covariance: Floats) -> Floats:
    """Average over each band, along the last axis, values that are given at `_nodes`."""
    return np.asarray(covariance.reshape(len(covariance), -1, _IN_BAND.size) @ (_IN_BAND_SHARES / 2))


def _least(root: Floats, target: Floats, ridge: float) -> Floats:
    """Find the weights w of at least 0 that minimise |root (w - target)|^2 + ridge |w|^2; scale them to `target`'s sum.

    The first term is the expected error beyond that of `target`, the weights of least error of any sign.
    """
    most = np.abs(target).max()
    rows = np.vstack([root, ridge**0.5 * np.eye(target.size)]) if ridge else root
    sought = np.concatenate([root @ target, np.zeros(len(rows) - len(root))]) / most
    found = scipy.optimize.nnls(rows, sought, maxiter=100 * target.size)[0]
    return np.asarray(found * (target.sum() / found.sum()))


def _within_noise(best: Floats, of_ridge: Callable[[float], Floats], most: float) -> Floats:
    """Return `best` if its noise is at most `most`, else the weights of the smallest ridge whose noise is."""
    if _noise(best) <= most:
        return best
    low, high = _RIDGES
    for _ in range(_HALVINGS):
        middle = (low * high) ** 0.5
        low, high = (low, middle) if _noise(of_ridge(middle)) <= most else (middle, high)
    return of_ridge(high)


def _noise(weights: Floats) -> float:
    """Compute the relative error of a weighted sum of bands, each with an independent relative error of 1."""
    return float(np.linalg.norm(weights) / abs(weights.sum())) if weights.any() else 0.0


def _runs(wavelength_nm: Floats, width_nm: Floats) -> NDArray[np.intp]:
    """Number the runs of bands: neighbours that touch and are about equally wide belong to one run."""
    gaps = np.abs(np.diff(wavelength_nm) - (width_nm[1:] + width_nm[:-1]) / 2)
    wider = np.maximum(width_nm[1:], width_nm[:-1]) / np.minimum(width_nm[1:], width_nm[:-1])
    return np.concatenate([[0], np.cumsum((gaps > _TOUCH * width_nm[1:]) | (wider > _AS_WIDE))]).astype(np.intp)


def _matern(distance_nm: Floats) -> Floats:
    scaled = np.abs(distance_nm) * (5**0.5 / LENGTH_NM)
    return np.asarray((1 + scaled + scaled**2 / 3) * np.exp(-scaled))


def _sums(products: Floats, points: BandPoints, bands: int) -> Floats:
    return np.array([np.bincount(points.band, row, bands) for row in products])
