"""Noise-aware colours for processors that don't state the noise of their planes, by measured noise gains.

A processor's planes differ from the true ones by remaining noise and by blur. This error, in units of one sample's
noise variance, is measured on training pictures at several levels of light
(``python benchmarks/measure_noise_gains.py``) and kept in ``noise_gains.toml`` with the command and versions. The file
also holds a factor on each processor's error. It is the factor that gives the best training pictures, on condition that
no kind of picture gets worse than by the plain matrix (a factor of 0).
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
    """Error variance of a processor's planes for its colour matrix, over one sample's noise variance.

    Attributes
    ----------
    snr_db : (level,) float64
        SNR of the frame's mean by `mean_snr`, increasing [dB].
    gains : (level, 3) float64
        Gains of the three channels from which the matrix computes colours. Beyond either end of `snr_db`, those at
        the end hold.
    """

    snr_db: Floats
    gains: Floats

    def at(self, snr: float) -> Floats:
        """Interpolate the gains at an SNR (a ratio), linearly in decibels, shape (3,)."""
        db = 20 * np.log10(max(snr, 1e-9))
        return np.array([np.interp(db, self.snr_db, column) for column in self.gains.T])


def measured_gains() -> Mapping[str, NoiseGains]:
    """Read the measured gains of each processor."""
    table = read_toml(TABLE)
    return {
        name: NoiseGains(
            np.array(table["snr_db"], float),
            np.array(entry["factors"], float)[:, None] * np.array(entry["errors"], float),
        )
        for name, entry in table["processors"].items()
    }


def mean_snr(raw: RawImage, unit: str) -> tuple[float, float]:
    """Return the mean electrons of a channel's unsaturated samples, at least 0, and its SNR by shot and dark noise."""
    sampled = mask(raw.cfa, unit, raw.shape)
    kept = sampled & ~raw.saturated
    mean_e = max(float(raw.electrons[kept if kept.any() else sampled].mean()), 0.0)
    noise_e = np.sqrt(raw.noise_of(unit).shot * mean_e + raw.noise_of(unit).dark_noise_e ** 2)
    return mean_e, mean_e / float(noise_e) if noise_e > 0 else 0.0


def colours_in_noise(raw: RawImage, fit: ColourFit, balance: WhiteBalance, unit: str, gains: NoiseGains) -> ColourFit:
    """Add the error of a processor's planes to the noise for which a fit's matrix is computed.

    A fit with a plain matrix is returned unchanged. Each channel has one number per frame. The error is that of a grey
    scene whose mean in `unit` is the frame's. It is relative to the signal of a surface that reflects all light, as in
    `isp.colour.colour_fit.relative_noise`.

    Parameters
    ----------
    balance : WhiteBalance
        White balance whose given or calibrated response is that of a grey scene.
    unit : str
        Channel that sets the picture's scale: a neutral surface gets the electrons of this channel.
    """
    if fit.plain is not None:
        return fit
    names = raw.channels
    neutral = balance.neutral if balance.given is None else balance.given
    if neutral is None:
        neutral = neutral_response(names, complementary(rgbw()) if "C" in names else None)
    index = [names.index(name) for name in fit.channels[:3]]
    response = neutral / neutral[names.index(unit)]
    mean_e, snr = mean_snr(raw, unit)
    variance = (channel_variance(raw, mean_e * response) / response**2)[index] * gains.at(snr)
    white_e = mean_e / fit.mean[fit.channels.index(unit)]
    noise = np.zeros(len(fit.channels))
    # The divisor isn't 0 even for a frame without any signal.
    noise[:3] = variance / max(white_e**2, LEAST_SIGNAL**2 * float(variance.max()), np.finfo(float).tiny)
    return replace(fit, moments=fit.moments + np.diag(noise))
