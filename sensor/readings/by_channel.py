"""Channels that are read apart: after a time of their own, behind a neutral density, or at another conversion gain.

The raw image holds all channels in one unit: e electrons are what a site would collect in the whole time without the
density. Sites that take the share s of it count s e electrons, of which everything that a pixel does is said; over s,
their shot noise has the variance e / s, and their well and dark noise are 1 / s times as large.
"""

from collections.abc import Callable
from dataclasses import replace
from math import hypot, sqrt
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from rodcone.errors import InputError
from sensor.calibration import ChannelNoise
from sensor.cfa import mask
from sensor.chip import ChannelReading, Chip, room_e
from sensor.config import METERED_PERCENTILE, METERED_SHARE, SensorConfig
from sensor.raw import RawImage

Floats: TypeAlias = NDArray[Any]
_STEPS = 16.0  # of a metered time to an octave: frames of one scene take the same one


def of_channel(sensor: SensorConfig, channel: str | None) -> tuple[SensorConfig, float]:
    """Camera whose every pixel is read as a channel's sites are, in electrons of theirs, and their share.

    Raises
    ------
    InputError
        Without a channel for a camera that reads channels apart.
    """
    if channel is None and sensor.chip.channels:
        names = [x.channel for x in sensor.chip.channels]
        raise InputError(
            f"channel: none given for a camera that reads {', '.join(names)} apart; allowed: "
            f"{', '.join(sensor.channels)}; give one"
        )
    for reading in sensor.chip.channels:
        if reading.channel == channel:
            return replace(sensor, pixel=reading.pixel_of(sensor.pixel), chip=Chip()), reading.share
    return (replace(sensor, chip=replace(sensor.chip, channels=())) if sensor.chip.channels else sensor), 1.0


def under_well(
    expected_e: Floats, sensor: SensorConfig, exposure_s: float, channel: str | None = None
) -> NDArray[np.bool_]:
    """Which pixels of a frame light and dark current do not fill; the camera as `sensor.readout.as_read` gives it."""
    if channel is not None:
        alone, share = of_channel(sensor, channel)
        return np.asarray(expected_e < room_e(alone.pixel, exposure_s) / share)

    def of_reading_e(reading: ChannelReading) -> float:
        return room_e(reading.pixel_of(sensor.pixel), exposure_s) / reading.share

    return np.asarray(expected_e < at_sites(sensor, expected_e.shape, room_e(sensor.pixel, exposure_s), of_reading_e))


def at_sites(
    sensor: SensorConfig, shape: tuple[int, ...], plain: float, apart: Callable[[ChannelReading], float]
) -> float | NDArray[np.float64]:
    """A number of the pixel, and at the sites of channels that are read apart theirs, (h, w)."""
    if not sensor.chip.channels:
        return plain
    result = np.full(shape, plain)
    for reading in sensor.chip.channels:
        result[mask(sensor.cfa, reading.channel, (shape[0], shape[1]))] = apart(reading)
    return result


def dimmed(expected_e: Floats, sensor: SensorConfig) -> Floats:
    """Electrons of the whole time behind each site's density: they move between pixels as they come."""
    return np.asarray(expected_e * at_sites(sensor, expected_e.shape, 1.0, lambda x: x.light_share))


def as_metered(sensor: SensorConfig, expected_e: Floats, channel: str | None = None) -> SensorConfig:
    """Camera whose metered channels have the times that they take for a frame.

    Parameters
    ----------
    expected_e : array
        Of a mosaic; with `channel`, of that channel.
    """

    def timed(reading: ChannelReading) -> ChannelReading:
        if not reading.metered or channel not in (None, reading.channel):
            return reading
        seen_e = expected_e[mask(sensor.cfa, reading.channel, expected_e.shape)] if channel is None else expected_e
        bright_e = max(float(np.percentile(seen_e, METERED_PERCENTILE)) * reading.light_share, 1e-9)
        share = METERED_SHARE * reading.pixel_of(sensor.pixel).full_well_e / bright_e
        steps = np.floor(_STEPS * np.log2(min(share, 1.0)) + 1e-6) / _STEPS
        return replace(reading, time_share=max(min(reading.time_share, float(2**steps)), 1e-6), metered=False)

    chip = sensor.chip
    if not any(x.metered for x in chip.channels):
        return sensor
    return replace(sensor, chip=replace(chip, channels=tuple(timed(x) for x in chip.channels)))


def read_by_channel(
    expected_e: Floats, sensor: SensorConfig, read: Callable[[Floats, SensorConfig], RawImage]
) -> RawImage:
    """Read a frame as the pixel is read, and once for each channel that is read apart, of which its sites count.

    Its samples are floats on the converter's scale: whole numbers but for these channels'.

    Parameters
    ----------
    expected_e : (h, w) array
        In the whole time, without the densities.
    sensor : SensorConfig
        With the times that it takes for the frame.
    read : callable
        What reads a frame of expected electrons, of a camera that reads all its channels alike.
    """
    light_e = dimmed(expected_e, sensor)
    plain = read(light_e, of_channel(sensor, "")[0])
    dn: Floats = plain.dn.astype(np.float32)
    noise = []
    for reading in sensor.chip.channels:
        raw, share = read(light_e * reading.time_share, of_channel(sensor, reading.channel)[0]), reading.share
        at = mask(plain.cfa, reading.channel, plain.shape)
        dn[at] = raw.electrons[at] / share / plain.gain_e_per_dn + plain.black_dn
        noise.append(
            ChannelNoise(
                channel=reading.channel,
                full_well_e=raw.full_well_e / share,
                shot=1 / share,
                read_noise_e=hypot(raw.read_noise_e, sqrt(raw.rounding_e2)) / share,
                dsnu_e=raw.dsnu_e / share,
                prnu=raw.prnu,
                dark_current_e=raw.dark_current_e / share,
            )
        )
    read_noise_e = hypot(plain.read_noise_e, sqrt(plain.rounding_e2))
    return replace(plain, dn=dn, read_noise_e=read_noise_e, channel_noise=tuple(noise))
