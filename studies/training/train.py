"""Train a prior for the response curves of a camera, and state its provenance.

The prior is a mixture of Gaussians over patches, fitted by expectation and maximisation (Dempster, Laird & Rubin 1977).
"""

import json
from collections.abc import Iterable
from functools import partial
from hashlib import sha256
from importlib import metadata

import numpy as np
from numpy.typing import NDArray

from isp.ple.prior import PATCH, Prior
from sensor.config import SensorConfig
from studies.training.pictures import LIGHTS, Planes, draw_light, draw_pictures, neutral_ratios, photograph_hashes

Matrix = NDArray[np.float32]

COMPONENTS, DIRECTIONS, STEPS = 48, 112, 10  # Gaussians, principal directions, steps of expectation and maximisation
PATCHES = 3500  # patches drawn per 65 536 pixels
_LEAST_LIGHT = 5e-3  # patches with a mean below this share of white are left out, because they are mostly grain
_FLOOR = 2e-6  # added to every variance
_LEAST_PART = 1e-3  # a patch counts for a component if it belongs to it with at least this probability


def draw_patches(pictures: Iterable[Planes], rng: np.random.Generator) -> Matrix:
    """Draw patches that are turned and mirrored at random, shape (patch, 8 * 8 * 4).

    Each number is the square root of a signal, after division by the patch's mean of W.
    """
    rows = []
    for picture in pictures:
        patches = cut_patches(picture, rng)
        light = patches[..., 3].mean(axis=(1, 2))
        bright = light > _LEAST_LIGHT
        rows.append(np.sqrt(patches[bright] / light[bright, None, None, None]).reshape(bright.sum(), -1))
    result = np.concatenate(rows)
    rng.shuffle(result)
    return result


