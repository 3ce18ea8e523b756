"""A frame with what a camera notes beside it: its colours, the lens's f-number, the speed."""

from dataclasses import replace

import numpy as np

from render.illuminants import illuminant
from render.radiance import SpectralRadiance
from render.spectrum import Spectrum
from rodcone.errors import InputError
from sensor.capture import capture as frame_of
from sensor.config import SensorConfig
from sensor.device import Device
from sensor.exposure import AUTO_INFORMATION, exposure_by_rule_s
from sensor.optics import form_image
from sensor.presets import preset
from sensor.raw import RawImage
from studies.photograph.camera import calibrate, iso_speed


def capture(
    radiance: SpectralRadiance,
    sensor: SensorConfig | None = None,
    exposure_s: float | None = None,
    device: Device | None = None,
    rng: np.random.Generator | None = None,
    *,
    light: Spectrum | None = None,
    exact: bool = False,
    samples_per_pixel: int = 1,
) -> RawImage:
    """Take one exposure; the raw image holds what `develop` needs.

    Parameters
    ----------
    radiance : SpectralRadiance
    sensor : SensorConfig, optional
        Left out, the preset ``low_noise``.
    exposure_s : float, optional
        0 or more [s]; left out, by the rule ``auto:information`` of `sensor.exposure.exposure_by_rule_s`.
    device, rng, exact, samples_per_pixel
        As `sensor.capture.capture` takes them.
    light : Spectrum, optional
        That the camera's neutral and colour matrix are set to; left out, D65. Where the mosaic tells no colours under
        it the raw image holds none, and `calibrate` says why.

    Raises
    ------
    InputError
        As `sensor.capture.capture`.

    Warns
    -----
    UserWarning
        For a frame that is nearly all full or all dark, and as `sensor.capture.capture`.
    """
    sensor = preset("low_noise") if sensor is None else sensor
    if exposure_s is None:
        exposure_s = exposure_by_rule_s(AUTO_INFORMATION, form_image(radiance, sensor, samples_per_pixel), sensor)
    raw = frame_of(radiance, sensor, exposure_s, device, rng, exact=exact, samples_per_pixel=samples_per_pixel)
    try:
        colour = calibrate(sensor, light or illuminant("D65"))
    except InputError:
        colour = None
    return replace(raw, colour=colour, f_number=sensor.lens.f_number, iso=iso_speed(sensor))
