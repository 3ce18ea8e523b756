"""A camera under study: its sensor, its chip, its colour matrix, and one photograph developed and measured."""

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from isp.colour import encode_srgb, fit_matrix
from isp.picture import Picture
from isp.pipeline import picture_bayer, picture_interleaved
from scenes.reflectances import color_checker
from sensor.cfa import channels, mask
from sensor.config import SensorConfig
from sensor.device import Device, draw_device
from sensor.presets import preset
from sensor.raw import RawImage
from sensor.readout import read_out
from studies.metrics import Quality, measure
from studies.truth import Light, green_scale, neutral_electrons

Develop = Callable[..., Picture]
CAMERAS: dict[str, tuple[str, Develop]] = {
    "interleaved": ("rgbw", picture_interleaved),
    "bayer": ("bayer", picture_bayer),
}


@dataclass(frozen=True)
class Camera:
    """One camera with one chip.

    Attributes
    ----------
    name : str
        ``interleaved`` or ``bayer``.
    sensor_name : str
    sensor : SensorConfig
    device : Device
    matrix : (3, 3) float64
        Fitted under the study's light on the ColorChecker.
    """

    name: str
    sensor_name: str
    sensor: SensorConfig
    device: Device
    matrix: NDArray[np.float64]


@dataclass(frozen=True)
class Shot:
    """A photograph: raw image, developed picture (encoded sRGB), its quality, decisions, and seconds."""

    raw: RawImage
    encoded: NDArray[np.float64]
    quality: Quality
    picture: Picture
    capture_s: float
    develop_s: float
    measure_s: float


def build_camera(name: str, sensor_name: str, light: Light, shape: tuple[int, int], rng: np.random.Generator) -> Camera:
    """Make a camera: preset and mosaic, one chip drawn from `rng`, matrix for the light."""
    sensor = preset(sensor_name, CAMERAS[name][0])
    nm, width = light.wavelength_nm, light.width_nm
    surfaces = np.array([reflectance.band_average(nm, width) for _, reflectance in color_checker()])
    responses = sensor.responses.band_average(("R", "G", "B"), nm, width)
    matrix = fit_matrix(responses, nm, light.spectrum, surfaces)
    return Camera(name, sensor_name, sensor, draw_device(sensor, shape, rng), matrix)


def photograph(
    camera: Camera,
    expected_e: NDArray[np.float64],
    truth: NDArray[np.float64],
    light: Light,
    white_cd_m2: float,
    exposure_s: float,
    rng: np.random.Generator,
) -> Shot:
    """Expose, develop and measure once.

    Parameters
    ----------
    expected_e : (h, w) float64
        Expected electrons of the mosaic.
    truth : (h, w, 3) float64
        Encoded sRGB of the noise-free scene, in which `white_cd_m2` is white.
    """
    start = time.perf_counter()
    raw = read_out(expected_e, camera.sensor, camera.device, exposure_s, rng)
    exposed = time.perf_counter()
    neutral = neutral_electrons(camera.sensor, light, exposure_s)
    picture = CAMERAS[camera.name][1](raw, camera.matrix, neutral=neutral)
    developed = time.perf_counter()
    encoded = encode_srgb(picture.rgb / (green_scale(camera.sensor, light, exposure_s) * white_cd_m2))
    quality = measure(encoded, truth)
    done = time.perf_counter()
    return Shot(raw, encoded, quality, picture, exposed - start, developed - exposed, done - developed)


def mean_electrons(camera: Camera, expected_e: NDArray[np.float64]) -> dict[str, float]:
    """Mean expected electrons of each letter's pixels."""
    tile = camera.sensor.cfa
    shape = (expected_e.shape[0], expected_e.shape[1])
    return {letter: float(expected_e[mask(tile, letter, shape)].mean()) for letter in channels(tile)}
