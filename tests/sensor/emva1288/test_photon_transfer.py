"""Frames on a bench and their statistics: closed forms on frames that are known, then moments of drawn ones."""

from dataclasses import replace

import numpy as np
import pytest
from loop import loop

from sensor.emva1288.photon_transfer import bench, column_variance, dark_slopes, hot_pixels, take_stack, take_transfer
from sensor.presets import preset


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
    one, same, other = (bench(sensor, (16, 16), seed, exact) for seed in (1, 1, 2))
    np.testing.assert_array_equal(one(0.0, 0.01), same(0.0, 0.01))
    np.testing.assert_array_equal(one(0.0, 0.01), one(0.0, 0.01))
    assert np.mean(one(0.0, 0.01) == other(0.0, 0.01)) < 0.2
