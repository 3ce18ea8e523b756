"""One linear raw image out of several readings (docs/decisions/0047-several-readings.md), or of channels read apart.

Channels are read apart after a time of their own, behind a neutral density, or at another conversion gain. The raw
image holds all channels in one unit: e electrons are what a site would collect in the whole time without the density.
Sites that take the share s of it count s e electrons, of which everything that a pixel does is said; over s,
their shot noise has the variance e / s, and their well and dark noise are 1 / s times as large.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from math import ceil, hypot, sqrt
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from rodcone.errors import InputError
from sensor.calibration import ChannelNoise, NoiseStep
from sensor.cfa import mask
from sensor.chip import ChannelReading, Chip, room_e
from sensor.config import BLACK_SIGMAS, METERED_PERCENTILE, METERED_SHARE, SensorConfig
from sensor.raw import RawImage
from sensor.readings.noise import Floats, best_weights, covariances, seams, shares, whole_share

Values: TypeAlias = NDArray[Any]
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
    expected_e: Values, sensor: SensorConfig, exposure_s: float, channel: str | None = None
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


def dimmed(expected_e: Values, sensor: SensorConfig) -> Values:
    """Electrons of the whole time behind each site's density: they move between pixels as they come."""
    return np.asarray(expected_e * at_sites(sensor, expected_e.shape, 1.0, lambda x: x.light_share))


def as_metered(sensor: SensorConfig, expected_e: Values, exposure_s: float, channel: str | None = None) -> SensorConfig:
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
        bright_e = float(np.percentile(seen_e, METERED_PERCENTILE)) * reading.light_share
        filling_e = max(bright_e + sensor.pixel.dark_current_e_per_s * exposure_s, 1e-9)
        share = METERED_SHARE * reading.pixel_of(sensor.pixel).full_well_e / filling_e
        steps = np.floor(_STEPS * np.log2(min(share, 1.0)) + 1e-6) / _STEPS
        return replace(reading, time_share=max(min(reading.time_share, float(2**steps)), 1e-6), metered=False)

    chip = sensor.chip
    if not any(x.metered for x in chip.channels):
        return sensor
    return replace(sensor, chip=replace(chip, channels=tuple(timed(x) for x in chip.channels)))


