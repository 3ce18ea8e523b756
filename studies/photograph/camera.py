"""A camera under study: its sensor, its chip, its colour matrix, and one photograph developed and measured."""

from copy import deepcopy
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from isp.colour.colour_fit import ColourFit, fit_colours
from isp.picture import Picture
from isp.processors.catalogue import PROCESSORS, Processor
from rodcone.colour_spaces import encode_srgb
from scenes.reflectances import color_checker, held
from sensor.cfa import channels, mask
from sensor.config import SensorConfig
from sensor.device import Device, draw_device
from sensor.presets import preset
from sensor.raw import RawImage
from sensor.readout import read_out
from sensor.variations import vary
from studies.metrics.quality import Quality, measure
from studies.metrics.truth import Light, neutral_electrons
from studies.photograph.clock import timed

# The paper's two, which the demo compares: mosaic and software. A study may ask for any of `PROCESSORS`.
CAMERAS = {name: (PROCESSORS[name].mosaic, PROCESSORS[name].develop) for name in ("interleaved", "bayer")}


@dataclass(frozen=True)
class Camera:
    """One camera with one chip.

    Attributes
    ----------
    name : str
        Of `isp.processors.catalogue.PROCESSORS`.
    sensor_name : str
    sensor : SensorConfig
    device : Device
    colours : ColourFit
        Fitted under the study's light on the ColorChecker.
    """

    name: str
    sensor_name: str
    sensor: SensorConfig
    device: Device
    colours: ColourFit


@dataclass(frozen=True)
class Shot:
    """A photograph: raw image, developed picture (linear sRGB, then encoded), its quality, decisions, and seconds.

    `first_s` are those of first calls, as `studies.photograph.clock.timed` tells them apart from the others.
    """

    raw: RawImage
    linear: NDArray[np.float64]
    encoded: NDArray[np.float64]
    quality: Quality
    picture: Picture
    capture_s: float
    develop_s: float
    measure_s: float
    first_s: float


def build_camera(name: str, sensor_name: str, light: Light, shape: tuple[int, int], rng: np.random.Generator) -> Camera:
    """Make a camera: preset and mosaic, one chip drawn from `rng`, colours for the light."""
    sensor = vary(preset(sensor_name), PROCESSORS[name].mosaic)
    colours = colour_fit(sensor, PROCESSORS[name], light)
    return Camera(name, sensor_name, sensor, draw_device(sensor, shape, rng), colours)


def colour_fit(sensor: SensorConfig, processor: Processor, light: Light) -> ColourFit:
    """Fit of the processor's balanced colours, and the mosaic's other letters, under a light on the ColorChecker."""
    nm, width = light.wavelength_nm, light.width_nm
    surfaces = np.array([held(reflectance).band_average(nm, width) for _, reflectance in color_checker()])
    letters = (*processor.colours, *(x for x in channels(sensor.cfa) if x not in processor.colours))
    responses = sensor.responses.band_average(letters, nm, width)
    return fit_colours(letters, responses, nm, light.spectrum, surfaces, width)


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
    rng : numpy.random.Generator
        Of the exposure's noise; it is left as it is.
    """
    raw, capture_s, first_capture_s = timed(
        lambda: read_out(expected_e, camera.sensor, camera.device, exposure_s, deepcopy(rng)), "exact capture"
    )
    neutral, saturated = neutral_electrons(camera.sensor, light, exposure_s), raw.saturated
    processor = PROCESSORS[camera.name]
    picture, develop_s, first_develop_s = timed(
        lambda: processor.develop(raw, camera.colours, neutral=neutral),
        *("develop", camera.name, raw.shape, bool(saturated.any()), bool(saturated.all())),
    )
    unit_e = neutral[channels(camera.sensor.cfa).index(processor.unit)]  # of 1 cd/m^2
    linear = picture.rgb / (unit_e * white_cd_m2)
    encoded = encode_srgb(linear)
    quality, measure_s, first_measure_s = timed(lambda: measure(encoded, truth), "quality")
    first_s = first_capture_s + first_develop_s + first_measure_s
    return Shot(raw, linear, encoded, quality, picture, capture_s, develop_s, measure_s, first_s)


def mean_electrons(sensor: SensorConfig, expected_e: NDArray[np.float64]) -> dict[str, float]:
    """Mean expected electrons of each letter's pixels."""
    shape = (expected_e.shape[0], expected_e.shape[1])
    return {letter: float(expected_e[mask(sensor.cfa, letter, shape)].mean()) for letter in channels(sensor.cfa)}
