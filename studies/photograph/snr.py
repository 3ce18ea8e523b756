"""An even neutral field before a camera in closed form: electrons, SNR, and the light that an SNR takes."""

from dataclasses import dataclass, replace
from math import pi

import numpy as np

from render.spectrum import Floats
from rodcone.errors import require_name
from sensor.chip import room_e
from sensor.config import SensorConfig
from sensor.readings.merge import of_channel
from sensor.readings.noise import dark_electrons, merged_variance, of_reading, switched_to
from sensor.readout import noise_variance
from studies.metrics.truth import GREY, Light, light_of, neutral_electrons


@dataclass(frozen=True)
class LightForSnr:
    """Light in which a pixel of one channel reaches an SNR.

    Attributes
    ----------
    channel : str
    electrons : float
        Photo-electrons then; inf where no light is enough.
    luminance_cd_m2 : float
        Of an even neutral field.
    illuminance_lux : float
        On a grey card of 18 % that has this luminance.
    """

    channel: str
    electrons: float
    luminance_cd_m2: float
    illuminance_lux: float


def channel_e(sensor: SensorConfig, light: Light, luminance_cd_m2: float, exposure_s: float) -> Floats:
    """Expected electrons of each channel's pixel from a uniform neutral field, shape (channel,)."""
    return neutral_electrons(sensor, light, exposure_s) * luminance_cd_m2


def snr(electrons: Floats, sensor: SensorConfig, exposure_s: float, channel: str | None = None) -> Floats:
    """Expected electrons over the noise of one pixel of one chip, fixed patterns included, shape of `electrons`.

    Crosstalk plays no part: neighbours exchange the same. A camera that reads channels apart asks for the channel.
    """
    of_channel(sensor, channel)  # which asks for one
    if channel is not None:
        require_name("channel", channel, sensor.channels)
    even = replace(sensor, pixel=replace(sensor.pixel, crosstalk=0.0))
    # each is a frame of its own, for which a camera may switch its gain or meter a channel
    chosen = sensor.chip.switched or any(x.metered for x in sensor.chip.channels)
    fields = electrons.ravel()[:, None] if chosen else electrons[None]
    variance = np.reshape([noise_variance(field, even, exposure_s, channel) for field in fields], electrons.shape)
    return np.asarray(electrons / np.sqrt(variance))


def light_for_snr(ratio: float, sensor: SensorConfig, light: str, exposure_s: float) -> list[LightForSnr]:
    """Light for an SNR by channel, in the order of `sensor.cfa.channels`.

    Parameters
    ----------
    ratio : float
        Mean signal over the standard deviation of one pixel of one chip, fixed patterns included.
    """
    of = channel_e(sensor, light_of(light), 1.0, exposure_s)
    names = sensor.channels
    electrons = [electrons_at_snr(ratio, sensor, exposure_s, name) for name in names]
    return [
        LightForSnr(channel, e, e / per_cd_m2, e / per_cd_m2 * pi / GREY)
        for channel, e, per_cd_m2 in zip(names, electrons, of.tolist(), strict=True)
    ]


def snr_at(luminance_cd_m2: Floats, sensor: SensorConfig, light: str, exposure_s: float) -> dict[str, Floats]:
    """SNR of each channel's pixel over light; NaN where its well is full."""
    of = channel_e(sensor, light_of(light), 1.0, exposure_s)
    electrons = dict(zip(sensor.channels, of[:, None] * luminance_cd_m2, strict=True))
    ratios = {}
    for name, e in electrons.items():
        alone, share = of_channel(sensor, name)
        full_e = room_e(alone.pixel, exposure_s) / share
        metered = any(x.metered for x in sensor.chip.channels if x.channel == name)  # in time, before the well is full
        ratios[name] = np.where(metered | (e < full_e), snr(e, sensor, exposure_s, name), np.nan)
    return ratios


def noise_parabola(sensor: SensorConfig, exposure_s: float, channel: str | None = None) -> tuple[float, float, float]:
    """a, b, c of the variance a + b e + c e^2 of a pixel in an even field [e-^2]; parameters as of `noise_variance`."""
    well_e = sensor.pixel.full_well_e  # three points give the parabola; so far apart, no digits are lost
    fields = (np.full((1, 1), share * well_e) for share in (0.0, 0.5, 1.0))
    a, half, full = (float(noise_variance(field, sensor, exposure_s, channel)[0, 0]) for field in fields)
    c = (full - 2 * half + a) * 2 / well_e**2
    return a, (full - a) / well_e - c * well_e, c


def electrons_at_snr(snr: float, sensor: SensorConfig, exposure_s: float, channel: str | None = None) -> float:
    """Photo-electrons of an even field at which signal over `noise_variance`'s root is `snr`; inf where it never is.

    By `noise_parabola` e solves (1 - snr^2 c) e^2 - snr^2 b e - snr^2 a = 0. Beyond an SNR of
    1 / sqrt(c), by PRNU, no light is enough; nor is it where the well is full before. A metered channel is seen in its
    longest time, for light that a shorter one is needed for has more SNR than a full well.
    """
    if sensor.chip.channels:
        alone, share = of_channel(sensor, channel)
        return electrons_at_snr(snr, alone, exposure_s) / share
    if sensor.chip.readings:
        return _electrons_at_snr_of_readings(snr, sensor, exposure_s)
    a, b, c = noise_parabola(sensor, exposure_s)
    lead = 1 - snr**2 * c
    if lead <= 0:
        return float("inf")
    electrons = (snr**2 * b + np.sqrt((snr**2 * b) ** 2 + 4 * lead * snr**2 * a)) / (2 * lead)
    return float(electrons) if electrons < room_e(sensor.pixel, exposure_s) else float("inf")


def _electrons_at_snr_of_readings(snr: float, sensor: SensorConfig, exposure_s: float) -> float:
    """The least light with this SNR; beyond a seam it may be less again for a while."""
    if sensor.chip.switched:
        count = len(sensor.chip.readings)
        light_e = [electrons_at_snr(snr, of_reading(sensor, number), exposure_s) for number in range(count)]
        fits = (
            np.isfinite(e) and switched_to(sensor, np.array([e]), exposure_s) == number
            for number, e in enumerate(light_e)
        )
        return min((e for e, fit in zip(light_e, fits, strict=True) if fit), default=np.inf)
    levels = np.geomspace(1e-3, sensor.pixel.full_well_e, 8000)[:-1]
    ratio = levels / np.sqrt(merged_variance(levels, sensor, exposure_s))
    above = np.flatnonzero((ratio >= snr) & (levels + dark_electrons(sensor, exposure_s) < sensor.pixel.full_well_e))
    if above.size == 0:
        return float("inf")
    part = slice(max(above[0] - 1, 0), above[0] + 1)
    return float(np.interp(snr, ratio[part], levels[part]))
