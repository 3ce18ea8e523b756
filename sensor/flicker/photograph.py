"""Photographs under lamps that flicker."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from sensor.capture import expose
from sensor.config import SensorConfig, check_frame, frame_interval_s, row_starts_s
from sensor.device import Device
from sensor.flicker.rows import flickering, row_weights
from sensor.flicker.waveform import Waveform
from sensor.optics import SpectralIrradiance
from sensor.random import draw_key
from sensor.raw import RawImage
from sensor.response import behind_filters, channel_electrons, expected_electrons
from sensor.shake import STEP_S, moved_by_rows, rolling_path, row_shares

Parts = Sequence[tuple[Waveform, SpectralIrradiance]]  # lamps that flicker, and the light of each on the sensor
# Least steps of the hand's path in a lamp's period, and parts into which each step is divided for the lamp's light.
_STEPS, _FINER = 16, 8
LONGEST_START_S = 1.0  # the camera isn't synchronised to the mains: an exposure starts at a random time of a second


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
        As in `sensor.capture.photograph_radiance`.
    starts_s : sequence of float
        Time at which each frame's exposure starts, by the lamps' clock [s] (`frame_starts_s`).
    """
    if sensor.lens.shake_um and exposure_s:
        channels_e = channel_electrons(image, sensor, exposure_s)
        lit_e = [
            (waveform, channels_e if part is image else channel_electrons(part, sensor, exposure_s))
            for waveform, part in parts
        ]
        frames = (held_under_lamps(channels_e, lit_e, sensor, exposure_s, at_s, rng) for at_s in starts_s)
        mosaics = (behind_filters(frame, sensor) for frame in frames)
        return [expose(mosaic, sensor, exposure_s, device, rng, exact=exact) for mosaic in mosaics]
    steady_e = expected_electrons(image, sensor, exposure_s)
    parts_e = [
        (waveform, steady_e if part is image else expected_electrons(part, sensor, exposure_s))
        for waveform, part in parts
    ]
    return [
        expose(flickering(steady_e, parts_e, sensor, exposure_s, at_s), sensor, exposure_s, device, rng, exact=exact)
        for at_s in starts_s
    ]


def held_under_lamps(
    channels_e: NDArray[np.float64],
    parts_e: Sequence[tuple[Waveform, NDArray[np.float64]]],
    sensor: SensorConfig,
    exposure_s: float,
    start_s: float,
    rng: np.random.Generator,
) -> NDArray[np.float64]:
    """Return the electrons behind every filter, (h, w, channel), of a hand-held camera under lamps that flicker.

    The camera's position while a lamp is bright has more weight for that lamp's light, so a lamp that flashes freezes
    the movement. Each row keeps the light that the lamp gives within its exposure: bands are those of a still camera.

    Parameters
    ----------
    channels_e : (h, w, channel) float64
        Electrons behind every filter of a still camera, if every lamp gave its mean all the time.
    parts_e : sequence of (Waveform, (h, w, channel) float64)
        Each lamp that flickers, and its part of these electrons.
    sensor : SensorConfig
    exposure_s : float
        Above 0 [s].
    start_s : float
        Time at which the exposure of the first row starts, by the lamps' clock.
    rng : numpy.random.Generator
        Gives one key for the path.
    """
    check_frame(sensor, channels_e.shape[:2])
    rows = channels_e.shape[0]
    starts_s = np.repeat(row_starts_s(sensor, rows // sensor.sites), sensor.sites)
    longest_s = min([STEP_S, *(lamp.period_s / _STEPS for lamp, _ in parts_e)])
    places, shares = rolling_path(starts_s, exposure_s, draw_key(rng), longest_s)
    places_px = places * (sensor.lens.shake_um / sensor.site_pitch_um)
    # The light at each fine place on the straight line between two steps is divided between these two.
    count = places.shape[1]
    fine = np.arange((count - 1) * _FINER + 1)
    step_s = (float(starts_s.max()) + exposure_s) / (fine.size - 1)
    fine_shares = row_shares(starts_s, exposure_s, step_s, fine.size)
    between = np.maximum(1 - np.abs(fine[:, None] / _FINER - np.arange(count)), 0.0)

    steady_e = channels_e
    result = np.zeros_like(channels_e)
    for lamp, part_e in parts_e:
        weights = (fine_shares * lamp.mean(start_s + (fine - 0.5) * step_s, step_s)) @ between
        sums = weights.sum(axis=1)
        light = row_weights(lamp, sensor, rows, exposure_s, start_s)
        weights = np.where(sums[:, None] > 0, weights, shares) * (light / np.where(sums > 0, sums, 1.0))[:, None]
        result += moved_by_rows(part_e, places_px, weights)
        steady_e = steady_e - part_e
    if np.any(steady_e):
        result += moved_by_rows(np.maximum(steady_e, 0.0), places_px, shares)
    return result


def frame_starts_s(
    sensor: SensorConfig, shape: tuple[int, int], exposure_s: float, rng: np.random.Generator, frames: int = 1
) -> list[float]:
    """Draw when a burst's first frame starts, by the lamps' clock [s], and add the starts of the frames after it.

    The first frame starts at a random time, each later one as soon as the readout allows.

    Parameters
    ----------
    sensor : SensorConfig
    shape : (int, int)
        Rows and columns of photodiodes.
    exposure_s : float
    rng : numpy.random.Generator
        Gives the first start: the camera isn't synchronised to the mains.
    frames : int
    """
    first_s = LONGEST_START_S * float(rng.random())
    interval_s = frame_interval_s(sensor, shape[0] // sensor.sites, exposure_s)
    return [first_s + number * interval_s for number in range(frames)]
