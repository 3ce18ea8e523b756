"""The errors of approximations at one level and exposure time, in electrons; the budget's decisions use only these."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sensor.config import SensorConfig
from sensor.readings.resolve import resolve, unsaturated
from sensor.readout import light_variance
from studies.budget.effects import DIFFRACTION, Effects, Pair, kernel_rms_e
from studies.study.study import Condition

# So many standard errors are added to a mean over the pilot's pixels, because chance may make it too low. A few pixels
# may hold most of the noise, in the pilot and in the predicted render. Whatever the noise's distribution, at most 5 %
# of such means are too low by more than the root of 19 standard errors (Cantelli's inequality).
EFFECT_MARGIN = 2.0
NOISE_MARGIN = 19.0**0.5


@dataclass(frozen=True)
class PilotNoise:
    """Noise of a pilot.

    Attributes
    ----------
    spp, half_spp : float
        Samples per pixel of the pilot, and of one of its halves.
    level : float
        Relative variance of the picture's mean luminance if the whole render had one sample per pixel.
    """

    spp: float
    half_spp: float
    level: float


@dataclass(frozen=True)
class ScaledEffects:
    """Errors that each possible choice makes, for one condition and mosaic [e-].

    Attributes
    ----------
    condition : Condition
    mosaic : str
    exposure_s : float
    noise_variance : float
        The sensor's own noise variance, as mean over the pixels below saturation [e-^2].
    blurred, sharp : float
        Monte Carlo variance at one sample per pixel, with diffraction and without [e-^2].
    jitter : mapping of int to float
        For each number of bands, the variance at one sample per pixel because a path's wavelengths within the bands are
        random [e-^2].
    level : float
        Variance at one sample per pixel because the mean luminance, by which a picture is scaled to its level, is noisy
        [e-^2].
    bands : mapping of int to (float, float)
        For each number of bands, the errors `BandErrors.response` and `BandErrors.light`.
    lens : mapping of str to float
        Error if an effect of the lens is left out, by its name.
    kernel : float
        Error of the fast readout.
    """

    condition: Condition
    mosaic: str
    exposure_s: float
    noise_variance: float
    blurred: float
    sharp: float
    jitter: Mapping[int, float]
    level: float
    bands: Mapping[int, tuple[float, float]]
    lens: Mapping[str, float]
    kernel: float

    def monte_carlo(self, count: int, spp: int, left_out: frozenset[str]) -> float:
        """Return the Monte Carlo variance of a model with `count` bands that leaves some effects out [e-^2]."""
        return ((self.sharp if DIFFRACTION in left_out else self.blurred) + self.jitter[count]) / spp


def scale_effects(
    condition: Condition,
    mosaic: str,
    sensor: SensorConfig,
    effects: Effects,
    level_cd_m2: float,
    exposure_s: float,
    pilot: PilotNoise,
) -> ScaledEffects:
    """Scale a sensor's effects to a level and an exposure time.

    Parameters
    ----------
    condition : Condition
    mosaic : str
    sensor : SensorConfig
    effects : Effects
        Effects at 1 cd/m^2 and 1 s.
    level_cd_m2, exposure_s : float
    pilot : PilotNoise
    """
    scale = level_cd_m2 * exposure_s
    # Next to a lamp the image of a lens that is sampled once per pixel falls below 0; `form_image` replaces that by 0.
    expected_e = scale * np.maximum(effects.full.mean(axis=0), 0.0)
    readings = resolve(sensor, expected_e, exposure_s)
    below = unsaturated(expected_e, readings)
    # Where every pixel is saturated no error reaches the raw image: each error is 0, and the variance counts as 1.
    noise_e2 = _mean(light_variance(expected_e, readings)[below]) or 1.0
    blurred, sharp = effects.blurred**2 * pilot.spp, effects.sharp**2 * pilot.spp
    # Wavelengths are stratified within a half, and the light that a path carries is independent of its wavelength.
    # Signal and noise are taken before diffraction; a pixel without light then has neither noise nor jitter.
    signal = (effects.full + effects.lens.get(DIFFRACTION, 0.0)).mean(axis=0)
    relative = np.divide(sharp.mean(axis=0), signal**2, out=np.zeros_like(signal), where=signal > 0)
    spread = relative + 1 / pilot.half_spp
    return ScaledEffects(
        condition=condition,
        mosaic=mosaic,
        exposure_s=exposure_s,
        noise_variance=noise_e2,
        blurred=scale**2 * _upper(blurred[:, below], NOISE_MARGIN),
        sharp=scale**2 * _upper(sharp[:, below], NOISE_MARGIN),
        jitter={
            count: scale**2 * _upper((errors.jitter * spread)[below], NOISE_MARGIN)
            for count, errors in effects.bands.items()
        },
        level=_mean(expected_e[below] ** 2) * pilot.level,
        bands={
            count: (scale * _rms(errors.response, below), scale * _rms(errors.light, below))
            for count, errors in effects.bands.items()
        },
        lens={name: scale * _rms(pair, below) for name, pair in effects.lens.items()},
        kernel=float(np.sqrt(_mean(kernel_rms_e(expected_e, max(effects.bands))[below] ** 2))),
    )


def _rms(pair: Pair, below: NDArray[np.bool_]) -> float:
    """Return an effect's root mean square over the pixels of the mask `below`, raised by a margin against chance.

    The square is estimated without bias as the product of the effect's two estimates, from the even and the odd half.
    The margin is needed because there are few pixels, so that their mean may be too small by chance.
    """
    return float(np.sqrt(max(_upper((pair[0] * pair[1])[below], EFFECT_MARGIN), 0.0)))


def _upper(values: NDArray[np.float64], margin: float) -> float:
    """Return the mean over pixels (last axis) plus `margin` times its standard error; 0 where there are no pixels."""
    return float(values.mean() + margin * values.std() / np.sqrt(values.shape[-1])) if values.size else 0.0


def _mean(values: NDArray[np.float64]) -> float:
    return float(values.mean()) if values.size else 0.0
