"""Noise-aware colours for processors that don't know the noise of their own planes: gains measured beforehand.

A processor's planes differ from the true ones by what is left of the noise and by blur. How much, in units of one
sample's noise variance, is measured on training pictures over light (``python benchmarks/measure_noise_gains.py``), and
kept in ``noise_gains.toml`` with the command and versions that made it. Beside it stands the factor on it that makes
the best pictures there, no kind of them worse than by the plain matrix, which is a factor of 0.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from isp.colour.colour_fit import LEAST_SIGNAL, ColourFit
from isp.colour.white_balance import WhiteBalance, neutral_response
from rodcone.toml_file import read_toml
from rodcone.types import Floats
from sensor.cfa import mask
from sensor.curves import complementary, rgbw
from sensor.raw import RawImage, channel_variance

TABLE = Path(__file__).with_name("noise_gains.toml")


@dataclass(frozen=True)
class NoiseGains:
    """Variance that a processor's colour matrix takes its planes to have, over one sample's noise variance.

    Attributes
    ----------
    snr_db : (level,) float64
        SNR of the frame's mean, as `mean_snr` has it, increasing [dB].
    gains : (level, 3) float64
        Of the three channels that the matrix takes; the ends hold beyond.
    """

    snr_db: Floats
    gains: Floats

    def at(self, snr: float) -> Floats:
        """Gains at an SNR (a ratio), linear in decibels, shape (3,)."""
        db = 20 * np.log10(max(snr, 1e-9))
        return np.array([np.interp(db, self.snr_db, column) for column in self.gains.T])


def measured_gains() -> Mapping[str, NoiseGains]:
    """Gains by processor, as they were measured."""
    table = read_toml(TABLE)
    return {
        name: NoiseGains(
            np.array(table["snr_db"], float),
            np.array(entry["factors"], float)[:, None] * np.array(entry["errors"], float),
        )
        for name, entry in table["processors"].items()
    }


def mean_snr(raw: RawImage, unit: str) -> tuple[float, float]:
    """Mean electrons of a channel's unsaturated samples, not under 0, and their SNR by shot and dark noise."""
    sampled = mask(raw.cfa, unit, raw.shape)
    kept = sampled & ~raw.saturated
    mean_e = max(float(raw.electrons[kept if kept.any() else sampled].mean()), 0.0)
    noise_e = np.sqrt(raw.noise_of(unit).shot * mean_e + raw.noise_of(unit).dark_noise_e ** 2)
    return mean_e, mean_e / float(noise_e) if noise_e > 0 else 0.0


def colours_in_noise(raw: RawImage, fit: ColourFit, balance: WhiteBalance, unit: str, gains: NoiseGains) -> ColourFit:
    """Fit whose matrix knows the error of a frame's planes; a plain matrix stays what it is.

    One number a channel and frame: a matrix per pixel would flicker. The error is that of a grey scene with the frame's
    mean in `unit`, over the signal of a surface that reflects all light, as `isp.colour.colour_fit.relative_noise`.

    Parameters
    ----------
    balance : WhiteBalance
        Its given or calibrated response says what a grey scene is.
    unit : str
        Channel that a neutral reads in the developed picture.
    """
    if fit.plain is not None:
        return fit
    names = raw.channels
    neutral = balance.neutral if balance.given is None else balance.given
    if neutral is None:
        neutral = raw.channel_mixing @ neutral_response(names, complementary(rgbw()) if "C" in names else None)
    index = [names.index(name) for name in fit.channels[:3]]
    response = neutral / neutral[names.index(unit)]
    mean_e, snr = mean_snr(raw, unit)
    variance = (channel_variance(raw, mean_e * response) / response**2)[index] * gains.at(snr)
    white_e = mean_e / fit.mean[fit.channels.index(unit)]
    noise = np.zeros(len(fit.channels))
    # A frame without any signal is all noise.
    noise[:3] = variance / max(white_e**2, LEAST_SIGNAL**2 * float(variance.max()), np.finfo(float).tiny)
    return replace(fit, moments=fit.moments + np.diag(noise))
