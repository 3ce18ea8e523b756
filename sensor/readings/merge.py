"""Merge several readings of every pixel into one linear raw image (docs/decisions/0047-several-readings.md)."""

from collections.abc import Sequence
from dataclasses import replace
from math import ceil, hypot, sqrt

import numpy as np
from numpy.typing import NDArray

from rodcone.types import Floats
from sensor.calibration import NoiseStep
from sensor.config import BLACK_SIGMAS
from sensor.raw import RawImage
from sensor.readings.noise import best_weights, collected_share, covariances, seams, shares
from sensor.readings.resolve import PlainReading

# The merged image has linear words of 24 bits, as chips that merge write them; single precision holds each exactly.
# Over 256, black and white are whole numbers of 16 bits, in which a digital negative states them.
MERGED_WHITE_DN = 256 * 65_535
_ROUNDS = 6  # in which the weights are refined, as in `sensor.burst`
_LEVELS = 512  # of light at which weights are computed; between them they are interpolated


def merge(readings: Sequence[PlainReading], raws: Sequence[RawImage]) -> RawImage:
    """Merge all readings of one exposure.

    The raw image's electrons are those of all charges together, so that shot noise is Poisson's as long as none is
    full; beyond each seam `RawImage.noise_steps` says what the rest knows. Its exposure time is the one that would
    collect as many: the whole pixel's times `collected_share`.

    Parameters
    ----------
    readings : sequence of PlainReading
    raws : sequence of RawImage
        What each of them read.
    """
    pixel, exposure_s = readings[0].pixel, readings[0].exposure_s
    whole = collected_share(readings)
    last = seams(readings).order[-1]
    dark_current_e = pixel.dark_current_e_per_s * exposure_s
    estimates_e = [raw.electrons / share for raw, share in zip(raws, shares(readings), strict=True)]
    electrons = merged_electrons(np.stack(estimates_e), readings) * whole
    base, *steps = merged_noise_steps(readings)

    full_e = max(pixel.full_well_e - dark_current_e, 1.0) * whole
    dark_e = BLACK_SIGMAS * hypot(base.read_noise_e, base.dsnu_e)
    black_dn = 256 * ceil(65_535 * dark_e / (full_e + dark_e))
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
        dark_current_e=min(dark_current_e, pixel.full_well_e) * whole,
    )


def merged_electrons(estimates_e: Floats, readings: Sequence[PlainReading]) -> Floats:
    """Combine each reading's estimate of the whole pixel's electrons.

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
    at = seams(readings)
    levels = np.concatenate([[0.0], np.geomspace(1e-2, readings[0].pixel.full_well_e, _LEVELS - 1)])
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
    """Return the weighted mean, found in a few rounds, by the weights (level, reading) at its own level."""
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
    """List the noise of merged electrons from the dark on, and from each seam on.

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
