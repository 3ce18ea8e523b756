"""Denoise a render, and draw two folds: independent renders of fewer samples, against which its error is measured."""

import numpy as np

from render.denoised.denoise import Denoised, denoised, first_surfaces
from render.integrator.wavefront import seed_of
from render.loader import Film, LoadedScene
from render.runs import Means, add_run, no_means
from render.scene import Scene

FOLD_SHARE = 0.25  # each fold's samples over the render's
_FOLDS, _SURFACES = 0xF01D, 0x5F0A  # streams of the seed that the render itself doesn't use


def denoise_means(
    scene: Scene, loaded: list[LoadedScene], film: Film, means: Means, seed: int, earlier: Denoised | None
) -> Denoised:
    """Denoise the means of a render and draw its folds; the folds of an earlier call are continued.

    Raises
    ------
    InputError
        Where the denoiser isn't installed.
    """
    assert means.indirect is not None
    # Folds split light into direct and indirect as the render does, so that its compiled kernel serves them too.
    folds = no_means(scene, film, means.rates, split=True)
    if earlier is not None:
        folds.count, folds.light = earlier.fold_points, earlier.folds.copy()
    stop = max(1, round(2 * means.count * FOLD_SHARE))
    while folds.count < stop:
        add_run(loaded, folds, film, stop, seed_of(seed, _FOLDS))
    albedo, normal = first_surfaces(loaded[0], film, seed_of(seed, _SURFACES))
    halves = zip(means.indirect.mean, means.indirect.difference, strict=True)
    smooth = np.stack([denoised(light, difference, albedo, normal) for light, difference in halves])
    return Denoised(
        radiance=np.maximum(means.light.mean - means.indirect.mean, 0) + smooth,  # rounding may make it negative
        indirect=means.indirect,
        folds=folds.light,
        fold_points=folds.count,
    )
