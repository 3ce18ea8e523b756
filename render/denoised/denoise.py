"""Indirect light denoised by Intel's Open Image Denoise in six spectral planes, guided by the visible surfaces.

Indirect light divided by albedo is smooth on a smooth surface, whatever its texture. Its spectra vary little: hat
functions sum the bands to six planes, and a least-squares matrix, fitted to the picture itself, leads back to the
bands.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from render.error_estimates import Halves
from render.integrator.wavefront import Span, seed_of, traced, tracers
from render.loader import PART_BANDS, Film, LoadedScene
from rodcone.display import brief
from rodcone.optional import optional_library
from rodcone.types import Planes

EXTRA = "denoise"
SPECTRA = 6  # planes to which bands are summed: two calls of the denoiser, with three planes each
LEAST_ALBEDO = 0.02  # smallest albedo that light is divided by; on darker surfaces the quotient would be mere noise
SURFACE_POINTS = 64  # samples per pixel of the first surfaces
SURFACE_THREADS = 1 << 20  # threads per launch
MIXING_PIXELS = 2.0  # standard deviation of the window that averages squared errors
# Singular values below this share of the largest one count as 0. They are squared, because the matrix is a product of
# the light with its own transpose, and the light has single precision.
ROUNDING = 1e-10
_PLANES = 3  # planes that the denoiser accepts in one call


@dataclass(frozen=True)
class Denoised:
    """Denoised light of each group at unit spectral emission, and two folds that measure its error.

    Attributes
    ----------
    radiance : (group, band, h, w) float32
        The unbiased light with its indirect part denoised, each group by itself.
    indirect : Halves of (group, band, h, w)
        The indirect part before it was denoised.
    folds : Halves of (group, band, h, w)
        Two independent renders that measure the error of `radiance`, which contains no part of them.
    fold_points : int
        Samples of each fold in a pixel of rate 1.
    """

    radiance: Planes
    indirect: Halves
    folds: Halves
    fold_points: int

    __repr__ = brief


def denoiser() -> Any:
    """Import the library of the denoiser.

    Raises
    ------
    InputError
        Where it isn't installed.
    """
    return optional_library("mitsuba_oidn", EXTRA)


def first_surfaces(loaded: LoadedScene, film: Film, seed: int) -> tuple[Planes, Planes]:
    """Return each pixel's mean albedo (band, h, w) and normal (3, h, w) of the first surfaces that scatter light.

    `seed` must differ from that of the light's paths, because the two would otherwise share their noise.
    """
    once = np.ones(film.size, np.uint32)
    span = Span(0, SURFACE_POINTS, 1)
    group_seed = seed_of(seed, loaded.groups[0], 0)
    traces = (tracer.first_surface for tracer in tracers(loaded, film, PART_BANDS, group_seed))
    images = [traced(trace, once, span, SURFACE_THREADS, group_seed) for trace in traces]
    return np.concatenate([image["albedo"][0] for image in images]), images[0]["normal"][0]


def denoised(indirect: Planes, difference: Planes, albedo: Planes, normal: Planes) -> Planes:
    """Denoise the indirect light of one light group, (band, h, w).

    The result is m = x + s (D(x) - x) for noisy light x and a denoiser D, which smooths detail as well as noise. s in 0
    to 1 minimises the expected squared error of m: the variance of x follows from half the difference of the halves,
    the error of D from two-fold cross-validation, one half denoised against the other.

    Parameters
    ----------
    indirect, difference : (band, h, w) float32
        Mean of the two halves, and half their difference.
    albedo : (band, h, w) float32
    normal : (3, h, w) float32

    Raises
    ------
    InputError
        Where the denoiser isn't installed.
    """
    library = denoiser()
    if not indirect.any():
        return indirect
    # Reduce light over albedo, scaled to a mean of 1, to few spectra.
    unit = np.maximum(albedo, np.float32(LEAST_ALBEDO))
    unit *= np.float32((indirect / unit).mean(dtype=np.float64))
    hats = _hats(len(indirect))
    light = np.asarray(indirect / unit, np.float32)
    reduced, error = (np.asarray(np.tensordot(hats, x, 1), np.float32) for x in (light, difference / unit))
    # Denoise the whole picture and each half of it.
    # The library takes normals only beside an albedo. Light is divided by albedo already, so a constant one is given.
    guide = _channels_last(normal)
    options = {"hdr": True, "albedo": np.full_like(guide, 0.5), "normal": guide, "clean_aux": True}
    options["device"] = library.Device(library.DeviceType.CPU)  # so that every machine gives the same light

    def filtered(planes: Planes) -> Planes:
        indices = np.minimum(np.arange(-(-len(planes) // _PLANES) * _PLANES), len(planes) - 1)
        images = [library.denoise(_channels_last(planes[triple]), **options) for triple in indices.reshape(-1, _PLANES)]
        return np.concatenate([np.moveaxis(image, -1, 0) for image in images])[: len(planes)]

    even = np.maximum(reduced + error, 0)
    odd = np.maximum(reduced - error, 0)
    share = _denoised_share(error, (filtered(even) - odd, filtered(odd) - even))
    mixture = reduced + share * (filtered(reduced) - reduced)
    return np.asarray(np.maximum(np.tensordot(_spectra_to_bands(light, reduced), mixture, 1), 0) * unit)


def _denoised_share(error: Planes, residuals: tuple[Planes, Planes]) -> Planes:
    """Compute the share s of denoised light in each pixel (h, w): V / (V + E), as in a Wiener filter.

    V is the variance of the noisy light and E the squared error of the denoised light, both averaged over a Gaussian
    window.

    Parameters
    ----------
    error : (spectrum, h, w) float32
        Half the difference of the halves.
    residuals : pair of (spectrum, h, w) float32
        Each half, denoised, minus the other half: the error of the one plus the noise of the other.
    """
    from scipy.ndimage import gaussian_filter  # imported here, because a render without denoiser doesn't need it

    variance, even, odd = (gaussian_filter(np.square(x).mean(axis=0), MIXING_PIXELS) for x in (error, *residuals))
    # A squared residual is E of one denoised half plus the variance of the other half, 2 V. E of a half is an upper
    # bound for E of the whole picture, which has less noise. Over the window's 4 pi s^2 independent pixels, the
    # estimate of 2 V has the relative error sqrt(2 / pixels); only what exceeds 2 V by more than that counts as E.
    of_half = 2 * variance
    pixels = 4 * np.pi * MIXING_PIXELS**2
    squared = np.maximum((even + odd) / 2 - of_half - of_half * (2 / pixels) ** 0.5, 0)
    total = variance + squared
    return np.asarray(np.divide(variance, total, out=np.ones_like(total), where=total > 0))


def _hats(bands: int) -> Planes:
    """Return hat functions over the bands, each of sum 1: (spectrum, band)."""
    count = min(SPECTRA, bands)
    place = np.linspace(0, count - 1, bands)
    hats = np.maximum(0, 1 - np.abs(place - np.arange(count)[:, None]))
    return np.asarray(hats / hats.sum(axis=1, keepdims=True), np.float32)


def _spectra_to_bands(bands: Planes, reduced: Planes) -> Planes:
    """Fit the least-squares matrix (band, spectrum) that leads from the few spectra back to the picture's bands."""
    source, target = (planes.reshape(len(planes), -1).astype(np.float64) for planes in (reduced, bands))
    return np.asarray(target @ source.T @ np.linalg.pinv(source @ source.T, rcond=ROUNDING), np.float32)


def _channels_last(planes: Planes) -> Planes:
    """Move the planes' axis to the end, where the denoiser expects it."""
    return np.ascontiguousarray(np.moveaxis(planes, 0, -1), np.float32)
