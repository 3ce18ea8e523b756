"""Estimators of EMVA 1288 on statistics whose answer is known; drawn chips are in `test_characterise.py`."""

from dataclasses import replace

import numpy as np
import pytest
from loop import loop
from refusal import refusal

from rodcone.errors import InputError
from sensor.emva1288 import estimators as emva
from sensor.emva1288.photon_transfer import (
    Stack,
    Transfer,
    column_variance,
    dark_slopes,
    hot_pixels,
    light_bench,
    take_stack,
    take_transfer,
)
from sensor.presets import preset

SHAPE = (40, 50)
GAIN = (0.5, 0.001)  # DN/e-


def stack(mean_dn, variance_dn2=4.0, frames=16):
    return Stack(np.broadcast_to(np.asarray(mean_dn, dtype=float), SHAPE), variance_dn2, frames)


def line(gain=0.5, dark_dn=20.0, dark_variance=4.0):
    """An ideal camera: well of 1000 e-, where the variance falls to the dark's."""
    light_e = np.linspace(50, 1100, 22)
    signal = np.minimum(light_e, 1000.0)
    return Transfer(light_e, dark_dn + gain * signal, dark_variance + gain**2 * np.where(light_e < 1000, light_e, 0.0))


def test_the_gain_is_the_slope_of_variance_over_mean_whatever_the_dark():
    for dark_variance in (0.0, 4.0, 100.0):
        value, error = emva.gain(line(dark_variance=dark_variance), stack(20.0, dark_variance), 950.0)
        assert value == pytest.approx(0.5, rel=1e-12)
        assert 0 < error < 0.05


def test_the_gain_s_line_ends_at_70_per_cent_of_saturation():
    bent = line()
    bent.variance_dn2[bent.light_e > 0.7 * 950] *= 3
    assert emva.gain(bent, stack(20.0), 950.0)[0] == pytest.approx(0.5, rel=1e-12)
    assert emva.gain(bent, stack(20.0), 1000.0)[0] > 0.6


def test_the_gain_s_error_is_the_scatter_of_lines_with_chi_squared_variances():
    rng, exact = np.random.default_rng(1), line()
    pixels, gains, errors = SHAPE[0] * SHAPE[1], [], []
    for _ in range(400):
        variance = exact.variance_dn2 * rng.chisquare(pixels, exact.light_e.size) / pixels
        dark = stack(20.0, 4.0 * rng.chisquare(pixels * 15) / (pixels * 15))
        value, error = emva.gain(Transfer(exact.light_e, exact.mean_dn, variance), dark, 950.0)
        gains.append(value)
        errors.append(error)
    # a spread of 400 has the standard error 1/sqrt(800): 4 of them, false-alarm rate 6.3e-5
    assert np.std(gains) == pytest.approx(np.mean(errors), rel=4 / np.sqrt(800))


@loop("variance", [4.0, 3.9])
def test_a_camera_whose_variance_does_not_grow_is_refused_in_one_line(variance):
    flat = Transfer(line().light_e, line().mean_dn, np.full(22, variance))
    refusal(emva.gain, flat, stack(20.0), 950.0, match=r"gain: .*shows no shot noise.*give more bits")
    with pytest.raises(InputError, match="gain"):
        emva.gain(Transfer(line().light_e, np.full(22, 20.0), line().variance_dn2), stack(20.0), 950.0)


def test_a_straight_camera_is_linear_and_a_bent_one_as_far_off_as_it_is_bent():
    share, mean = emva.linearity(line(), 20.0, 950.0)
    used = np.isfinite(share)
    np.testing.assert_array_equal(used, line().light_e <= 0.95 * 950)
    np.testing.assert_allclose(share[used], 0.0, atol=1e-12)
    assert mean == pytest.approx(0.0, abs=1e-12)
    light = line().light_e
    share, mean = emva.linearity(Transfer(light, 20 + light + 2e-5 * light**2, light), 20.0, 950.0)
    x, y = light[used], light[used] + 2e-5 * light[used] ** 2
    line_of = np.linalg.lstsq(np.column_stack([1 / x, np.ones(x.size)]), y / x, rcond=None)[0]  # relative residuals
    expected = y / (line_of[0] + line_of[1] * x) - 1
    np.testing.assert_allclose(share[used], expected, atol=1e-12)
    assert mean == pytest.approx(np.abs(expected).mean(), rel=1e-9)
    assert expected.max() - expected.min() > 0.005


def test_too_few_levels_in_the_range_leave_linearity_unknown_without_a_warning():
    share, mean = emva.linearity(line(), 20.0, 60.0)
    assert np.isnan(share).all()
    assert np.isnan(mean)


def test_dark_noise_is_less_quantisation_and_in_electrons():
    value, error = emva.dark_noise(stack(20.0, 4.0 + 1 / 12), GAIN)
    assert value == pytest.approx(2.0 / 0.5, rel=1e-12)
    # relative: the gain's 0.2 %, and the variance's sqrt(2 / (2000 x 15)) halved, enlarged by the quantisation
    assert error == pytest.approx(4.0 * np.hypot(0.002, (4 + 1 / 12) / 4 * np.sqrt(2 / 30_000) / 2), rel=1e-9)
    assert emva.dark_noise(stack(20.0, 0.01), GAIN)[0] == 0.0