def read_by_channel(
    expected_e: Values, sensor: SensorConfig, read: Callable[[Values, SensorConfig], RawImage]
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
    dn: Values = plain.dn.astype(np.float32)
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


MERGED_WHITE_DN = 2**24 - 1  # linear words of 24 bits, as chips that merge give them; single precision holds them all
_ROUNDS = 6  # of the weights, as of `sensor.burst`
_LEVELS = 512  # of light, between which weights are interpolated


def merge_readings(raws: Sequence[RawImage], sensor: SensorConfig, exposure_s: float) -> RawImage:
    """Merge all readings of one exposure.

    The raw image's electrons are those of all charges together, so that shot noise is Poisson's as long as none is
    full; beyond each seam `RawImage.noise_steps` says what the rest knows. Its exposure time is the one that would
    collect as many: the whole pixel's times `whole_share`.

    Parameters
    ----------
    raws : sequence of RawImage
        In the order of the chip's readings.
    sensor : SensorConfig
    exposure_s : float
        Of the longest [s].
    """
    whole, last = whole_share(sensor), seams(sensor, exposure_s).order[-1]
    dark_current_e = sensor.pixel.dark_current_e_per_s * exposure_s
    estimates_e = [raw.electrons / share for raw, share in zip(raws, shares(sensor), strict=True)]
    electrons = merged_electrons(np.stack(estimates_e), sensor, exposure_s) * whole
    base, *steps = noise_of_merged(sensor, exposure_s)

    full_e = max(room_e(sensor.pixel, exposure_s), 1.0) * whole
    dark_e = BLACK_SIGMAS * hypot(base.read_noise_e, base.dsnu_e)
    black_dn = ceil(MERGED_WHITE_DN * dark_e / (full_e + dark_e))
    gain_e = full_e / (MERGED_WHITE_DN - black_dn)
    electrons = np.where(raws[last].saturated, full_e, np.minimum(electrons, full_e))
    hot = [raw.defects for raw in raws if raw.defects is not None]
    return replace(
        raws[0],
        dn=(electrons / gain_e + black_dn).astype(np.float32),
        black_dn=black_dn,
        white_dn=MERGED_WHITE_DN,
        gain_e_per_dn=gain_e,
        read_noise_e=base.read_noise_e,
        dsnu_e=base.dsnu_e,
        prnu=base.prnu,
        exposure_s=whole * exposure_s,
        defects=np.concatenate(hot) if hot else None,
        noise_steps=tuple(steps),
        dark_current_e=min(dark_current_e, sensor.pixel.full_well_e) * whole,
    )


def merged_electrons(estimates_e: Floats, sensor: SensorConfig, exposure_s: float) -> Floats:
    """Electrons of the whole pixel from each reading's estimate of them.

    Weights and the choice of readings follow the merged light, never one reading's own noisy value: the best linear
    estimate is uncorrelated with what the readings differ by, so that what is decided from it favours none of them.

    Parameters
    ----------
    estimates_e : (reading, h, w) float64
        Each reading's electrons over its share, without the dark current's mean.

    Returns
    -------
    (h, w) float64
    """
    at = seams(sensor, exposure_s)
    levels = np.concatenate([[0.0], np.geomspace(1e-2, sensor.pixel.full_well_e, _LEVELS - 1)])
    total = np.asarray(sum(covariances(levels, sensor, exposure_s).values()))
    flat = estimates_e.reshape(len(estimates_e), -1)
    light, where = np.empty(flat.shape[1]), np.arange(flat.shape[1])
    for number, above_e in enumerate(at.above_e):
        weights = best_weights(total, at.order[number:])
        light[where] = _weighted(flat[:, where], weights, levels)
        where = where[light[where] >= above_e]
        if where.size == 0:
            break
    return light.reshape(estimates_e.shape[1:])


def _weighted(estimates_e: Floats, weights: Floats, levels_e: Floats) -> Floats:
    """Mean under the weights (level, reading) that belong to the mean itself, in a few rounds from the dark on."""
    light = np.asarray(weights[0] @ estimates_e)
    if np.ptp(weights, axis=0).max() < 1e-9:
        return light
    for _ in range(_ROUNDS):
        light = np.asarray(
            sum(
                np.interp(light, levels_e, weight) * x
                for weight, x in zip(weights.T, estimates_e, strict=True)
                if weight.any()
            )
        )
    return light


def noise_of_merged(sensor: SensorConfig, exposure_s: float) -> list[NoiseStep]:
    """Noise of merged electrons from the dark on, and from each seam on.

    Dark noise is told where a step begins, the light's shot noise and PRNU where it ends: there each counts.
    """
    at, whole = seams(sensor, exposure_s), whole_share(sensor)
    of_columns_e2 = (sensor.pixel.column_gain_spread * sensor.pixel.dark_current_e_per_s * exposure_s) ** 2
    starts_e = np.maximum([0.0, *at.above_e[:-1]], 0.0)
    ends_e = np.maximum(at.above_e, 1.0)
    first = min(int(np.sum(at.above_e <= 0.0)), len(ends_e) - 1)  # those before it are full of dark current
    steps = []
    for number, (start_e, end_e) in list(enumerate(zip(starts_e, ends_e, strict=True)))[first:]:
        dark, bright = (_variances_at(level_e, sensor, exposure_s, at.order[number:]) for level_e in (start_e, end_e))
        steps.append(
            NoiseStep(
                from_e=whole * float(start_e),
                shot=whole * bright["shot noise"] / float(end_e),
                read_noise_e=whole * sqrt(dark["read noise"] + dark["quantisation"] + dark["dark current"]),
                dsnu_e=whole * sqrt(dark["DSNU"] + dark["column offsets"] + of_columns_e2),
                prnu=hypot(sqrt(bright["PRNU"]) / float(end_e), sensor.pixel.column_gain_spread),
            )
        )
    return [*steps[:1], *steps] if first else steps  # what a raw image says of the dark supposes all charges


def _variances_at(
    expected_e: float, sensor: SensorConfig, exposure_s: float, kept: NDArray[np.intp]
) -> dict[str, float]:
    """Variance of the best estimate from the readings `kept`, by source."""
    by_source = covariances(np.array([expected_e]), sensor, exposure_s)
    weights = best_weights(np.asarray(sum(by_source.values())), kept)[0]
    return {name: float(weights @ covariance[0] @ weights) for name, covariance in by_source.items()}
