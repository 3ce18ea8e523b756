"""Mean and variance of samples that the well and the converter clip, in closed form.

Counted electrons n are assumed to be Gaussian. They clip at the well, the noise e of reading is added, and the
converter clips the sum: min(min(n, well) + e, top). For a given e that is min(n, c) + e with c = min(well, top - e), a
Gaussian censored at c, whose moments are

    z = (c - mean) / sigma,    E[min(n, c)] = mean + sigma (z (1 - P(z)) - p(z)),
    E[(min(n, c) - mean)^2] = sigma^2 (P(z) - z p(z) + z^2 (1 - P(z))),

where P and p are the normal distribution and density (Tobin 1958). They are integrated over e by Gauss-Legendre
quadrature, on either side of the e above which the converter clips before the well does. Poisson's skewness is left
out: for a well of 6000 e- it lowers the variance by 1 % at the well, and by 6 % if the mean is three standard
deviations above it. Below black, where the converter ends at 0 DN, counted electrons and noise of reading together are
one Gaussian, censored from below. Photodiodes that bin are treated as one pixel with their sum.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from rodcone.types import Floats
from sensor.cfa import mask
from sensor.pixel import bent_e, bent_slope
from sensor.readings.resolve import PlainReading

FAR = 7.0  # a sample more than this many standard deviations from a bound never clips there
LOW = 4.9  # the same for black: the default black level is five standard deviations high and clips nothing
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(24)


@dataclass(frozen=True)
class Moments:
    """Mean and variance of clipped samples; arrays of one shape.

    Attributes
    ----------
    mean_e : array
        Mean less that of dark current and hot pixels [e-]; it is the light where nothing clips.
    variance_e2 : array
        Variance over chips and exposures [e-^2].
    slope : array
        Derivative of the mean by the light: 1 where nothing clips, 0 where everything does.
    """

    mean_e: Floats
    variance_e2: Floats
    slope: Floats


def censored(mean: Floats, variance: Floats, most: Floats | float) -> tuple[Floats, Floats, Floats]:
    """Return E[min(n, most)] - mean, E[(min(n, most) - mean)^2] and the share P(n < most), for a Gaussian n."""
    sigma = np.sqrt(variance)
    z = np.clip((most - mean) / np.maximum(sigma, 1e-300), -1e8, 1e8)
    below = scipy.special.ndtr(z)
    density = np.exp(-np.square(np.clip(z, -40, 40)) / 2) / np.sqrt(2 * np.pi)
    first = sigma * (z * scipy.special.ndtr(-z) - density)
    second = variance * (below - z * density + z**2 * scipy.special.ndtr(-z))
    return first, second, below


def clipped(light_e: Floats, reading: PlainReading) -> Moments:
    """Return the moments of one reading's samples, clipped, where light gives `light_e` expected photo-electrons.

    All electrons are those of the raw image: the whole pixel's over the whole exposure.
    """
    shape = np.shape(light_e)
    light = np.ravel(np.asarray(light_e, dtype=np.float64))
    sensor, share = reading.sensor, reading.share
    law = reading.law
    dark_e = sensor.pixel.dark_current_e_per_s * reading.exposure_s / share
    hot_e = reading.dark_e - dark_e
    mean = light + hot_e
    variance = law.variance(light)
    slope = np.ones_like(light)
    black_e = dark_e
    well_e, top_e = sensor.pixel.full_well_e / share - dark_e, reading.headroom_e
    if sensor.pixel.response_bend:
        mean, slope, black_e = _bent(mean + dark_e, dark_e, reading)
        variance = variance + (slope**2 - 1) * reading.counted_law.variance(light)
        well_e, top_e = well_e + dark_e - black_e, top_e + dark_e - black_e

    # Clip at the well and at the converter's top.
    near = mean + FAR * np.sqrt(variance) > top_e
    if near.any():
        counted = reading.counted_law.variance(light[near]) * slope[near] ** 2
        after_e = np.sqrt(np.maximum(variance[near] - counted, 0.0))
        first, second, open_ = _over_reading(mean[near], counted, after_e, well_e, top_e)
        mean[near] += first
        variance[near], slope[near] = second - first**2, open_ * slope[near]

    # Clip at black. Only the noise of reading brings samples below it: counts aren't negative, and rounding clips none.
    bottom_e = -sensor.black_dn * sensor.gain_e_per_dn / share - black_e
    rounding_e2 = reading.sources["quantisation"].dark_e ** 2
    after_e2 = law.variance(np.zeros(1)) - reading.counted_law.variance(np.zeros(1))
    low = ~near & (mean - LOW * np.sqrt(np.maximum(after_e2 - rounding_e2, 0.0)) < bottom_e)
    if low.any():
        first, second, open_ = censored(-mean[low], variance[low] - rounding_e2, -bottom_e)
        mean[low] -= first
        variance[low], slope[low] = second - first**2 + rounding_e2 * open_, open_ * slope[low]
    return Moments(*(np.reshape(x, shape) for x in (mean - hot_e, np.maximum(variance, 0.0), slope)))


def _bent(collected_e: Floats, dark_e: float, reading: PlainReading) -> tuple[Floats, Floats, float]:
    """Return the bent response to the electrons collected, above black, its slope, and the response to dark current.

    Beyond the well, where samples clip, the response continues straight.
    """
    pixel = reading.sensor.pixel
    share = reading.share
    own_e = np.minimum(collected_e * share, pixel.full_well_e)
    slope = bent_slope(own_e, pixel)
    black_e = bent_e(dark_e * share, pixel) / share
    return bent_e(own_e, pixel) / share + slope * (collected_e - own_e / share) - black_e, slope, black_e


def _over_reading(
    mean: Floats, counted: Floats, after_e: Floats, well_e: float, top_e: float
) -> tuple[Floats, Floats, Floats]:
    """Return the first two moments of min(min(n, well) + e, top) - `mean`, and the share of samples that don't clip.

    e is the noise of reading, with the standard deviation `after_e`.
    """
    first, second, open_ = (np.zeros_like(mean) for _ in range(3))
    reach = np.maximum(FAR * after_e, 1e-9)
    change = np.clip(top_e - well_e, -reach, reach)  # under it the well clips first, over it the converter
    for start, end in ((-reach, change), (change, reach)):
        half = (end - start) / 2
        middle = (end + start) / 2
        for node, weight in zip(_NODES, _WEIGHTS, strict=True):
            e = middle + half * node
            scale = np.maximum(after_e, 1e-9 / FAR)
            probability = weight * half * np.exp(-((e / scale) ** 2) / 2) / (scale * np.sqrt(2 * np.pi))
            m, s, below = censored(mean, counted, np.minimum(well_e, top_e - e))
            first += probability * (m + e)
            second += probability * (s + 2 * m * e + e**2)
            open_ += probability * below
    return first, second, open_


def clipped_frame(mean_e: Floats, readings: Sequence[PlainReading]) -> Moments:
    """Return the moments of a frame to which each reading contributes the sites that it covers."""
    if readings[0].sites is None:
        return clipped(mean_e, readings[0])
    parts = np.empty((3, *mean_e.shape))
    for reading in readings:
        at = mask(reading.sensor.cfa, str(reading.sites), (mean_e.shape[0], mean_e.shape[1]))
        moments = clipped(mean_e[at], reading)
        parts[:, at] = moments.mean_e, moments.variance_e2, moments.slope
    return Moments(*parts)
