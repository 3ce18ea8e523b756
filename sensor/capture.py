"""A photograph: radiance in, raw image out."""

import numpy as np

from render.radiance import SpectralRadiance
from sensor.config import SensorConfig
from sensor.device import Device
from sensor.optics import form_image
from sensor.raw import RawImage
from sensor.readout import read_out
from sensor.response import expected_electrons


def capture(
    radiance: SpectralRadiance, sensor: SensorConfig, exposure_s: float, device: Device, rng: np.random.Generator
) -> RawImage:
    """Take one exposure: `form_image`, `expected_electrons`, `read_out`.

    Raises
    ------
    InputError
        As those functions do.
    """
    expected_e = expected_electrons(form_image(radiance, sensor), sensor, exposure_s)
    return read_out(expected_e, sensor, device, exposure_s, rng)
