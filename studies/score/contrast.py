"""Contrast transfer accuracy (IEEE 2020-2024): how surely a pair of pixels measures the contrast of what it sees.

Two pixels see luminances of Michelson contrast K and read x and y. The contrast that they measure, (x - y) / (x + y),
counts as right between K (1 - d) and K (1 + d). The figure is the probability of that, summed over all pairs of
readings. The probability of a reading is

    P(DN) = sum_n Poisson(n; e + m) P(DN | n),

where e are the expected photo-electrons and m those of dark current, whose mean is part of black. P(DN | n) is the
normal distribution of all other noise, rounded and clipped by the converter. From 1000 electrons on, one normal
distribution approximates all noise.
"""

from collections.abc import Iterator
from functools import partial
from math import pi

import numpy as np
from scipy.special import ndtr
from scipy.stats import poisson

from rodcone.types import Floats
from sensor.config import SensorConfig
from sensor.readings.resolve import at_channel, resolve, several
from studies.metrics.truth import GREY, named_light
from studies.score.even_field import EvenField, even_field
from studies.score.figure import Definition, Merit

CONTRAST, TOLERANCE = 0.2, 0.5  # K and d
EQUAL = 1e-5  # a contrast beyond a limit by this or less still counts, because many whole readings lie on a limit
COUNTED_E = 1000.0  # mean electrons from which on a normal distribution replaces Poisson's
TAIL = 1e-12  # share of Poisson's distribution that is left out
LUX = (0.1, 1.0, 10.0, 100.0)  # illuminance [lux] of an 18 % grey card whose luminance is the pair's mean


def contrast_figures(sensor: SensorConfig, light: str, exposure_s: float, channel: str) -> Iterator[Definition]:
    """Define the accuracy at each illuminance in `LUX`."""
    field = even_field(sensor, named_light(light, sensor.window_nm), exposure_s, channel)
    for lux in LUX:
        mean = lux * GREY / pi
        merit = Merit(
            f"ieee_2020.cta_{lux:g}_lux",
            f"contrast transfer accuracy at {lux:g} lux",
            "1",
            "IEEE 2020-2024 (there CTA, before CDP)",
            f"{channel}, raw, Michelson contrast {CONTRAST:g} within {100 * TOLERANCE:.0f} %, pixels of two chips, "
            f"{light}, {exposure_s * 1e3:.4g} ms, f/{sensor.lens.f_number:g}",
            accuracy(field, mean),
        )
        yield Definition((merit,), partial(_measure, field, mean))


def _measure(field: EvenField, mean_cd_m2: float, rng: np.random.Generator) -> list[float]:
    return [accuracy_on_frames(field, mean_cd_m2, rng)]


def accuracy(field: EvenField, mean_cd_m2: float) -> float:
    """Compute the accuracy by formula at a pair's mean luminance; NaN for a camera that merges readings."""
    sides = [reading_distribution(field, mean_cd_m2 * side) for side in (1 + CONTRAST, 1 - CONTRAST)]
    if not all(len(side[0]) for side in sides):
        return float("nan")
    (bright_e, bright), (dark_e, dark) = sides
    total = bright_e[:, None] + dark_e
    contrast = np.divide(bright_e[:, None] - dark_e, total, out=np.full_like(total, np.inf), where=total > 0)
    right = np.abs(contrast - CONTRAST) <= CONTRAST * TOLERANCE + EQUAL
    return float(bright @ right @ dark)


def reading_distribution(field: EvenField, luminance_cd_m2: float) -> tuple[Floats, Floats]:
    """Return the readings that a pixel may give [e-], and the probability of each."""
    sensor = field.sensor
    expected_e = luminance_cd_m2 * field.electrons_per_cd_m2
    readings = at_channel(resolve(sensor, np.array([expected_e]), field.exposure_s, field.channel), field.channel)
    if several(readings):
        return np.empty(0), np.empty(0)
    (reading,) = readings
    seen, share = reading.sensor, reading.share
    law = reading.law.over(1 / share)
    gain = seen.gain_e_per_dn
    mean_e, dark_e = expected_e * share, seen.pixel.dark_current_e_per_s * reading.exposure_s
    temporal_e2 = max(law.dark_e**2 - gain**2 / 12 - dark_e, 0.0)
    # Besides Poisson's count, light raises the noise of PRNU and of the columns' gains, which also act on dark current.
    lit_e2 = (law.prnu * mean_e) ** 2 + (law.shot - 1) * mean_e
    rest_e = float(np.sqrt(temporal_e2 + law.fixed_e**2 + lit_e2))
    counts = np.array([mean_e + dark_e])
    weights = np.ones(1)
    if mean_e < COUNTED_E:
        counts = np.arange(int(poisson.ppf(1 - TAIL, mean_e + dark_e)) + 1.0)
        weights = poisson.pmf(counts, mean_e + dark_e)
    else:
        rest_e = float(np.hypot(rest_e, (mean_e + dark_e) ** 0.5))
    centre = seen.black_dn + counts / gain
    low = max(int(centre[0] - 8 * rest_e / gain) - 1, 0)
    high = min(int(centre[-1] + 8 * rest_e / gain) + 2, seen.white_dn)
    dn = np.arange(low, high + 1.0)
    edges = np.concatenate(([-np.inf], (dn[1:] + dn[:-1]) / 2, [np.inf]))
    below = ndtr((edges - centre[:, None]) / max(rest_e / gain, 1e-9))
    # The dark current's mean is subtracted, because a raw image's black level includes it.
    return ((dn - seen.black_dn) * gain - dark_e) / share, np.asarray(weights @ np.diff(below, axis=1))


def accuracy_on_frames(field: EvenField, mean_cd_m2: float, rng: np.random.Generator) -> float:
    """Measure the accuracy on simulated frames: the share of pixel pairs that measure the contrast right.

    A pair is a pixel of a brighter field on one chip, and the same pixel of a darker field on another.
    """
    bright, dark = (
        field.samples_e(field.shoot(mean_cd_m2 * side, field.draw_chip(rng), rng))
        for side in (1 + CONTRAST, 1 - CONTRAST)
    )
    total = bright + dark
    contrast = np.divide(bright - dark, total, out=np.full_like(total, np.inf), where=total > 0)
    return float(np.mean(np.abs(contrast - CONTRAST) <= CONTRAST * TOLERANCE + EQUAL))