def test_dsnu_and_prnu_are_spatial_spreads_with_the_dark_s_taken_off():
    rng = np.random.default_rng(2)
    offset, response = rng.normal(0, 3, SHAPE), rng.normal(1, 0.02, SHAPE)
    dark, bright = stack(20 + offset, 0.0), stack(20 + offset + 400 * response, 0.0)
    assert emva.dsnu(dark, GAIN)[0] == pytest.approx(offset.std() / 0.5, rel=1e-12)
    expected = np.sqrt((offset + 400 * response).var() - offset.var()) / (400 * response.mean())
    value, error = emva.prnu(dark, bright)
    assert value == pytest.approx(expected, rel=1e-12)
    assert abs(value - 0.02) < 4 * error  # 6.3e-5
    assert emva.prnu(dark, stack(420 + offset, 0.0))[0] == pytest.approx(0.0, abs=1e-6)


def test_each_spreads_error_is_its_scatter_over_chips():
    """Of 400 chips a standard deviation is off by 3.5 %; the errors told are within a seventh of it, 4 of its own."""
    rng = np.random.default_rng(3)
    told = {name: [] for name in ("dark noise", "DSNU", "PRNU", "column offsets", "column gains")}
    for _ in range(400):
        by_pixel, by_column = rng.normal(0.0, 1.0, (2, *SHAPE)), rng.normal(0.0, 1.0, (2, 1, SHAPE[1]))
        dark_dn, response = 2.0 * by_pixel[0] + by_column[0], 1 + 0.02 * by_pixel[1] + 0.01 * by_column[1]
        freedom = 15 * SHAPE[0] * SHAPE[1]
        dark = stack(20.0 + dark_dn + rng.normal(0.0, 0.5, SHAPE), 4.0 * rng.chisquare(freedom) / freedom)
        bright = stack(20.0 + dark_dn + 400.0 * response + rng.normal(0.0, 2.0, SHAPE), 64.0)
        exact = (GAIN[0], 0.0)
        told["dark noise"].append(emva.dark_noise(dark, exact))
        told["DSNU"].append(emva.dsnu(dark, exact))
        told["PRNU"].append(emva.prnu(dark, bright))
        told["column offsets"].append(emva.column_offset(dark, exact))
        told["column gains"].append(emva.column_gain(dark, bright))
    for name, estimates in told.items():
        values, errors = np.transpose(estimates)
        assert np.sqrt(np.mean(errors**2)) == pytest.approx(values.std(), rel=1 / 7), name


def test_columns_that_are_alike_are_not_said_to_differ():
    """40 chips: beyond two errors is one figure in 700, and was one in six."""
    rng = np.random.default_rng(1)
    found = [emva.column_offset(stack(rng.normal(20.0, 1.0, SHAPE)), GAIN) for _ in range(40)]
    assert max(value / error for value, error in found) < 2


def test_column_offsets_and_gains_come_from_column_means():
    rng = np.random.default_rng(3)
    offset, gain = rng.normal(0, 2, 50), rng.normal(1, 0.01, 50)
    dark, bright = stack(20 + offset, 0.0), stack(20 + offset + 400 * gain, 0.0)
    assert emva.column_offset(dark, GAIN)[0] == pytest.approx(offset.std(ddof=1) / 0.5, rel=1e-12)
    assert emva.column_gain(dark, bright)[0] == pytest.approx(gain.std(ddof=1) / gain.mean(), rel=1e-9)


def test_the_well_is_the_clipped_mean_with_the_half_normal_taken_off():
    rng = np.random.default_rng(4)
    noise = np.minimum(rng.normal(0, 2.0, (400, 500)), 0.0)  # the top at 20 + 500 DN cuts the upper half
    full = Stack(520 + noise, 0.0, 2)
    value, error = emva.well(full, stack(20.0, 4.0, frames=10**9), GAIN, 0.0, 7.0, 0.0)
    # mean of the half normal within 4 standard errors, in electrons: false-alarm rate 6.3e-5
    assert abs(value - (1000 + 7)) < 4 * 2 * 0.58 / np.sqrt(200_000) / 0.5
    assert error == pytest.approx(value * 0.002, rel=1e-9)


def test_dark_current_leaves_hot_pixels_out_and_tells_them():
    rng = np.random.default_rng(5)
    slopes = rng.normal(10.0, 0.5, (300, 300))
    slopes[::10, ::10] += 100.0
    (current, current_error), (share, share_error), (hot, hot_error) = emva.dark_current(slopes, GAIN)
    assert abs(current - 20.0) < 4 * current_error  # three times 6.3e-5
    assert (share, share_error) == (0.01, pytest.approx(np.sqrt(0.01 * 0.99 / 90_000)))
    assert abs(hot - 200.0) < 4 * hot_error
    assert emva.dark_current(rng.normal(0, 1, (50, 50)), GAIN)[1:] == ((0.0, 0.0), (0.0, 0.0))


