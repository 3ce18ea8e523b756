"""Photon transfer: temporal noise grows as the signal, fixed-pattern noise as its square; patterns stay with the chip.

Variances are taken from frame pairs, in DN^2 or e-^2, the dark's subtracted. Their standard errors are worked out, not
measured; slopes must lie within 4 of their own (false-alarm rate 6.3e-5 each). The keys are fixed.
"""

import numpy as np
import pytest

from sensor.chip import PixelConfig
from sensor.config import LensConfig, SensorConfig
from sensor.device import draw_device
from sensor.readout import read_out

SHAPE = (512, 512)
PIXELS = SHAPE[0] * SHAPE[1]
SENSOR = SensorConfig(PixelConfig(2.2, 0.9, 60_000.0, read_noise_e=3.0, dsnu_e=4.0, prnu=0.02), LensConfig(2.8))
LEVELS_E = np.array([10.0, 30.0, 100.0, 300.0, 1e3, 3e3, 1e4, 4e4])


def frames(device, level_e, rng, count=2):
    light = np.full(SHAPE, level_e)
    return [read_out(light, SENSOR, device, 0.01, rng).electrons for _ in range(count)]


def pair_statistics(pair):
    """Mean, temporal variance (half the variance of the difference) and spatial variance (covariance of the frames)."""
    first, second = pair
    return (
        (first.mean() + second.mean()) / 2,
        np.var(first - second) / 2,
        np.mean((first - first.mean()) * (second - second.mean())),
    )


def series(levels_e, seed=1):
    device = draw_device(SENSOR, SHAPE, np.random.default_rng(seed))
    rng = np.random.default_rng(seed + 100)
    rows = np.array([pair_statistics(frames(device, level, rng)) for level in (0.0, *levels_e)])
    return rows[1:] - rows[0]  # signal, temporal and spatial variance above the dark's


def slope_and_error(signal, variance, error):
    """Weighted straight line through the logarithms, and the standard error of its slope."""
    x, y, weight = np.log(signal), np.log(variance), (variance / error) ** 2
    x = x - np.average(x, weights=weight)
    return np.sum(weight * x * y) / np.sum(weight * x**2), 1 / np.sqrt(np.sum(weight * x**2))


def dark_variances():
    return SENSOR.pixel.read_noise_e**2 + SENSOR.gain_e_per_dn**2 / 12, SENSOR.pixel.dsnu_e**2


@pytest.mark.thorough
def test_temporal_noise_has_slope_1_and_gives_back_the_gain():
    signal, temporal, _ = series(LEVELS_E).T
    read, _ = dark_variances()
    # half the variance of a difference of n pixels: relative error sqrt(2 / n); the dark's own comes on top
    error = np.sqrt(2 / PIXELS) * np.hypot(LEVELS_E + read, read)
    slope, slope_error = slope_and_error(signal, temporal, error)
    assert slope_error < 0.002
    assert abs(slope - 1) < 4 * slope_error
    # each level alone, 8 times 6.3e-5: variance over mean in electrons is 1
    assert np.all(np.abs(temporal - LEVELS_E) < 4 * error)


def test_fixed_pattern_noise_has_slope_2_and_gives_back_prnu():
    levels_e = LEVELS_E[LEVELS_E >= 1e3]  # where the pattern is no smaller than the error
    signal, _, spatial = series(levels_e).T
    read, offset = dark_variances()
    fixed = (SENSOR.pixel.prnu * levels_e) ** 2
    # covariance of n pixels: sqrt((V1 V2 + C^2) / n) with V all variance and C the common one. DSNU and PRNU are drawn
    # independently: their sample correlation adds 2 sqrt(fixed offset / n).
    whole = levels_e + read + offset + fixed
    error = np.sqrt((whole**2 + (fixed + offset) ** 2 + 4 * fixed * offset) / PIXELS)
    slope, slope_error = slope_and_error(signal, spatial, error)
    assert slope_error < 0.02
    assert abs(slope - 2) < 4 * slope_error
    prnu = np.sqrt(spatial) / signal
    assert np.all(np.abs(prnu - 0.02) < 4 * 0.02 * error / (2 * fixed))  # 4 times 6.3e-5


def test_the_dark_gives_back_read_noise_and_dsnu():
    device = draw_device(SENSOR, SHAPE, np.random.default_rng(3))
    mean, temporal, spatial = pair_statistics(frames(device, 0.0, np.random.default_rng(4)))
    read, offset = dark_variances()
    # mean, temporal and spatial variance within 4 standard errors: false-alarm rate 1.9e-4
    assert abs(mean) < 4 * np.sqrt((offset + read / 2) / PIXELS)
    assert abs(temporal - read) < 4 * read * np.sqrt(2 / PIXELS)
    assert abs(spatial - offset) < 4 * np.sqrt(((offset + read) ** 2 + offset**2) / PIXELS)


def correlation(first, second):
    return np.corrcoef(first.ravel(), second.ravel())[0, 1]


def test_two_exposures_of_one_chip_share_their_pattern_and_two_chips_share_none():
    level_e = 4e4
    one, other = (draw_device(SENSOR, SHAPE, np.random.default_rng(seed)) for seed in (5, 6))
    rng = np.random.default_rng(7)
    (first, second), (third, _) = (frames(device, level_e, rng) for device in (one, other))
    read, offset = dark_variances()
    common = (0.02 * level_e) ** 2 + offset
    shared = common / (common + level_e + read)  # 0.94
    # a correlation r of n pixels has the standard error (1 - r^2) / sqrt(n); two comparisons within 4: 1.3e-4
    assert abs(correlation(first, second) - shared) < 4 * (1 - shared**2) / np.sqrt(PIXELS)
    assert abs(correlation(first, third)) < 4 / np.sqrt(PIXELS)


@pytest.mark.thorough
def test_the_mean_of_many_exposures_is_the_chip_s_pattern():
    shape = (64, 64)
    device = draw_device(SENSOR, shape, np.random.default_rng(8))
    rng = np.random.default_rng(9)
    count, level_e = 200, 1000.0
    mean = np.mean(
        [read_out(np.full(shape, level_e), SENSOR, device, 0.01, rng).electrons for _ in range(count)], axis=0
    )
    pattern = level_e * device.photo_response + device.dark_offset_e
    error = np.sqrt((level_e * device.photo_response + dark_variances()[0]) / count)
    z = (mean - pattern) / error
    # chi-squared of 4096 pixels within 4 standard errors, the worst pixel within 5.5: false-alarm rate 2.2e-4
    assert abs(np.mean(z**2) - 1) < 4 * np.sqrt(2 / z.size)
    assert np.abs(z).max() < 5.5
