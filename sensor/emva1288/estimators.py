"""Estimators of EMVA Standard 1288 (release 4.0 Linear), each with its standard error.

All take statistics in DN, and return a value and its standard error, which follows from the number of draws. None of
them uses a configured value.
"""

from math import erfc, exp, hypot, inf, pi, sqrt

import numpy as np
from numpy.typing import NDArray

from rodcone.errors import InputError
from rodcone.types import Floats
from sensor.emva1288.photon_transfer import Stack, Transfer, column_variance, hot_pixels

QUANTISATION_DN2 = 1 / 12  # variance that rounding adds, where the noise is wide enough
FIT_SHARE = 0.7  # the standard fits the gain up to this share of saturation
LINEAR_RANGE = (0.05, 0.95)  # the standard's range for linearity, in shares of saturation

Estimate = tuple[float, float]


def gain(transfer: Transfer, dark: Stack, saturation_e: float) -> Estimate:
    """Estimate the overall system gain K [DN/e-]: the slope of temporal variance over mean up to 70 % of saturation.

    Mean and variance of the dark frames are subtracted from those of all others, and the line goes through the origin.
    The error of the dark variance is therefore common to all points, and the standard error treats it so.

    Raises
    ------
    InputError
        If the variance doesn't grow with the light, because the converter is too coarse or the well too small.
    """
    used = transfer.light_e <= FIT_SHARE * saturation_e
    signal = transfer.mean_dn[used] - dark.mean_dn.mean()
    excess = transfer.variance_dn2[used] - dark.variance_dn2
    power = float(np.sum(signal**2))
    slope = float(np.sum(signal * excess)) / power if power > 0 else 0.0
    pixels = dark.mean_dn.size
    of_points = np.sum((signal * transfer.variance_dn2[used]) ** 2) * 2 / pixels
    of_dark = (signal.sum() * dark.variance_dn2) ** 2 * 2 / (pixels * (dark.frames - 1))
    error = sqrt(float(of_points + of_dark)) / power if power > 0 else inf
    if not slope > 4 * error:  # 4 standard errors: no slope at all would be taken for one once in 3e4 chips
        raise InputError(
            f"gain: {slope:.3g} +- {error:.3g} DN/e- can't be told from 0, the light shows no shot noise; allowed: "
            "a camera whose noise exceeds its rounding; give more bits, a smaller well or a larger frame"
        )
    return slope, error


def linearity(transfer: Transfer, dark_mean_dn: float, saturation_e: float) -> tuple[Floats, float]:
    """Return each mean's relative deviation from the fitted line (NaN beyond 5-95 % of saturation), and its mean size.

    The line is fitted with weights 1/light^2, so that relative deviations count alike at all levels.
    """
    low, high = (share * saturation_e for share in LINEAR_RANGE)
    used = (transfer.light_e >= low) & (transfer.light_e <= high)
    share = np.full(transfer.light_e.shape, np.nan)
    if np.count_nonzero(used) < 3:
        return share, float("nan")
    light = transfer.light_e[used]
    signal = transfer.mean_dn[used] - dark_mean_dn
    slope, start = np.polyfit(light, signal, 1, w=1 / light)
    line = start + slope * light
    share[used] = signal / np.where(line > 0, line, np.nan) - 1
    return share, float(np.mean(np.abs(share[used])))


def dark_noise(dark: Stack, gain_dn_per_e: Estimate) -> Estimate:
    """Estimate the temporal dark noise [e-], with the noise of quantisation subtracted."""
    error = dark.variance_dn2 * sqrt(2 / (dark.mean_dn.size * (dark.frames - 1)))
    return _electrons(dark.variance_dn2 - QUANTISATION_DN2, error, gain_dn_per_e)


def dsnu(dark: Stack, gain_dn_per_e: Estimate) -> Estimate:
    """Estimate the spread of the pixels' dark values [e-], columns and hot pixels included."""
    return _electrons(dark.spatial_dn2, _spread_error(_squares(dark.mean_dn)), gain_dn_per_e)


