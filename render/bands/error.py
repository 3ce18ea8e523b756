"""Error that remains because light is known only by its band means, in what the eye and a camera's channels collect.

A lamp's spectrum is known to its lines (`render.band_weights`). What isn't known is how surfaces vary within a band,
beyond what neighbouring bands show. The error is the expected error of a Gaussian process. Its variance is estimated
from the scene: the squared second differences of the transport over wavelength, divided by their expected value for a
process of variance 1.
"""

import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache, partial

import numpy as np
from numpy.typing import NDArray

from render.band_weights import Curves, band_covariance, band_weights, transport_weights
from render.bands.mixed_light import BandLight
from render.error_estimates import spread_pixels
from render.scene import LightGroup
from render.spectrum import OBSERVER_NM, Spectrum, observer, per_joule
from rodcone.types import Floats, Planes

MOST_BAND_ERROR = 0.01  # share of what the eye's x, y or z collects; a larger error of wide bands is reported
LEAST_SIGNAL = 0.02  # share of x, y and z together; an observer curve that collects less isn't judged


class WideBandsWarning(UserWarning):
    """Warning that surfaces vary within bands by more than neighbouring bands show."""


@dataclass(frozen=True)
class CurveTerms:
    """Weights for the integral of curves over one lamp's light, and numbers for its expected error.

    Attributes
    ----------
    weights : (curve, band) float64
        Weights of the transport's band means.
    deviation : (curve,) float64
        Expected error of each integral, for transport of variance 1.
    differences : (difference, band) float64
        Matrix that gives, from band means, the part of each band's mean that its neighbours don't predict.
    expected : (difference,) float64
        Expected square of each difference, for transport of variance 1.
    centre : (difference,) int
        Index of the band of each difference.
    """

    weights: Floats
    deviation: Floats
    differences: Floats
    expected: Floats
    centre: NDArray[np.intp]


def curve_error(
    lights: Mapping[str, LightGroup],
    mixture: BandLight,
    radiance: Planes,
    wavelength_nm: Floats,
    width_nm: Floats,
    responses: Mapping[str, Spectrum] | None = None,
) -> dict[str, float]:
    """Estimate the relative error of the integral of each curve over the light, RMS over lit pixels.

    Parameters
    ----------
    lights : mapping of str to LightGroup
    mixture : BandLight
        The same lights as they are in the picture, referred to one spectrum.
    radiance : (group, band, h, w) float32
        Radiance at unit spectral emission.
    wavelength_nm, width_nm : (band,) float64
    responses : mapping of str to Spectrum, optional
        Curves in electrons per photon, by default the CIE 1931 observer's x, y and z.
    """
    names = ["x", "y", "z"] if responses is None else list(responses)
    chosen = radiance[spread_pixels(radiance.shape[2:])].astype(np.float64)
    missed, moved, total = np.zeros((3, len(names), *chosen.shape[2:]))
    curves, knots_nm = (observer, OBSERVER_NM) if responses is None else _of_photons(responses)
    together = band_weights(curves, knots_nm, wavelength_nm, width_nm, mixture.spectrum) if mixture.mixed else None
    for light, light_map, transport in zip(lights.values(), mixture.maps, chosen, strict=True):
        if not light.power:
            continue
        if responses is None:
            shape = light.spectrum.wavelength_nm.tobytes(), light.spectrum.values.tobytes()
            terms = _observer_terms(wavelength_nm.tobytes(), width_nm.tobytes(), *shape)
        else:
            terms = curve_terms(curves, knots_nm, wavelength_nm, width_nm, light.spectrum)
        total += light.power * np.tensordot(terms.weights, transport, 1)
        missed += light.power * _missed(terms, transport)
        if together is not None:  # error by the lamps' common spectrum in place of this lamp's
            moved += np.tensordot(together @ light_map - light.power * terms.weights, transport, 1)
    relative = np.divide(np.hypot(missed, moved), total, out=np.zeros_like(total), where=total > 0)
    lit = np.maximum((total > 0).sum(axis=(1, 2)), 1)
    errors = np.sqrt(np.square(relative).sum(axis=(1, 2)) / lit)
    if responses is None:  # a curve that collects nearly nothing isn't judged
        share = total.sum(axis=(1, 2)) / max(float(total.sum()), np.finfo(float).tiny)
        errors = np.where(share >= LEAST_SIGNAL, errors, 0.0)
    return dict(zip(names, errors.tolist(), strict=True))