def cut_patches(picture: Planes, rng: np.random.Generator) -> Planes:
    """Cut random patches from a picture, turned and mirrored at random, shape (patch, 8, 8, channel)."""
    count = max(200, PATCHES * picture[..., 0].size // 65536)
    ys, xs = (rng.integers(0, size - PATCH + 1, count) for size in picture.shape[:2])
    patches = np.stack([picture[y : y + PATCH, x : x + PATCH] for y, x in zip(ys, xs, strict=True)])
    turns = rng.integers(0, 8, count)
    for turn in range(8):
        turned = np.rot90(patches[turns == turn], turn % 4, axes=(1, 2))
        patches[turns == turn] = turned[:, ::-1] if turn > 3 else turned
    return patches


def fit_prior(
    patches: Matrix,
    neutrals_e: NDArray[np.float64],
    rng: np.random.Generator,
    source: str,
    directions: int = DIRECTIONS,
) -> Prior:
    """Fit `COMPONENTS` Gaussians in the patches' principal directions.

    Parameters
    ----------
    patches : (patch, number) float32
        Patches from `draw_patches`, or of coefficients of reflectance (`studies.training.spectral`).
    neutrals_e, source
        As in `isp.ple.prior.Prior`.
    """
    mean = patches.mean(axis=0)
    centred = patches - mean
    _, vectors = np.linalg.eigh((centred.T @ centred / len(centred)).astype(np.float64))
    basis = np.ascontiguousarray(vectors[:, ::-1][:, :directions], dtype=np.float32)
    reduced = centred @ basis
    weights, centres, factors, parts = _expect_and_maximise(reduced, _first_parts(reduced, rng))
    outside = np.maximum((centred**2).sum(axis=1) - (reduced**2).sum(axis=1), 0.0)
    rest = np.maximum(parts.T @ outside / (weights * len(patches)) / (patches.shape[1] - directions), 1e-7)
    return Prior(neutrals_e, mean, basis, weights, centres, factors, rest, source)


def _first_parts(reduced: Matrix, rng: np.random.Generator) -> Matrix:
    """Return the initial component of each patch, as an array (patch, component) that is 1 for this one and else 0.

    One third of the components are formed by contrast, so that flat patches get their own; the rest by k-means.
    """
    count = len(reduced)
    even = COMPONENTS // 3
    centres = reduced[rng.choice(count, COMPONENTS - even, replace=False)]
    for _ in range(6):
        distance = (centres**2).sum(axis=1) - 2 * reduced @ centres.T
        nearest = distance.argmin(axis=1)
        for k in np.flatnonzero(np.bincount(nearest, minlength=len(centres)) > 10):
            centres[k] = reduced[nearest == k].mean(axis=0)
    nearest += even
    ordered = np.argsort(reduced[:, 1:].std(axis=1))[: count // 2]
    for index, members in enumerate(np.array_split(ordered, even)):
        nearest[members] = index
    return np.asarray(np.eye(COMPONENTS, dtype=np.float32)[nearest])


def _expect_and_maximise(reduced: Matrix, parts: Matrix) -> tuple[Matrix, Matrix, Matrix, Matrix]:
    """Return weights, centres, the covariances' lower factors, and the probability of each component for each patch."""
    count, size = reduced.shape
    centres = np.empty((COMPONENTS, size), np.float32)
    factors = np.empty((COMPONENTS, size, size), np.float32)
    for _ in range(STEPS):
        members = parts.sum(axis=0) + 1e-6
        likelihood = np.empty_like(parts)
        for k in range(COMPONENTS):
            members_of = parts[:, k] > _LEAST_PART
            part = parts[members_of, k, None]
            centres[k] = (part * reduced[members_of]).sum(axis=0) / members[k]
            off = reduced[members_of] - centres[k]
            # A component's covariance is shrunk towards 0 if it has few patches, because they can't determine it.
            covariance = ((off * part).T @ off).astype(np.float64) / (members[k] + size)
            factors[k] = np.linalg.cholesky(covariance + _FLOOR * np.eye(size))
            inverse = np.linalg.inv(factors[k].astype(np.float64)).astype(np.float32)
            scaled = (reduced - centres[k]) @ inverse.T
            likelihood[:, k] = np.log(members[k] / count) - np.log(np.diag(factors[k])).sum() - 0.5 * (scaled**2).sum(1)
        parts = np.exp(likelihood - likelihood.max(axis=1, keepdims=True))
        parts /= parts.sum(axis=1, keepdims=True)
    weights = (parts.sum(axis=0) + 1e-6) / count
    return weights.astype(np.float32), centres, factors, parts


_LIBRARIES = ("rodcone", "numpy", "scipy", "scikit-image", "colour-science")


def train_prior(sensor: SensorConfig, name: str, seed: int) -> Prior:
    """Draw the training pictures as a camera's channels see them, and fit the mixture.

    Parameters
    ----------
    sensor : SensorConfig
        Sensor whose responses are used; nothing else of it matters.
    name : str
        Name of the prior in the provenance.
    seed : int
        Seed of the pictures, their patches and the fit's start.
    """
    digest = sha256()
    pictures = []
    for picture in draw_pictures(partial(draw_light, sensor=sensor), seed):
        digest.update(picture.tobytes())
        pictures.append(picture)
    rng = np.random.default_rng([seed, 1])
    patches = draw_patches(pictures, rng)
    source = training_provenance(f"rodcone train --sensor {name} --seed {seed}", seed, digest.hexdigest(), len(patches))
    return fit_prior(patches, neutral_ratios(sensor, LIGHTS), rng, source)


def training_provenance(command: str, seed: int, pictures_sha256: str, patches: int) -> str:
    """Return the provenance of a prior as JSON: command, seed, pictures, patches and versions."""
    source = {
        "command": command,
        "versions": {library: metadata.version(library) for library in _LIBRARIES},
        "seed": seed,
        "pictures_sha256": pictures_sha256,
        "photographs_sha256": photograph_hashes(),
        "patches": patches,
    }
    return json.dumps(source)