# Frames on a bench and their statistics: closed forms on frames that are known, then moments of drawn ones.


def frames_of(*frames):
    """Give the next frame at each call, whatever the light."""
    rest = iter(frames)
    return lambda light_e, exposure_s: np.asarray(next(rest), dtype=np.uint16)


def test_a_pair_s_temporal_variance_is_half_the_mean_squared_difference_less_that_of_the_means():
    first, second = [[10, 12], [14, 20]], [[12, 12], [10, 22]]
    series = take_transfer(frames_of(first, second), [5.0], 0.01)
    # differences -2, 0, 4, -2: mean 0, mean square 6
    assert (series.light_e[0], series.mean_dn[0], series.variance_dn2[0]) == (5.0, 14.0, 3.0)
    series = take_transfer(frames_of(first, np.add(second, 6)), [5.0], 0.01)
    assert series.variance_dn2[0] == pytest.approx(3.0, rel=1e-14)  # a change of all pixels alike is no noise


def test_a_stack_s_variances_are_those_of_its_frames():
    rng = np.random.default_rng(1)
    frames = rng.integers(0, 4000, (5, 7, 9))
    stack = take_stack(frames_of(*frames), 3.0, 0.01, 5)
    np.testing.assert_allclose(stack.mean_dn, frames.mean(axis=0), rtol=1e-15)
    assert stack.variance_dn2 == pytest.approx(frames.var(axis=0, ddof=1).mean(), rel=1e-12)
    assert stack.spatial_dn2 == pytest.approx(frames.mean(axis=0).var() - stack.variance_dn2 / 5, rel=1e-12)


def test_column_variance_is_what_a_column_s_pixels_share():
    rng = np.random.default_rng(3)
    columns = rng.normal(0, 3, 4000)
    value, error = column_variance(columns + rng.normal(0, 20, (50, 4000)))
    # column means have the variance 9 + 400 / 50; within 4 standard errors: 6.3e-5
    assert error == pytest.approx(17 * np.sqrt(2 / 4000), rel=0.1)
    assert abs(value - 9) < 4 * error
    value, error = column_variance(rng.normal(0, 20, (50, 4000)))
    assert abs(value) < 4 * error
    assert column_variance(np.broadcast_to([1.0, 2.0, 3.0], (2, 3)))[0] == 1.0


def test_dark_slopes_are_each_pixel_s_least_squares_line():
    rate = np.array([[0.0, 10.0], [250.0, 1000.0]])
    seen = []

    def expose(light_e, exposure_s):
        seen.append(light_e)
        return np.rint(100 + rate * exposure_s).astype(np.uint16)

    np.testing.assert_allclose(dark_slopes(expose, (0.0, 1.0, 2.0, 5.0)), rate, atol=1e-12)
    assert set(seen) == {0.0}
    assert len(seen) == 8


def test_hot_pixels_stand_out_of_the_noise_and_none_of_the_others_does():
    rng = np.random.default_rng(4)
    slopes = rng.normal(50, 2, (300, 300))
    hot = np.zeros((300, 300), dtype=bool)
    hot[::10, ::10] = True
    slopes[hot] += 30
    # a false alarm needs 6 standard deviations (9e-5 over all pixels), a miss 9
    np.testing.assert_array_equal(hot_pixels(slopes), hot)
    assert not hot_pixels(np.zeros((4, 4))).any()


@loop("exact", [False, True])
def test_a_bench_of_another_seed_holds_another_chip(exact):
    still = replace(preset("low_noise").pixel, read_noise_e=0.0, dsnu_e=20.0)  # in the dark the pattern alone is read
    sensor = replace(preset("low_noise"), pixel=still)
    one, same, other = (light_bench(sensor, (16, 16), seed, exact) for seed in (1, 1, 2))
    np.testing.assert_array_equal(one(0.0, 0.01), same(0.0, 0.01))
    np.testing.assert_array_equal(one(0.0, 0.01), one(0.0, 0.01))
    assert np.mean(one(0.0, 0.01) == other(0.0, 0.01)) < 0.2


@pytest.mark.parametrize("gain", [1e-4, 1e-3, 1.0])
def test_linearity_is_told_of_a_camera_of_few_digital_numbers(gain):
    """A line of a tenth of a DN to a thousand; where it isn't above 0 nothing is told."""
    light = np.linspace(50.0, 1000.0, 20)
    share, mean = emva.linearity(Transfer(light, 20 + gain * light, light), 20.0, 1000.0)
    assert share[light <= 950.0] == pytest.approx(0.0, abs=1e-9)
    assert mean == pytest.approx(0.0, abs=1e-9)
    share, _ = emva.linearity(Transfer(light, 20 - gain * light, light), 20.0, 1000.0)
    assert np.isnan(share).all()