def prnu(dark: Stack, bright: Stack) -> Estimate:
    """Estimate PRNU: the spread of the pixels' response to light over its mean, with that of the column gains."""
    signal = float(bright.mean_dn.mean() - dark.mean_dn.mean())
    error = _spread_error(_squares(bright.mean_dn) - _squares(dark.mean_dn))
    return _root((bright.spatial_dn2 - dark.spatial_dn2) / signal**2, error / signal**2)


def column_offset(dark: Stack, gain_dn_per_e: Estimate) -> Estimate:
    """Estimate the spread of the columns' dark offsets [e-]."""
    return _electrons(*column_variance(dark.mean_dn), gain_dn_per_e)


def column_gain(dark: Stack, bright: Stack) -> Estimate:
    """Estimate the relative spread of the columns' gains from what light adds to each column's mean."""
    added = bright.mean_dn - dark.mean_dn
    variance, error = column_variance(added)
    return _root(variance / added.mean() ** 2, error / added.mean() ** 2)


def well(
    full: Stack, dark: Stack, gain_dn_per_e: Estimate, column_spread: float, dark_e: float, beyond_e: float
) -> Estimate:
    """Estimate the electrons at the converter's top [e-] from the mean of frames in which every pixel is clipped.

    The converter clips read noise that goes over its top, which lowers the mean of full pixels. If a full well reads
    exactly the top, this loss is sigma / sqrt(2 pi), the mean of the noise's upper half; if the well holds `beyond_e`
    = a sigma more than the top, the loss is sigma (phi(a) - a Phi(-a)). The estimate adds it back. `dark_e` are the
    electrons that a dark frame collects.
    """
    slope, error = gain_dn_per_e
    full_e = float(full.mean_dn.mean() - dark.mean_dn.mean()) / slope + dark_e
    noise_e = sqrt(max(dark.variance_dn2 + dark.spatial_dn2, 0.0)) / slope
    sigma_e = hypot(noise_e, column_spread * full_e)
    a = beyond_e / sigma_e if sigma_e else 0.0
    full_e += sigma_e * (exp(-(a**2) / 2) / sqrt(2 * pi) - a * erfc(a / sqrt(2)) / 2)
    return full_e, full_e * error / slope


def dark_current(slopes: NDArray[np.float64], gain_dn_per_e: Estimate) -> tuple[Estimate, Estimate, Estimate]:
    """Estimate the dark current of ordinary pixels [e-/s], the share of hot pixels, and their excess [e-/s]."""
    hot = hot_pixels(slopes)
    share = float(hot.mean())
    rest = slopes[~hot] / gain_dn_per_e[0]
    relative = gain_dn_per_e[1] / gain_dn_per_e[0]
    current = float(rest.mean())
    spread = float(rest.std() / sqrt(rest.size))
    above = slopes[hot] / gain_dn_per_e[0] - current
    on_top = (float(above.mean()), float(above.std() / sqrt(above.size))) if hot.any() else (0.0, 0.0)
    return (
        (current, hypot(spread, current * relative)),
        (share, sqrt(share * (1 - share) / hot.size)),
        (on_top[0], hypot(on_top[1], on_top[0] * relative)),
    )


def _electrons(variance_dn2: float, error_dn2: float, gain_dn_per_e: Estimate) -> Estimate:
    """Convert a variance in DN^2 to a standard deviation in electrons; its error includes that of the gain."""
    slope, error = gain_dn_per_e
    value, error_e = _root(variance_dn2 / slope**2, error_dn2 / slope**2)
    return value, hypot(error_e, value * error / slope)


def _root(variance: float, error: float) -> Estimate:
    """Return the root of an estimated variance and its error; below three errors of the variance, its error's root."""
    value = sqrt(max(variance, 0.0))
    return value, error / (2 * value) if variance > 3 * error else sqrt(error)


def _squares(image: NDArray[np.float64]) -> Floats:
    """Return the mean square of each column's deviations from the image's mean, shape (w,)."""
    return np.asarray(np.mean((image - image.mean()) ** 2, axis=0))


def _spread_error(of_columns: Floats) -> float:
    """Return the standard error of the mean over columns, which are independent even if a column's pixels aren't."""
    return float(of_columns.std(ddof=1) / sqrt(of_columns.size))
