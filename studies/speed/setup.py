"""What `rodcone bench` measures and how large, and how errors are taken: in electrons, below saturation."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from render.transport import Transport
from scenes.catalog import load
from sensor.config import SensorConfig
from sensor.exposure import auto_exposure_s
from sensor.optics import form_image
from sensor.presets import preset
from sensor.readout import noise_variance
from sensor.response import expected_electrons

MOST_BANDS = 40
Image = NDArray[np.float64]


@dataclass(frozen=True)
class Bench:
    """What is measured, and how large.

    Attributes
    ----------
    scene, sensor : str
    level_cd_m2 : float
    size : int
        Side of the renders in pixels.
    picture : int
        Side of the pictures that lens, readout and reconstruction work on; the render's mirror images fill it.
    bands, samples : tuple of int
        Numbers of bands; samples a pixel, increasing; a render of four times the last is the reference.
    neighbourhoods, patches : tuple of int
    repeats : int
        Turns beside the first; their median counts.
    seed : int
    """

    scene: str = "still_life"
    sensor: str = "low_noise"
    level_cd_m2: float = 25.0
    size: int = 40
    picture: int = 128
    bands: tuple[int, ...] = (4, 8, 20, MOST_BANDS)
    samples: tuple[int, ...] = (32, 128, 512)
    neighbourhoods: tuple[int, ...] = (9, 15, 21)
    patches: tuple[int, ...] = (3, 5)
    repeats: int = 1
    seed: int = 0


def checked(bench: Bench) -> Bench:
    """Return the bench, or raise `InputError` for a scene or sensor that isn't there; nothing is measured."""
    load(bench.scene)
    preset(bench.sensor)
    return bench


def more(bench: Bench) -> Bench:
    """More choices of everything, and more repeats."""
    return replace(
        bench,
        bands=(4, 8, 12, 16, 20, 28, MOST_BANDS),
        samples=(32, 64, 128, 256, 512, 1024, 2048),
        neighbourhoods=(7, 11, 15, 21, 27),
        patches=(1, 3, 5, 7),
        repeats=3,
    )


def exposure_s_of(bench: Bench, sensor: SensorConfig, transport: Transport) -> float:
    """Auto exposure [s]."""
    return auto_exposure_s(form_image(transport.relight(luminance_cd_m2=bench.level_cd_m2), sensor), sensor)


def mosaic_e(bench: Bench, sensor: SensorConfig, transport: Transport, exposure_s: float) -> Image:
    """Expected electrons of the mosaic, (h, w)."""
    image = form_image(transport.relight(luminance_cd_m2=bench.level_cd_m2), sensor)
    return expected_electrons(image, sensor, exposure_s)


def rms_e(expected_e: Image, truth_e: Image, sensor: SensorConfig) -> float:
    """RMS of a difference over pixels below saturation [e-]."""
    below = truth_e < sensor.pixel.full_well_e
    return float(np.sqrt(np.mean((expected_e - truth_e)[below] ** 2)))


def noise_e_of(expected_e: Image, sensor: SensorConfig, exposure_s: float) -> float:
    """The sensor's own noise: root of its mean variance below saturation [e-]."""
    below = expected_e < sensor.pixel.full_well_e
    return float(np.sqrt(noise_variance(expected_e, sensor, exposure_s)[below].mean()))
