"""A uniform field before the paper's cameras in closed form: photons, electrons, SNR. No render is needed."""

from dataclasses import replace

import numpy as np

from render.illuminants import illuminant
from render.photometry import photons_per_joule
from render.spectrum import VISIBLE_NM, Floats
from sensor.config import SensorConfig
from sensor.optics import camera_equation
from sensor.readout import noise_variance
from studies.metrics.truth import Light, light_in_bands, neutral_electrons


def light_of(name: str) -> Light:
    """Illuminant of 1 cd/m^2 in bands of 1 nm over 380-780 nm."""
    nm: Floats = np.arange(VISIBLE_NM[0] + 0.5, VISIBLE_NM[1])
    return light_in_bands(illuminant(name), nm, np.ones_like(nm))


def photons(light: Light, luminance_cd_m2: float, sensor: SensorConfig) -> float:
    """Photons on the sensor from a uniform field behind the sensor's lens [um^-2 s^-1]."""
    spectral = light.spectrum * luminance_cd_m2 * camera_equation(sensor.lens)
    return float((spectral * photons_per_joule(light.wavelength_nm) * light.width_nm).sum() * 1e-12)


def channel_e(sensor: SensorConfig, light: Light, luminance_cd_m2: float, exposure_s: float) -> Floats:
    """Expected electrons of each channel's pixel from a uniform neutral field, shape (channel,)."""
    return neutral_electrons(sensor, light, exposure_s) * luminance_cd_m2


def snr(electrons: Floats, sensor: SensorConfig, exposure_s: float) -> Floats:
    """Expected electrons over the noise of one pixel of one chip, fixed patterns included, shape of `electrons`."""
    return np.asarray(electrons / np.sqrt(noise_variance(electrons, sensor, exposure_s)))


def decibels(ratio: float) -> float:
    """Ratio of amplitudes [dB]; minus infinity for 0."""
    return float(20 * np.log10(ratio)) if ratio > 0 else -np.inf


def without_prnu(sensor: SensorConfig) -> SensorConfig:
    """Sensor whose pixels respond alike: what a camera has that corrects its fixed pattern."""
    return replace(sensor, pixel=replace(sensor.pixel, prnu=0.0))


def shot_noise_alone(sensor: SensorConfig) -> SensorConfig:
    """Sensor with no noise but that of light, and a converter too fine to see."""
    pixel = replace(sensor.pixel, read_noise_e=0.0, dsnu_e=0.0, prnu=0.0)
    return replace(sensor, pixel=pixel, bits=16)
