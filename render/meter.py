"""Irradiance on a scene's reference plane, traced once, and only if an illuminance is asked for."""

from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from render.cache import load_irradiance, save_irradiance
from render.integrator.wavefront import Span, seed_of, traced, tracers
from render.level import Irradiance
from render.loader import METER_PIXELS, Film, LoadedScene, load_groups, own_mitsuba_variant
from render.runs import clear_traceback
from render.scene import Scene
from rodcone.errors import InputError
from rodcone.types import Planes

METER_BANDS = 4  # bands that are traced together: as quick as all at once, and the kernel compiles sooner
HALF_SPP = 16  # samples per pixel of the meter's film in each half: 2^17 paths give each band's number within 0.1 %


@dataclass(frozen=True)
class Meter:
    """Meter of a scene's irradiance, which is traced at the first call and then kept.

    Attributes
    ----------
    scene : Scene
        A scene with a reference plane.
    film : Film
        Bands and longest path; its size isn't used.
    seed : int
    folder : Path, optional
        Folder of renders, in which an irradiance is stored and looked for.
    """

    scene: Scene
    film: Film
    seed: int
    folder: Path | None = None

    def __call__(self) -> Irradiance:
        """Return the irradiance of the plane."""
        return self._irradiance

    @cached_property
    def _irradiance(self) -> Irradiance:
        film = replace(self.film, size=(METER_PIXELS, METER_PIXELS))
        stored = None if self.folder is None else load_irradiance(self.folder, self.scene, film, self.seed)
        if stored is not None:
            return stored
        try:
            made = _measured(self.scene, film, self.seed)
        except InputError as error:
            clear_traceback(error)
            raise
        if self.folder is not None:
            save_irradiance(self.folder, self.scene, film, self.seed, made)
        return made


@own_mitsuba_variant()
def _measured(scene: Scene, film: Film, seed: int) -> Irradiance:
    """Trace two halves with different seeds and sum them in float64, so that the threads' number changes no bit."""
    shape = (2, len(scene.groups), film.wavelength_nm.size, *film.size)
    halves = np.zeros(shape, np.float32)
    for loaded in load_groups(scene, film, metered=True):
        for half in range(2):
            of_half = seed_of(seed, loaded.groups[0], half, METER_PIXELS)
            halves[half, list(loaded.groups)] = _half(loaded, film, of_half)
    # Irradiance is pi times what the meter's paths, distributed by cosine, bring on average.
    even, odd = (half.reshape(-1, METER_PIXELS**2).astype(np.float64) * np.pi for half in halves)
    error = (even - odd) / 2 / METER_PIXELS**2
    return Irradiance(((even + odd) / 2).mean(axis=1).reshape(shape[1:3]), error @ error.T)


def _half(loaded: LoadedScene, film: Film, seed: int) -> Planes:
    """Trace the irradiance over pi for each pixel of the film, (group, band, h, w)."""
    alike = np.ones(film.size, np.uint32)
    span = Span(0, HALF_SPP, 1)
    threads = HALF_SPP * METER_PIXELS**2
    images = [traced(x.meter, alike, span, threads, seed) for x in tracers(loaded, film, METER_BANDS, seed)]
    return np.concatenate([x["scattered"].reshape(len(loaded.groups), -1, *film.size) for x in images], axis=1)
