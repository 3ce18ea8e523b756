"""Slope of the expected error by the electrons of each sample from each coefficient: what a better filter would pass.

With G = S^-1 H C, S = H C H' + N, the error of the middle pixels is tr W (C - C H' G); N depends on H through a
sample's mean H mu and its spread H C H'. With D = G W G', the adjoint of the posterior covariance is

    dE/dH = 2 (D H C - G W C) + diag(D) (N_mean mu' + 2 N_spread H C)        C at the middle pixels where it follows W
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

from isp.design.expected_error import LEAST_OPEN, Doubles, Gaussians, Noise, sample_variance


def variance_slopes(mean_e: Doubles, spread_e2: Doubles, noise: Noise) -> tuple[Doubles, Doubles]:
    """Slopes of `sample_variance` by the mean and by the spread of expected electrons, where the mean is above 0."""
    mean_e = np.maximum(mean_e, 0.0)
    variance = noise.shot * mean_e + noise.dark_e**2 + (noise.prnu * mean_e) ** 2
    by_mean = noise.shot + 2 * noise.prnu**2 * mean_e
    if np.all(np.isinf(noise.full_e)):
        return by_mean, np.zeros_like(mean_e)
    width = np.sqrt(variance + spread_e2)
    z = (noise.full_e - mean_e) / width
    open_share = ndtr(z)
    # Slope of 1 / open_share by z; what is full almost surely has the least share, which doesn't move.
    by_z = -np.exp(-(z**2) / 2) / np.sqrt(2 * np.pi) / np.maximum(open_share, LEAST_OPEN) ** 2
    by_z = np.where(open_share > LEAST_OPEN, by_z, 0.0)
    z_by_spread = -z / (2 * width**2)
    by_mean = by_mean / np.maximum(open_share, LEAST_OPEN) + variance * by_z * (z_by_spread * by_mean - 1 / width)
    return by_mean, variance * by_z * z_by_spread


@dataclass(frozen=True, eq=False)
class Case:
    """Light that a patch is seen at.

    Attributes
    ----------
    scale : float
        Light times exposure, over the unit of the sampling.
    noise : Noise
    rows : (component, pixel, direction, coefficient) float64
        R: a middle pixel's squared error is |R e|^2, e that of its coefficients.
    """

    scale: float
    noise: Noise
    rows: Doubles


def error_slopes(
    patches: Gaussians, sampling: Doubles, middle: NDArray[np.intp], cases: Sequence[Case]
) -> tuple[Doubles, Doubles]:
    """Expected squared error of a middle pixel, component known, and its slope by `sampling`, of each case.

    Parameters
    ----------
    patches : Gaussians
    sampling : (sample, pixel, coefficient) float64
        H: electrons of each sample from each pixel's coefficients, in unit light.
    middle : (pixel,) intp
        Pixels whose error counts.
    cases : sequence of Case

    Returns
    -------
    errors : (case,) float64
    slopes : (case, sample, pixel, coefficient) float64
    """
    h = sampling.reshape(len(sampling), -1)
    errors, slopes = np.zeros(len(cases)), np.zeros((len(cases), *h.shape))
    for k, weight in enumerate(patches.weights):
        mean, f, rest = patches.means[k].ravel(), patches.factors[k].reshape(h.shape[1], -1), patches.rest[k]
        hc = (h @ f) @ f.T + rest * h
        hch, hm = hc @ h.T, h @ mean
        for case, one in enumerate(cases):
            r, t = one.rows[k], one.scale
            # R C at the middle pixels, and tr R C R'.
            rf = np.einsum("pdc,pcf->pdf", r, patches.factors[k][middle])
            rc = (rf @ f.T).reshape(*r.shape[:2], *sampling.shape[1:])
            rc[np.arange(len(middle)), :, middle] += rest * r
            rc = rc.reshape(-1, h.shape[1])
            rcr = np.sum(rf**2) + rest * np.sum(r**2)
            # S, G R' and D, of H in this light.
            spread_e2 = t**2 * np.diag(hch)
            total = t**2 * hch + np.diag(sample_variance(t * hm, spread_e2, one.noise))
            hcr = t * h @ rc.T
            g = np.linalg.solve(total, hcr)
            d = g @ g.T
            errors[case] += weight * (rcr - np.sum(g * hcr))
            by_mean, by_spread = variance_slopes(t * hm, spread_e2, one.noise)
            by_mean, by_spread = np.diag(d) * by_mean * (hm > 0), np.diag(d) * by_spread
            slope = 2 * (d @ hc * t - g @ rc) + by_mean[:, None] * mean + 2 * t * by_spread[:, None] * hc
            slopes[case] += weight * t * slope
    return errors / len(middle), slopes.reshape(-1, *sampling.shape) / len(middle)