def curve_terms(
    curves: Curves, knots_nm: Floats, wavelength_nm: Floats, width_nm: Floats, light: Spectrum
) -> CurveTerms:
    """Compute the terms of one lamp; the parameters are those of `render.band_weights.band_weights`."""
    weights, deviation = transport_weights(curves, knots_nm, wavelength_nm, width_nm, light)
    if not deviation.any():
        none = np.zeros(0)
        return CurveTerms(weights, deviation, none.reshape(0, wavelength_nm.size), none, none.astype(np.intp))
    differences, centre = _differences(wavelength_nm)
    among = band_covariance(wavelength_nm, width_nm)
    expected = np.einsum("da,ab,db->d", differences, among, differences, optimize=True)
    return CurveTerms(weights, deviation, differences, expected, centre)


def warn_of_wide_bands(errors: Mapping[str, float], width_nm: Floats) -> None:
    """Warn (`WideBandsWarning`) where `curve_error` of the observer is large."""
    worst = max(errors.values())
    if worst > MOST_BAND_ERROR:
        warnings.warn(
            f"bands: colours and a sensor's channels are off by about {worst:.1%}, for surfaces vary within bands of "
            f"up to {width_nm.max():g} nm more than their neighbours tell; give narrower ones, as --bands of rodcone "
            "render, or for a lamp's lines rodcone.line_bands",
            WideBandsWarning,
            stacklevel=3,
        )


@lru_cache(maxsize=64)
def _observer_terms(nm: bytes, width_nm: bytes, light_nm: bytes, light: bytes) -> CurveTerms:
    spectrum = Spectrum(np.frombuffer(light_nm), np.frombuffer(light))
    return curve_terms(observer, OBSERVER_NM, np.frombuffer(nm), np.frombuffer(width_nm), spectrum)


def _of_photons(responses: Mapping[str, Spectrum]) -> tuple[Curves, Floats]:
    """Convert responses per photon to curves per joule; also return the wavelengths of their corners."""
    curves = tuple(responses.values())
    return partial(per_joule, curves), np.concatenate([x.wavelength_nm for x in curves])


def _differences(nm: Floats) -> tuple[Floats, NDArray[np.intp]]:
    """Return the matrix of each inner band's difference from the line through its neighbours, and the bands' indices.

    With two bands it holds the difference between them, with one band the band itself.
    """
    if nm.size < 3:
        rows = np.array([[1.0]]) if nm.size == 1 else np.array([[-1.0, 1.0]])
        return rows, np.zeros(1, np.intp)
    inner = np.arange(1, nm.size - 1)
    rows = np.zeros((inner.size, nm.size))
    along = (nm[inner] - nm[inner - 1]) / (nm[inner + 1] - nm[inner - 1])
    rows[inner - 1, inner], rows[inner - 1, inner - 1], rows[inner - 1, inner + 1] = 1.0, along - 1, -along
    return rows, inner


def _missed(terms: CurveTerms, transport: Floats) -> Floats:
    """Estimate the error of each curve's integral in each pixel, shape (curve, h, w)."""
    if not terms.expected.size:
        return np.zeros((len(terms.weights), *transport.shape[1:]))
    squared = np.square(np.tensordot(terms.differences, transport, 1))
    counts = terms.weights[:, terms.centre] ** 2
    variance = (
        np.tensordot(counts, squared, 1) / np.maximum(counts @ terms.expected, np.finfo(float).tiny)[:, None, None]
    )
    return np.asarray(terms.deviation[:, None, None] * np.sqrt(variance))
