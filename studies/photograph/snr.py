"""Formulas for a camera that looks at an even neutral field: electrons, SNR, and the light that an SNR needs."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import inf, pi
from typing import Annotated

import numpy as np

from rodcone.errors import require_name
from rodcone.types import Floats
from sensor.config import SensorConfig
from sensor.readings.best_estimate import dark_electrons, merged_variance
from sensor.readings.resolve import PlainReading, at_channel, chip_readings, resolve, several
from sensor.readout import frame_moments
from studies.metrics.truth import GREY, Light, named_light, neutral_electrons


@dataclass(frozen=True)
class LightForSnr:
    """Light in which a pixel of one channel reaches an SNR.

    Attributes
    ----------
    channel : str
    electrons : float
        Photo-electrons at which the SNR is reached; inf if no light is enough.
    luminance_cd_m2 : float
        Luminance of an even neutral field.
    illuminance_lux : float
        Illuminance of a grey card of 18 % that has this luminance.
    """

    channel: str
    electrons: float
    luminance_cd_m2: float
    illuminance_lux: float


def channel_e(sensor: SensorConfig, light: Light, luminance_cd_m2: float, exposure_s: float) -> Floats:
    """Return the expected electrons of each channel's pixel from a uniform neutral field, shape (channel,)."""
    return neutral_electrons(sensor, light, exposure_s) * luminance_cd_m2


def snr(electrons: Floats, sensor: SensorConfig, exposure_s: float, channel: str | None = None) -> Floats:
    """Return the mean over the noise of a pixel's samples, fixed patterns included, in the shape of `electrons`.

    Mean and noise are those of clipped samples, as in EMVA 1288: near the full well the ratio rises, because full
    pixels are all alike. Crosstalk plays no part, because neighbours in an even field exchange the same charge. For a
    camera that reads channels in different ways, `channel` says which one is meant.

    Examples
    --------
    >>> import numpy as np
    >>> import rodcone
    >>> rodcone.snr(np.array([100.0, 10_000.0]), rodcone.low_noise(), 0.01).round(1)
    array([ 9.8, 70.7])
    """
    at_channel(chip_readings(sensor, exposure_s), channel)  # raises an error if a channel has to be named
    if channel is not None:
        require_name("channel", channel, sensor.channels)
    even = replace(sensor, pixel=replace(sensor.pixel, crosstalk=0.0))
    # Each value in `electrons` is treated as a frame of its own, for which a camera may switch its gain or meter a
    # channel.
    chosen = sensor.chip.switched or any(x.metered for x in sensor.chip.channels)
    fields = electrons.ravel()[:, None] if chosen else electrons[None]
    moments = [frame_moments(field, resolve(even, field, exposure_s, channel)) for field in fields]
    ratios = [x.mean_e / np.sqrt(x.variance_e2) for x in moments]
    return np.reshape(ratios, electrons.shape)


def light_for_snr(
    ratio: Annotated[float, (1e-6, 1e6, "give signal over noise")], sensor: SensorConfig, light: str, exposure_s: float
) -> list[LightForSnr]:
    """Return the light in which each channel's pixel reaches an SNR, in the order of `sensor.cfa.channels`.

    Parameters
    ----------
    ratio : float
        Mean signal over the standard deviation of one pixel of one chip, fixed patterns included.

    Examples
    --------
    >>> import rodcone
    >>> found = rodcone.light_for_snr(10.0, rodcone.low_noise(), "D65", 0.01)
    >>> [row.channel for row in found]
    ['R', 'G', 'B', 'W']
    """
    of = channel_e(sensor, named_light(light, sensor.window_nm), 1.0, exposure_s)
    names = sensor.channels
    electrons = [electrons_at_snr(ratio, sensor, exposure_s, name) for name in names]
    needed = [e / per_cd_m2 if per_cd_m2 > 0 else inf for e, per_cd_m2 in zip(electrons, of.tolist(), strict=True)]
    return [
        LightForSnr(channel, e, cd_m2, cd_m2 * pi / GREY)
        for channel, e, cd_m2 in zip(names, electrons, needed, strict=True)
    ]


def snr_at(luminance_cd_m2: Floats, sensor: SensorConfig, light: str, exposure_s: float) -> dict[str, Floats]:
    """Return the SNR of each channel's pixel at each luminance; NaN where its well is full."""
    of = channel_e(sensor, named_light(light, sensor.window_nm), 1.0, exposure_s)
    electrons = dict(zip(sensor.channels, of[:, None] * luminance_cd_m2, strict=True))
    ratios = {}
    for name, e in electrons.items():
        full_e = max(x.headroom_e for x in at_channel(chip_readings(sensor, exposure_s), name))
        metered = any(x.metered for x in sensor.chip.channels if x.channel == name)  # such a channel never fills
        ratios[name] = np.where(metered | (e < full_e), snr(e, sensor, exposure_s, name), np.nan)
    return ratios


def electrons_at_snr(snr: float, sensor: SensorConfig, exposure_s: float, channel: str | None = None) -> float:
    """Return the photo-electrons of an even field at which the SNR is `snr`; inf where it is never reached.

    The noise is the root of `noise_variance`, and clipping is left out: the light is less than the well holds.

    A metered channel is assumed to expose for its longest time, because light that needs a shorter one has more SNR
    than a full well. For several readings the result is the least light with this SNR; just above the light where one
    reading takes over from another, the SNR may be lower again.
    """
    readings = at_channel(chip_readings(sensor, exposure_s), channel)
    if sensor.chip.switched:
        light_e = [(x.patterns, e) for x in readings if np.isfinite(e := _electrons_of_law(snr, x))]
        taken = [e for number, e in light_e if resolve(sensor, np.array([e]), exposure_s)[0].patterns == number]
        return min(taken, default=np.inf)
    return _electrons_of_merged(snr, readings) if several(readings) else _electrons_of_law(snr, readings[0])


def _electrons_of_law(snr: float, reading: PlainReading) -> float:
    """Return the photo-electrons at which one reading reaches an SNR.

    With the variance a + b e + c e^2 they solve (1 - snr^2 c) e^2 - snr^2 b e - snr^2 a = 0. They are infinite for an
    SNR above 1 / sqrt(c), the limit that PRNU sets, and if the well is already full at less light.
    """
    law = reading.law
    a, b = law.dark_e**2 + law.fixed_e**2, law.shot
    lead = 1 - snr**2 * law.prnu**2
    if lead <= 0:
        return float("inf")
    electrons = (snr**2 * b + np.sqrt((snr**2 * b) ** 2 + 4 * lead * snr**2 * a)) / (2 * lead)
    return float(electrons) if electrons < reading.headroom_e else float("inf")


def _electrons_of_merged(snr: float, readings: Sequence[PlainReading]) -> float:
    well_e = readings[0].pixel.full_well_e
    levels = np.geomspace(1e-3, well_e, 8000)[:-1]
    ratio = levels / np.sqrt(merged_variance(levels, readings))
    above = np.flatnonzero((ratio >= snr) & (levels + dark_electrons(readings) < well_e))
    if above.size == 0:
        return float("inf")
    part = slice(max(above[0] - 1, 0), above[0] + 1)
    return float(np.interp(snr, ratio[part], levels[part]))
