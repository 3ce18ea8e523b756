"""Joint noise of several readings of one exposure, the best weights under it, and the merge's noise in closed form.

A reading i holds the share s_i of the electrons E that the whole pixel would hold in the whole exposure, and estimates
E by x_i / s_i. The covariance C of these estimates holds all that is needed: readings of one charge share its shot
noise, those of one photodiode its PRNU, all of them the column's amplifier; read noise is each reading's own. The best
linear estimate of E weighs them by

    w = C^-1 1 / (1^T C^-1 1),    of variance w^T C w.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from rodcone.types import Floats
from sensor.readings.resolve import PlainReading

# A reading, or a frame of a burst, counts where the merged light stays 6 standard deviations below its full well: noise
# then clips it in one of 1e9 pixels.
CLEAR_SIGMAS = 6.0
# A large frame's variance is computed at this many levels of light, 0.3 % apart, and interpolated between them.
_LEVELS = 8192


@dataclass(frozen=True)
class Seams:
    """Readings in the order in which they fill, and the light at which the merge hands over from each to the next.

    Attributes
    ----------
    order : (reading,) intp
    handover_e : (reading,) float64
        Photo-electrons of the whole pixel, under 0 where dark current fills the reading; of the last the level from
        which it may clip.
    """

    order: NDArray[np.intp]
    handover_e: Floats


def shares(readings: Sequence[PlainReading]) -> Floats:
    """Return the share of the whole pixel's electrons of the whole exposure that each reading holds."""
    return np.array([x.share for x in readings])


def collected_share(readings: Sequence[PlainReading]) -> float:
    """Return the electrons of all charges over those of the whole pixel; merged electrons are in units of it."""
    return float(sum({x.charge: x.share for x in readings}.values()))


def dark_electrons(readings: Sequence[PlainReading]) -> float:
    """Mean electrons of dark current and hot pixels in the whole pixel."""
    pixel = readings[0].pixel
    dark_e_per_s = pixel.dark_current_e_per_s + pixel.hot_pixel_share * pixel.hot_pixel_dark_current_e_per_s
    return dark_e_per_s * readings[0].exposure_s


def covariances(expected_e: Floats, readings: Sequence[PlainReading]) -> dict[str, Floats]:
    """Return the covariance of the readings' estimates for each source of noise, without clipping.

    Parameters
    ----------
    expected_e : (n,) float64
        Photo-electrons of the whole pixel in the whole exposure.

    Returns
    -------
    dict of str to (n, reading, reading) float64
        By the names of `sensor.readout.noise_sources` [e-^2].
    """
    pixel, exposure_s = readings[0].pixel, readings[0].exposure_s
    share = shares(readings)
    light = np.asarray(expected_e, dtype=np.float64)[:, None, None]
    identity = np.eye(len(readings))
    charge = np.array([[a.charge == b.charge for b in readings] for a in readings]) / share
    photodiode = np.array([[a.photodiode == b.photodiode for b in readings] for a in readings]) * 1.0
    hot_e = pixel.hot_pixel_dark_current_e_per_s * exposure_s
    hot_share = pixel.hot_pixel_share
    spread_e2 = hot_share * (1 - hot_share) * hot_e**2
    gain_e = np.array([x.sensor.gain_e_per_dn for x in readings])

    by_source = {
        "shot noise": light * charge,
        "dark current": pixel.dark_current_e_per_s * exposure_s * charge,
        "hot pixels": hot_share * hot_e * charge + spread_e2 * photodiode,
        "PRNU": (pixel.prnu * light) ** 2 * photodiode,
    }
    collected = sum(by_source.values()) + (light + dark_electrons(readings)) ** 2
    by_source |= {
        "column gains": pixel.column_gain_spread**2 * collected,
        "DSNU": identity * (np.array([x.sensor.pixel.dsnu_e for x in readings]) / share) ** 2,
        "column offsets": pixel.column_offset_e**2 / np.outer(share, share),
        "read noise": identity * (np.array([x.sensor.pixel.read_noise_e for x in readings]) / share) ** 2,
        "converter noise": identity * (np.array([x.sensor.converter_noise_e for x in readings]) / share) ** 2,
        "quantisation": identity * (gain_e / share) ** 2 / 12,
    }
    shape = (len(light), len(readings), len(readings))
    return {name: np.broadcast_to(value, shape) for name, value in by_source.items()}


def best_weights(covariance: Floats, kept: NDArray[np.intp]) -> Floats:
    """Return the weights of the best linear estimate from the readings `kept`, 0 for the others, (n, reading)."""
    weights = np.zeros(covariance.shape[:2])
    part = np.linalg.solve(covariance[:, kept[:, None], kept[None, :]], np.ones((len(covariance), kept.size, 1)))[
        ..., 0
    ]
    weights[:, kept] = part / part.sum(axis=1, keepdims=True)
    return weights


def seams(readings: Sequence[PlainReading]) -> Seams:
    """Find the light from which each reading is left out: 6 deviations under its well, half of it at least."""
    full_e = np.array([x.sensor.pixel.full_well_e for x in readings]) / shares(readings)
    total = sum(covariances(full_e, readings).values())
    spread_e = np.sqrt(np.einsum("iii->i", total))
    clear_e = np.maximum(full_e - CLEAR_SIGMAS * spread_e, full_e / 2)
    handover_e = clear_e - dark_electrons(readings)  # negative where dark current alone fills the reading
    order = np.argsort(handover_e, kind="stable")
    return Seams(order, handover_e[order])


def merged_variances(expected_e: Floats, readings: Sequence[PlainReading]) -> Mapping[str, Floats]:
    """Return the merge's variance over chips and exposures for each source [e-^2], shaped as `expected_e`.

    Around a seam some pixels keep the reading that fills and some leave it out, by their merged light; that is not
    correlated with what the readings differ by, so that the variances add by the shares of the pixels.
    """
    light = np.ravel(np.asarray(expected_e, dtype=np.float64))
    by_source = covariances(light, readings)
    total = np.asarray(sum(by_source.values()))
    at = seams(readings)
    merged_e2 = dict.fromkeys(by_source, np.zeros_like(light))
    pixel_share = np.ones_like(light)  # share of pixels whose merged light is over the seams so far
    for number, handover_e in enumerate(at.handover_e):
        weights = best_weights(total, at.order[number:])
        noise_e = np.sqrt(np.einsum("ni,nij,nj->n", weights, total, weights))
        last = number == len(at.order) - 1
        beyond = np.zeros_like(light) if last else scipy.special.ndtr((light - handover_e) / noise_e)
        for name, covariance in by_source.items():
            variance_e2 = np.einsum("ni,nij,nj->n", weights, covariance, weights)
            merged_e2[name] = merged_e2[name] + pixel_share * (1 - beyond) * variance_e2
        pixel_share = pixel_share * beyond
    return {name: value.reshape(np.shape(expected_e)) for name, value in merged_e2.items()}


def merged_variance(expected_e: Floats, readings: Sequence[PlainReading]) -> Floats:
    """Return the sum of `merged_variances`; of a large frame it is interpolated between levels of light."""
    light = np.asarray(expected_e, dtype=np.float64)
    if light.size <= _LEVELS:
        return np.asarray(sum(merged_variances(light, readings).values()))
    most_e = max(float(light.max()), 2 * readings[0].pixel.full_well_e)
    levels = np.concatenate([[0.0], np.geomspace(1e-3, most_e, _LEVELS - 1)])
    return np.interp(light, levels, merged_variance(levels, readings))
