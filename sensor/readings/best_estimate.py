"""The best linear estimate of a pixel's light from several readings of one exposure, and its noise in closed form.

A reading i holds the share s_i of the electrons E that the whole pixel would hold in the whole exposure, and estimates
E by x_i / s_i. The covariance C of these estimates holds all that is needed: readings of one charge share its shot
noise, those of one photodiode its PRNU, all of them the column's amplifier; read noise is each reading's own. The best
linear estimate of E weighs them by

    w = C^-1 1 / (1^T C^-1 1),    of variance w^T C w.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import hypot, sqrt

import numpy as np
import scipy
from numpy.typing import NDArray

from rodcone.types import Floats
from sensor.calibration import NoiseStep
from sensor.readings.resolve import PlainReading

# A reading, or a frame of a burst, counts where the merged light stays 6 standard deviations below its full well: noise
# then clips it in one of 1e9 pixels.
CLEAR_SIGMAS = 6.0
_ROUNDS = 6  # rounds in which the weights are refined, as in `sensor.burst`
_WEIGHT_LEVELS = 512  # levels of light at which weights are computed; between them they are interpolated
# A large frame's variance is computed at this many levels of light, 0.3 % apart, and interpolated between them.
_VARIANCE_LEVELS = 8192


@dataclass(frozen=True)
class Seams:
    """Readings in the order in which they fill, and the light at which the merge hands over from each to the next.

    Attributes
    ----------
    order : (reading,) intp
    handover_e : (reading,) float64
        Photo-electrons of the whole pixel at which the merge leaves the reading out; below 0 if dark current alone
        fills it. For the last reading, the level from which on it may clip.
    """

    order: NDArray[np.intp]
    handover_e: Floats


def shares(readings: Sequence[PlainReading]) -> Floats:
    """Return for each reading its share of the electrons that the whole pixel collects in the whole exposure."""
    return np.array([x.share for x in readings])


def collected_share(readings: Sequence[PlainReading]) -> float:
    """Return the electrons of all charges over those of the whole pixel; merged electrons are in units of it."""
    return float(sum({x.charge: x.share for x in readings}.values()))


def dark_electrons(readings: Sequence[PlainReading]) -> float:
    """Return the mean electrons of dark current and hot pixels in the whole pixel."""
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
    """Find the light from which on each reading is left out.

    That is six standard deviations below the reading's full well, but at least half of the well.
    """
    full_e = np.array([x.sensor.pixel.full_well_e for x in readings]) / shares(readings)
    total = sum(covariances(full_e, readings).values())
    spread_e = np.sqrt(np.einsum("iii->i", total))
    clear_e = np.maximum(full_e - CLEAR_SIGMAS * spread_e, full_e / 2)
    handover_e = clear_e - dark_electrons(readings)  # negative where dark current alone fills the reading
    order = np.argsort(handover_e, kind="stable")
    return Seams(order, handover_e[order])


def merged_electrons(estimates_e: Floats, readings: Sequence[PlainReading]) -> Floats:
    """Combine each reading's estimate of the whole pixel's electrons.

    Weights and the choice of readings follow the merged light and never one reading's own noisy value. The best linear
    estimate is uncorrelated with the differences between the readings, so a decision that follows it favours none of
    them.

    Parameters
    ----------
    estimates_e : (reading, h, w) float64
        Each reading's electrons over its share, without the dark current's mean.

    Returns
    -------
    (h, w) float64
    """
    at = seams(readings)
    levels = np.concatenate([[0.0], np.geomspace(1e-2, readings[0].pixel.full_well_e, _WEIGHT_LEVELS - 1)])
    total = np.asarray(sum(covariances(levels, readings).values()))
    flat = estimates_e.reshape(len(estimates_e), -1)
    light = np.empty(flat.shape[1])
    where = np.arange(flat.shape[1])
    for number, handover_e in enumerate(at.handover_e):
        weights = best_weights(total, at.order[number:])
        light[where] = _weighted(flat[:, where], weights, levels)
        where = where[light[where] >= handover_e]
        if where.size == 0:
            break
    return light.reshape(estimates_e.shape[1:])


def _weighted(estimates_e: Floats, weights: Floats, levels_e: Floats) -> Floats:
    """Return the estimates' weighted mean, in which each pixel's weights are those of its own mean's level.

    Weights (level, reading) depend on the mean and the mean on the weights, so both are refined in a few rounds.
    """
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


def merged_noise_steps(readings: Sequence[PlainReading]) -> list[NoiseStep]:
    """List the noise steps of merged electrons: one that begins at 0 electrons, and one at each seam.

    Each step states dark noise at its lower end and shot noise and PRNU at its upper end, where each dominates.
    """
    at = seams(readings)
    whole = collected_share(readings)
    temporal = ("read noise", "converter noise", "quantisation", "dark current")
    pixel, exposure_s = readings[0].pixel, readings[0].exposure_s
    of_columns_e2 = (pixel.column_gain_spread * pixel.dark_current_e_per_s * exposure_s) ** 2
    starts_e = np.maximum([0.0, *at.handover_e[:-1]], 0.0)
    ends_e = np.maximum(at.handover_e, 1.0)
    first = min(int(np.sum(at.handover_e <= 0.0)), len(ends_e) - 1)  # dark current alone fills those before it
    steps = []
    for number, (start_e, end_e) in list(enumerate(zip(starts_e, ends_e, strict=True)))[first:]:
        dark, bright = (_variances_at(level_e, readings, at.order[number:]) for level_e in (start_e, end_e))
        steps.append(
            NoiseStep(
                from_e=whole * float(start_e),
                shot=whole * bright["shot noise"] / float(end_e),
                read_noise_e=whole * sqrt(sum(dark[name] for name in temporal)),
                dsnu_e=whole * sqrt(dark["DSNU"] + dark["column offsets"] + of_columns_e2),
                prnu=hypot(sqrt(bright["PRNU"]) / float(end_e), pixel.column_gain_spread),
            )
        )
    return [*steps[:1], *steps] if first else steps  # a raw image states the dark noise of all charges


def _variances_at(expected_e: float, readings: Sequence[PlainReading], kept: NDArray[np.intp]) -> dict[str, float]:
    """Return the variance of the best estimate from the readings `kept`, for each source of noise."""
    by_source = covariances(np.array([expected_e]), readings)
    weights = best_weights(np.asarray(sum(by_source.values())), kept)[0]
    return {name: float(weights @ covariance[0] @ weights) for name, covariance in by_source.items()}


def merged_variances(expected_e: Floats, readings: Sequence[PlainReading]) -> Mapping[str, Floats]:
    """Return the merge's variance over chips and exposures for each source [e-^2], shaped as `expected_e`.

    Around a seam some pixels use the reading that is about to fill and others don't, by their merged light. This choice
    isn't correlated with the differences between the readings, so the variances of both kinds are averaged by the share
    of the pixels.
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
    if light.size <= _VARIANCE_LEVELS:
        return np.asarray(sum(merged_variances(light, readings).values()))
    most_e = max(float(light.max()), 2 * readings[0].pixel.full_well_e)
    levels = np.concatenate([[0.0], np.geomspace(1e-3, most_e, _VARIANCE_LEVELS - 1)])
    return np.interp(light, levels, merged_variance(levels, readings))
