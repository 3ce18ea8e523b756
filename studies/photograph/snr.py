"""An even neutral field before a camera in closed form: electrons, SNR, and the light that an SNR takes."""

from dataclasses import dataclass, replace
from math import pi

import numpy as np

from render.spectrum import Floats
from sensor.cfa import channels
from sensor.config import SensorConfig
from sensor.readout import electrons_at_snr, noise_variance
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


def snr(electrons: Floats, sensor: SensorConfig, exposure_s: float) -> Floats:
    """Expected electrons over the noise of one pixel of one chip, fixed patterns included, shape of `electrons`.

    Crosstalk plays no part: neighbours exchange the same.
    """
    even = replace(sensor, pixel=replace(sensor.pixel, crosstalk=0.0))
    # each is a frame of its own, for which a camera may switch its gain
    fields = electrons.ravel()[:, None] if sensor.chip.switched else electrons[None]
    variance = np.reshape([noise_variance(field, even, exposure_s) for field in fields], electrons.shape)
    return np.asarray(electrons / np.sqrt(variance))


def light_for_snr(ratio: float, sensor: SensorConfig, light: str, exposure_s: float) -> list[LightForSnr]:
    """Light for an SNR by channel, in the order of `sensor.cfa.channels`.

    Parameters
    ----------
    ratio : float
        Mean signal over the standard deviation of one pixel of one chip, fixed patterns included.
    """
    electrons = electrons_at_snr(ratio, sensor, exposure_s)
    of = channel_e(sensor, light_of(light), 1.0, exposure_s)
    return [
        LightForSnr(channel, electrons, electrons / per_cd_m2, electrons / per_cd_m2 * pi / GREY)
        for channel, per_cd_m2 in zip(channels(sensor.cfa), of.tolist(), strict=True)
    ]


def snr_at(luminance_cd_m2: Floats, sensor: SensorConfig, light: str, exposure_s: float) -> dict[str, Floats]:
    """SNR of each channel's pixel over light; NaN where its well is full."""
    of = channel_e(sensor, light_of(light), 1.0, exposure_s)
    electrons = dict(zip(channels(sensor.cfa), of[:, None] * luminance_cd_m2, strict=True))
    full_e = sensor.pixel.full_well_e - sensor.pixel.dark_current_e_per_s * exposure_s
    return {name: np.where(e < full_e, snr(e, sensor, exposure_s), np.nan) for name, e in electrons.items()}
