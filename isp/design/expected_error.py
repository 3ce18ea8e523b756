"""Expected error of the best estimate of a picture from a mosaic's samples, under a prior over patches.

A patch x of coefficients comes from one of several Gaussians, x ~ N(mu_k, C_k) with probability pi_k. Its samples are
y = H x + n, where n has the variance N_k, which depends on the component's mean by shot noise. If the component is
known, the estimate of least squared error is linear, and its error has the covariance

    P_k = C_k - C_k H' (H C_k H' + N_k)^-1 H C_k                                                    (textbook LMMSE)

so that the expected error is sum_k pi_k tr(W_k P_k), where e' W_k e is the squared error of a colour that is e off the
component's mean. No estimator knows the component, so that this is a lower bound. An estimator that uses the mean and
covariance of all patches together is linear in the samples and can be built. Its error, by the same formula for one
Gaussian, is an upper bound. Both are expectations over the prior; an easy scene has less error.

With a lens L, the estimate is one of L x, because the blur isn't undone, but it is compared with x. With
V_k = C_k - P_k, the part of the covariance that the samples explain, the error is

    C_k + L V_k L' - V_k L' - L V_k + (L mu_k - mu_k)(L mu_k - mu_k)'
"""

from dataclasses import dataclass
from functools import cache

import numpy as np
import scipy
from numpy.typing import NDArray

from rodcone.types import Floats
from sensor.noise_law import NoiseLaw

LEAST_SHARE = 1e-8  # least share of information that a clipped sample keeps
FAR = 8.0  # a sample whose mean lies so many standard deviations below the well is never full


@dataclass(frozen=True, eq=False)
class Gaussians:
    """A mixture of Gaussians over patches of size x size pixels of `coefficient` numbers each.

    Attributes
    ----------
    weights : (component,) float64
        Probabilities pi_k, of sum 1.
    means : (component, pixel, coefficient) float64
    factors : (component, pixel, coefficient, direction) float64
        F, which as a matrix has the shape (pixel * coefficient, direction).
    rest : (component,) float64
        r. The covariance of a component is C = F F' + r I + b^2 mu mu'.
    brightness : float
        b, the relative standard deviation of a patch's brightness.
    """

    weights: Floats
    means: Floats
    factors: Floats
    rest: Floats
    brightness: float

    @property
    def directions(self) -> Floats:
        """Return F and b mu together, in the form of `factors`."""
        return np.concatenate([self.factors, self.brightness * self.means[..., None]], axis=-1)


@dataclass(frozen=True)
class Noise:
    """Noise of a patch's samples, and the level at which they are full.

    Attributes
    ----------
    law : NoiseLaw
        Law whose parameters are numbers, or arrays (sample,) float64.
    full_e : float or (sample,) float64
        Electrons at which a sample is full; inf if it never is.
    """

    law: NoiseLaw
    full_e: float | Floats


@cache
def single_gaussian(prior: Gaussians) -> Gaussians:
    """Return one Gaussian with the mean and covariance of the whole mixture."""
    mean = np.tensordot(prior.weights, prior.means, 1)
    root = np.sqrt(prior.weights)[:, None, None]
    # Averaged over components, b^2 mu mu' is b^2 times the square of the pooled mean plus b^2 times the squared
    # deviations from it. Hence the deviations count 1 + b^2 times.
    spread = np.hypot(1.0, prior.brightness) * root * (prior.means - mean)
    wide = np.concatenate([*(root[..., None] * prior.factors), np.moveaxis(spread, 0, -1)], axis=-1)
    left, sizes, _ = np.linalg.svd(wide.reshape(mean.size, -1), full_matrices=False)
    factors = (left * sizes).reshape(1, *mean.shape, -1)
    return Gaussians(np.ones(1), mean[None], factors, prior.weights @ prior.rest[:, None], prior.brightness)


def opening(distance: Floats) -> tuple[Floats, Floats]:
    """Return the share of information that is left in a sample that may be clipped, and its slope over `distance`.

    The share o is the Fisher information about the mean in a Gaussian that is censored at the well, over that in an
    uncensored one. With a = (well - mean) / sigma ("distance"), o = Phi(a) + phi(a) (hazard(a) - a). The first term
    comes from samples below the well, the second from full ones, which say only that the light was at least so much.
    The slope do/da is phi(a) (hazard(a) - a)^2.
    """
    a = np.minimum(distance, FAR)
    density = np.exp(-(a**2) / 2) / np.sqrt(2 * np.pi)
    over = np.sqrt(2 / np.pi) / scipy.special.erfcx(a / np.sqrt(2)) - a
    share = np.asarray(scipy.special.ndtr(a) + density * over)
    return np.maximum(share, LEAST_SHARE), np.where(share > LEAST_SHARE, density * over**2, 0.0)


