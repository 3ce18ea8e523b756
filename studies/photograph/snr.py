"""The light that a pixel needs for an SNR, in closed form with every noise term."""

from dataclasses import dataclass
from math import pi

import numpy as np
from numpy.typing import NDArray

from render.illuminants import illuminant
from render.spectrum import VISIBLE_NM
from sensor.cfa import channels
from sensor.config import SensorConfig
from sensor.readout import electrons_at_snr, noise_variance
from studies.metrics.truth import light_in_bands, neutral_electrons

GREY = 0.18  # reflectance of the card whose illuminance is told
BAND_NM = 1.0


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


def electrons_per_luminance(sensor: SensorConfig, light: str, exposure_s: float) -> dict[str, float]:
    """Electrons of each channel's pixel from an even neutral field of 1 cd/m^2 under a named light."""
    nm = np.arange(VISIBLE_NM[0] + BAND_NM / 2, VISIBLE_NM[1], BAND_NM)
    under = light_in_bands(illuminant(light), nm, np.full(nm.size, BAND_NM))
    return dict(zip(channels(sensor.cfa), neutral_electrons(sensor, under, exposure_s).tolist(), strict=True))


def light_for_snr(snr: float, sensor: SensorConfig, light: str, exposure_s: float) -> list[LightForSnr]:
    """Light for an SNR by channel, in the order of `sensor.cfa.channels`.

    Parameters
    ----------
    snr : float
        Mean signal over the standard deviation of one pixel of one chip, fixed patterns included.
    """
    electrons = electrons_at_snr(snr, sensor, exposure_s)
    of = electrons_per_luminance(sensor, light, exposure_s)
    found = {channel: electrons / per_cd_m2 for channel, per_cd_m2 in of.items()}
    return [LightForSnr(channel, electrons, level, level * pi / GREY) for channel, level in found.items()]


def snr_at(
    luminance_cd_m2: NDArray[np.float64], sensor: SensorConfig, light: str, exposure_s: float
) -> dict[str, NDArray[np.float64]]:
    """SNR of each channel's pixel over light; NaN where its well is full."""
    found = {}
    for channel, per_cd_m2 in electrons_per_luminance(sensor, light, exposure_s).items():
        electrons = per_cd_m2 * luminance_cd_m2
        variance = [float(noise_variance(np.full((1, 1), x), sensor, exposure_s)[0, 0]) for x in electrons]
        found[channel] = np.where(electrons < sensor.pixel.full_well_e, electrons / np.sqrt(variance), np.nan)
    return found
