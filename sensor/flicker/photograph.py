"""Photographs under lamps that flicker."""

from collections.abc import Sequence

import numpy as np

from sensor.capture import expose
from sensor.config import SensorConfig, frame_interval_s
from sensor.device import Device
from sensor.flicker.rows import flickering
from sensor.flicker.waveform import Waveform
from sensor.optics import SpectralIrradiance
from sensor.raw import RawImage
from sensor.response import expected_electrons

Parts = Sequence[tuple[Waveform, SpectralIrradiance]]  # lamps that flicker, and the light of each on the sensor
LONGEST_START_S = 1.0  # the mains run on: an exposure starts at any time of a second


def photograph_flickering(
    image: SpectralIrradiance,
    parts: Parts,
    sensor: SensorConfig,
    exposure_s: float,
    device: Device,
    rng: np.random.Generator,
    starts_s: Sequence[float],
    exact: bool = False,
) -> list[RawImage]:
    """Take a burst under lamps that flicker.

    Parameters
    ----------
    image : SpectralIrradiance
        Light on the sensor if every lamp gave its mean all the time.
    parts : sequence of (Waveform, SpectralIrradiance)
        Each lamp that flickers, and its part of `image`.
    sensor, exposure_s, device, rng, exact
        As `sensor.capture.photograph_radiance` takes them.
    starts_s : sequence of float
        When each frame's exposure starts, by the lamps' clock [s] (`frame_starts_s`).
    """
    steady_e = expected_electrons(image, sensor, exposure_s)
    parts_e = [
        (waveform, steady_e if part is image else expected_electrons(part, sensor, exposure_s))
        for waveform, part in parts
    ]
    return [
        expose(flickering(steady_e, parts_e, sensor, exposure_s, at_s), sensor, exposure_s, device, rng, exact=exact)
        for at_s in starts_s
    ]


def frame_starts_s(
    sensor: SensorConfig, shape: tuple[int, int], exposure_s: float, rng: np.random.Generator, frames: int = 1
) -> list[float]:
    """When each frame of a burst starts, by the lamps' clock [s]: at any time, then as soon as the readout lets it.

    Parameters
    ----------
    sensor : SensorConfig
    shape : (int, int)
        Of its photodiodes.
    exposure_s : float
    rng : numpy.random.Generator
        Gives the first start: a camera and the mains know nothing of each other.
    frames : int
    """
    first_s = LONGEST_START_S * float(rng.random())
    interval_s = frame_interval_s(sensor, shape[0] // sensor.sites, exposure_s)
    return [first_s + number * interval_s for number in range(frames)]