def sample_variance(mean_e: Floats, spread_e2: Floats, noise: Noise) -> Floats:
    """Return the noise variance [e-^2] of an unclipped sample with as little information as this one, which may clip.

    Let w be the variance of signal and noise together. Clipping leaves the share o of the sample's information
    (`opening`), as if w were w / o. Without the signal's own variance (the spread) that is the equivalent noise,
    w / o - spread. It is exact for a single sample, and slightly too large where neighbouring samples already determine
    the signal.

    Parameters
    ----------
    mean_e, spread_e2 : arrays of one shape
        Mean of the expected electrons, and their variance over the prior.
    """
    mean_e = np.maximum(mean_e, 0.0)
    total = noise.law.variance(mean_e) + spread_e2
    return np.asarray(total / opening((noise.full_e - mean_e) / np.sqrt(total))[0] - spread_e2)


@dataclass(frozen=True, eq=False)
class Samples:
    """Moments of the samples that a mosaic takes of a prior's patches in unit light, to estimate the middle pixels.

    Attributes
    ----------
    weights : (component,) float64
        Weights of the mixture.
    means : (component, sample) float64
        H mu_k.
    signal : (component, sample, sample) float64
        H C_k H'.
    spread : (component, sample) float64
        Variance of a sample at known brightness.
    cross : (component, sample, pixel, coefficient) float64
        H C_k L' at the middle pixels.
    error_cross : (component, sample, pixel, coefficient) float64
        H C_k (2 I - L)' at these pixels. `within` minus its product with the estimate's gain is the error's matrix.
    within : (component, pixel, coefficient, coefficient) float64
        Sum of C_k and (L mu_k - mu_k)(L mu_k - mu_k)' for each middle pixel's coefficients.
    """

    weights: Floats
    means: Floats
    signal: Floats
    spread: Floats
    cross: Floats
    error_cross: Floats
    within: Floats


def sampled(prior: Gaussians, sampling: Floats, middle: NDArray[np.intp], lens: Floats) -> Samples:
    """Compute the moments of a mosaic's samples of a prior's patches.

    Parameters
    ----------
    prior : Gaussians
    sampling : (sample, pixel, coefficient) float64
        H, the electrons of each sample from each pixel's coefficients.
    middle : (pixel,) intp
        Pixels whose error counts, because the others lack neighbours.
    lens : (pixel, pixel) float64
        L, the share of one pixel's light (second axis) that falls on another (first axis); `sampling` includes it.
    """
    components, pixels, coefficients = prior.means.shape
    h = sampling.reshape(len(sampling), -1)
    f = prior.directions.reshape(components, pixels * coefficients, -1)
    hc = (h @ f) @ f.swapaxes(1, 2) + prior.rest[:, None, None] * h
    means = prior.means.reshape(components, -1) @ h.T
    by_pixel = hc.reshape(components, len(h), pixels, coefficients)
    signal = hc @ h.T
    cross = np.einsum("pq,ksqc->kspc", lens[middle], by_pixel, optimize=True)
    off = np.einsum("pq,kqc->kpc", lens[middle], prior.means) - prior.means[:, middle]
    inside = np.concatenate([prior.directions[:, middle], off[..., None]], axis=-1)
    return Samples(
        weights=prior.weights,
        means=means,
        signal=signal,
        spread=np.diagonal(signal, axis1=1, axis2=2) - (prior.brightness * means) ** 2,
        cross=cross,
        error_cross=2 * by_pixel[:, :, middle] - cross,
        within=inside @ inside.swapaxes(-1, -2) + prior.rest[:, None, None, None] * np.eye(coefficients),
    )


def best_estimate(samples: Samples, scale: float, noise: Noise) -> tuple[Floats, Floats]:
    """Compute the gain of the best linear estimate, (component, sample, pixel, coefficient), and its error's matrix.

    The matrix has the form of `Samples.within`. With a lens it isn't symmetric; in a quadratic form only its symmetric
    part counts.

    Parameters
    ----------
    samples : Samples
    scale : float
        Light times exposure, in units of that of `samples`.
    noise : Noise
    """
    variance = sample_variance(scale * samples.means, scale**2 * samples.spread, noise)
    total = scale**2 * samples.signal + variance[..., None] * np.eye(variance.shape[1])
    cross = scale * samples.cross
    gain = np.asarray(np.linalg.solve(total, cross.reshape(*cross.shape[:2], -1))).reshape(*cross.shape)
    return gain, samples.within - np.einsum("kspc,kspe->kpce", scale * samples.error_cross, gain, optimize=True)


def expected_error(samples: Samples, scale: float, noise: Noise, forms: Floats) -> Floats:
    """Compute the expected squared error of a middle pixel's best estimate if the component is known, (metric,).

    Parameters
    ----------
    samples, scale, noise
        As in `best_estimate`.
    forms : (metric, component, pixel, coefficient, coefficient) float64
        W. The squared error of a pixel is e' W e, where e is the error of its coefficients.
    """
    left = best_estimate(samples, scale, noise)[1]
    return np.asarray(np.einsum("k,mkpce,kpce->m", samples.weights, forms, left, optimize=True) / left.shape[1])
