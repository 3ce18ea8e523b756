"""Slope of the expected error by the electrons of each sample from each coefficient: what a better filter would pass.

With G = S^-1 H C, S = H C H' + N, the error of the middle pixels is tr W (C - C H' G); N depends on H through a
sample's mean H mu and its spread H C H' - (b H mu)^2. With D = G W G', the adjoint of the posterior covariance is

    dE/dH = 2 (D H C - G W C) + diag(D) ((N_mean - 2 b^2 N_spread H mu) mu' + 2 N_spread H C),

C at the middle pixels where it follows W.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from isp.design.expected_error import FAR, Gaussians, Noise, best_estimate, opening, sampled
from rodcone.types import Floats


def variance_slopes(mean_e: Floats, spread_e2: Floats, noise: Noise) -> tuple[Floats, Floats]:
    """Slopes of `sample_variance` by the mean and by the spread of expected electrons."""
    lit, mean_e = mean_e > 0, np.maximum(mean_e, 0.0)
    total = noise.law.variance(mean_e) + spread_e2
    distance = np.minimum((noise.full_e - mean_e) / np.sqrt(total), FAR)
    share, by_distance = opening(distance)
    # The variance is total / share - spread.
    by_distance = -total / share**2 * by_distance
    by_total = 1 / share - by_distance * distance / (2 * total)
    by_mean = by_total * noise.law.slope(mean_e) - by_distance / np.sqrt(total)
    return by_mean * lit, by_total - 1


def error_slopes(
    patches: Gaussians,
    sampling: Floats,
    middle: NDArray[np.intp],
    lights: Sequence[tuple[Floats, Noise]],
    rows: Sequence[Sequence[Floats]],
) -> tuple[Floats, Floats]:
    """Mean over scenes of the expected squared error of a middle pixel, component known, and its slope by `sampling`.

    Parameters
    ----------
    patches : Gaussians
    sampling : (sample, pixel, coefficient) float64
        H: electrons of each sample from each pixel's coefficients, in unit light.
    middle : (pixel,) intp
        Pixels whose error counts.
    lights : sequence of ((scene,) float64, Noise)
        Light times exposure of each scene, over the unit of `sampling`, and the noise.
    rows : sequence of sequence of (component, pixel, direction, coefficient) float64
        R of each metric of each scene: a middle pixel's squared error is |R e|^2, e that of its coefficients.

    Returns
    -------
    errors : (light, metric) float64
    slopes : (light, metric, sample, pixel, coefficient) float64
    """
    # Signals in unit light.
    components, pixels, coefficients = patches.means.shape
    h, means = sampling.reshape(len(sampling), -1), patches.means.reshape(components, -1)
    samples, eye = sampled(patches, sampling, middle, np.eye(pixels)), np.eye(len(h))
    weights = patches.weights[:, None, None, None] / len(middle) / len(rows)
    errors = np.zeros((len(lights), len(rows[0])))
    # Slopes by what H C, C at the middle pixels, and mu are multiplied with.
    parts = samples.signal, samples.cross, samples.means
    by_hc, by_middle, by_mean = (np.zeros((*errors.shape, *x.shape)) for x in parts)
    for index, (scales, noise) in enumerate(lights):
        for t, scene in zip(scales, rows, strict=True):
            g, left = best_estimate(samples, t, noise)
            mean = t * samples.means
            by_noise_mean, by_noise_spread = variance_slopes(mean, t**2 * samples.spread, noise)
            by_noise_mean = by_noise_mean - 2 * patches.brightness**2 * mean * by_noise_spread
            for metric, r in enumerate(scene):
                gr = weights * np.einsum("kspc,kpdc->kspd", g, r, optimize=True)
                errors[index, metric] += np.einsum("k,kpdc,kpce,kpde->", weights[:, 0, 0, 0], r, left, r, optimize=True)
                by_middle[index, metric] += t * np.einsum("kspd,kpdc->kspc", gr, r, optimize=True)
                gr = gr.reshape(*mean.shape, -1)
                d = gr @ gr.swapaxes(1, 2) / weights[..., 0]
                by_noise = np.diagonal(d, axis1=1, axis2=2)
                by_hc[index, metric] += t**2 * (d + (by_noise * by_noise_spread)[..., None] * eye)
                by_mean[index, metric] += t * by_noise * by_noise_mean
    # H C, and C of the middle pixels with all.
    f, rest = patches.directions.reshape(components, pixels * coefficients, -1), patches.rest[:, None, None]
    chosen = (middle[:, None] * coefficients + np.arange(coefficients)).ravel()
    hc = (h @ f) @ f.swapaxes(1, 2) + rest * h
    at_middle = f[:, chosen] @ f.swapaxes(1, 2) + rest * np.eye(h.shape[1])[chosen]
    over, by_middle = ([2, 4], [0, 1]), by_middle.reshape(*errors.shape, *samples.means.shape, -1)
    slopes = 2 * np.tensordot(by_hc, hc, over) - 2 * np.tensordot(by_middle, at_middle, over)
    slopes += np.tensordot(by_mean, means, (2, 0))
    return errors, slopes.reshape(*errors.shape, *sampling.shape)
