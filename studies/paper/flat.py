"""A uniform field before the paper's cameras in closed form: photons, sensors of less noise. No render is needed."""

from dataclasses import replace

import numpy as np

from render.photometry import photons_per_joule
from sensor.config import SensorConfig
from sensor.optics import camera_equation
from studies.metrics.truth import Light


def photons(light: Light, luminance_cd_m2: float, sensor: SensorConfig) -> float:
    """Photons on the sensor from a uniform field behind the sensor's lens [um^-2 s^-1]."""
    spectral = light.spectrum * luminance_cd_m2 * camera_equation(sensor.lens)
    return float((spectral * photons_per_joule(light.wavelength_nm) * light.width_nm).sum() * 1e-12)


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
