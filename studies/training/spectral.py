"""Train the prior over patches of reflectance (`isp.design.spectral_prior`) on the same pictures as the one of `ple`.

Pictures are drawn as reflectances in bands, and projected on the first principal directions of reflectances.
"""

from functools import partial
from hashlib import sha256
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from skimage import data

from isp.design.spectral_prior import PATCH
from isp.ple.prior import Prior
from render.illuminants import illuminant
from render.spectrum import band_widths, luminous_efficiency
from rodcone.colour_spaces import decode_srgb, luminance_of_srgb
from rodcone.files import replacing
from studies.training.pictures import (
    KINDS,
    NM,
    PHOTOGRAPHS,
    UNKNOWN,
    KnownLight,
    draw_illuminant,
    draw_pictures,
    draw_surface,
)
from studies.training.train import cut_patches, fit_prior, training_provenance

BANDS, COEFFICIENTS, DIRECTIONS = 20, 8, 144
KINDS_OF = {"drawn": KINDS, "photographs": 3 * PHOTOGRAPHS}
QUANTILES = (0.1, 0.3, 0.5, 0.7, 0.9)  # the middles of five equal parts
_SURFACES = 6000
_LEAST_REFLECTANCE = 5e-3  # mean of a patch below which it is mostly grain, and doesn't count


def train_spectral_prior(kind: str, seed: int, path: Path) -> str:
    """Draw the pictures, fit the mixture and write it to a file; return the provenance as JSON.

    Parameters
    ----------
    kind : str
        "drawn", drawn pictures and photographs, or "photographs" alone.
    seed : int
        Seed of the pictures, their patches and the fit's start.
    path : Path
        File to write (.npz).
    """
    to_bands = np.repeat(np.eye(BANDS), len(NM) // BANDS, axis=1) * BANDS / len(NM)
    rng = np.random.default_rng([seed, 1])
    surfaces = np.stack([draw_surface(rng) for _ in range(_SURFACES)]) @ to_bands.T
    # Scaled to a mean square of 1, so that coefficients are about as large as reflectances.
    spectra = np.linalg.svd(surfaces, full_matrices=False)[2][:COEFFICIENTS].T * np.sqrt(BANDS)
    edges_nm = np.linspace(380.0, 780.0, BANDS + 1)
    middle_nm = (edges_nm[1:] + edges_nm[:-1]) / 2
    width_nm = np.diff(edges_nm)
    luminous = luminous_efficiency(middle_nm, width_nm)
    digest = sha256()
    rows = []
    for picture in draw_pictures(partial(_draw_light, to_bands=to_bands), seed, KINDS_OF[kind]):
        digest.update(picture.tobytes())
        patches = cut_patches(picture, rng)
        mean = (patches.mean(axis=(1, 2)) @ luminous) / luminous.sum()
        bright = mean > _LEAST_REFLECTANCE
        relative = patches[bright] / mean[bright, None, None, None]
        rows.append((relative @ spectra / BANDS).reshape(bright.sum(), -1).astype(np.float32))
    patches = np.concatenate(rows)
    rng.shuffle(patches)
    source = training_provenance(
        f"rodcone train --spectral {kind} --seed {seed}", seed, digest.hexdigest(), len(patches)
    )
    fit = fit_prior(patches, np.ones((1, 4)), rng, source, DIRECTIONS)
    _save(fit, edges_nm, spectra, path)
    return source


def _draw_light(rng: np.random.Generator, to_bands: NDArray[np.float64]) -> KnownLight:
    """Draw a light as a ratio to D65, and balance it as three channels can; one light in `UNKNOWN` isn't balanced.

    The channels' signals then differ from each other as much as under the lights of the prior of `ple`.
    """
    widths = band_widths(NM)
    over_d65 = np.divide(*(illuminant(name).band_average(NM, widths) for name in (draw_illuminant(rng), "D65")))
    bands = to_bands @ over_d65
    shape = np.vander((np.arange(BANDS) + 0.5) / BANDS - 0.5, 3)
    balance = shape @ np.linalg.lstsq(shape, bands, rcond=None)[0]
    if rng.random() < 1 / UNKNOWN or balance.min() <= 0.05 * balance.max():
        balance = np.full(BANDS, bands.mean())
    return KnownLight(to_bands * over_d65 / balance[:, None])


def photographs_reflectances() -> NDArray[np.float64]:
    """Return the `QUANTILES` of luminous reflectance over patches of photographs; each photograph has equal weight."""
    by_photograph = []
    for name in PHOTOGRAPHS:
        encoded = getattr(data, name)() / 255.0
        linear = decode_srgb(encoded)
        luminance = luminance_of_srgb(linear) if linear.ndim == 3 else linear
        side = 2 * PATCH  # because training halves the photographs
        height, width = (size // side * side for size in luminance.shape)
        blocks = luminance[:height, :width].reshape(height // side, side, width // side, side).mean(axis=(1, 3))
        by_photograph.append(np.quantile(blocks[blocks > _LEAST_REFLECTANCE], np.linspace(0.0, 1.0, 1001)))
    return np.asarray(np.quantile(np.concatenate(by_photograph), QUANTILES))


def _save(fit: Prior, edges_nm: NDArray[np.float64], spectra: NDArray[np.float64], path: Path) -> None:
    """Write the prior to a file, with its factors and its basis in half precision."""
    lower = fit.factors[:, *np.tril_indices(fit.factors.shape[1])].astype(np.float16)
    with replacing(path) as (place,), place.open("wb") as file:
        np.savez_compressed(
            file, source=fit.source, edges_nm=edges_nm, spectra=spectra, mean=fit.mean, factors=lower,
            basis=fit.basis.astype(np.float16), weights=fit.weights, centres=fit.centres, rest=fit.rest,
            reflectances=photographs_reflectances(), allow_pickle=False,
        )  # fmt: skip
