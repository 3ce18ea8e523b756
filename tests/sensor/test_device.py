"""One chip: its fixed patterns."""

import numpy as np
from loop import loop

from sensor.chip import PixelConfig
from sensor.config import LensConfig, SensorConfig
from sensor.device import draw_device


def camera(prnu=0.02, dsnu_e=5.0, **terms):
    return SensorConfig(PixelConfig(2.2, 0.9, 15_000.0, 3.0, dsnu_e, prnu, **terms), LensConfig(2.8))


def test_patterns_have_the_stated_mean_and_spread():
    device = draw_device(camera(), (512, 512), np.random.default_rng(1))
    n = 512 * 512
    # mean and standard deviation of two normal patterns within 4 standard errors: false-alarm rate 2.5e-4
    for pattern, mean, sigma in ((device.photo_response, 1.0, 0.02), (device.dark_offset_e, 0.0, 5.0)):
        assert abs(pattern.mean() - mean) < 4 * sigma / np.sqrt(n)
        assert abs(pattern.std() - sigma) < 4 * sigma / np.sqrt(2 * n)


def test_zero_switches_each_pattern_off_exactly_and_leaves_the_other():
    both = draw_device(camera(), (16, 16), np.random.default_rng(2))
    even = draw_device(camera(prnu=0.0), (16, 16), np.random.default_rng(2))
    np.testing.assert_array_equal(even.photo_response, 1.0)
    np.testing.assert_array_equal(even.dark_offset_e, both.dark_offset_e)
    assert (both.column_gain, both.hot) == (None, None)
    level = draw_device(camera(dsnu_e=0.0), (16, 16), np.random.default_rng(2))
    np.testing.assert_array_equal(level.dark_offset_e, 0.0)
    np.testing.assert_array_equal(level.photo_response, both.photo_response)


def test_a_pixel_never_answers_with_less_than_nothing():
    device = draw_device(camera(prnu=1.0), (64, 64), np.random.default_rng(3))
    assert device.photo_response.min() == 0.0


def test_one_seed_makes_one_chip_and_two_seeds_make_two():
    first, again, other = (draw_device(camera(), (256, 256), np.random.default_rng(seed)) for seed in (4, 4, 5))
    np.testing.assert_array_equal(first.photo_response, again.photo_response)
    np.testing.assert_array_equal(first.dark_offset_e, again.dark_offset_e)
    # four correlations of n pixels within 4.5 standard errors: false-alarm rate 3e-5
    for one, two in (
        (first.photo_response, other.photo_response),
        (first.dark_offset_e, other.dark_offset_e),
        (first.photo_response, first.dark_offset_e),
        (first.photo_response, other.dark_offset_e),
    ):
        assert abs(np.corrcoef(one.ravel(), two.ravel())[0, 1]) < 4.5 / 256


# Columns and hot pixels

REAL = {"column_gain_spread": 0.01, "column_offset_e": 3.0, "hot_pixel_share": 0.02}


def chip(shape=(512, 512), **terms):
    return draw_device(camera(**{"prnu": 0.0, "dsnu_e": 0.0, **terms}), shape, np.random.default_rng(1))


def test_column_patterns_are_one_number_a_column_with_the_stated_spread():
    device = chip((3, 40_000), column_gain_spread=0.01, column_offset_e=3.0)
    assert device.column_gain.shape == (40_000,)
    np.testing.assert_array_equal(device.dark_offset_e, np.broadcast_to(device.dark_offset_e[0], (3, 40_000)))
    # means and standard deviations within 4 standard errors: false-alarm rate 2.5e-4
    for pattern, mean, sigma in ((device.column_gain, 1.0, 0.01), (device.dark_offset_e[0], 0.0, 3.0)):
        assert abs(pattern.mean() - mean) < 4 * sigma / np.sqrt(40_000)
        assert abs(pattern.std() - sigma) < 4 * sigma / np.sqrt(80_000)
    assert abs(np.corrcoef(device.column_gain, device.dark_offset_e[0])[0, 1]) < 4 / 200


def test_a_wild_column_gain_is_no_negative_amplifier():
    assert chip((2, 4096), column_gain_spread=1.0).column_gain.min() == 0.0


@loop("share", [0.001, 0.02, 0.7])
def test_the_stated_share_of_pixels_is_hot(share):
    hot = chip(hot_pixel_share=share).hot
    assert hot.dtype == np.bool_
    # binomial, within 4 standard errors: false-alarm rate 6.3e-5 each
    assert abs(hot.mean() - share) < 4 * np.sqrt(share * (1 - share) / hot.size)


def test_all_pixels_can_be_hot_and_more_hot_pixels_hold_the_fewer():
    assert chip(hot_pixel_share=1.0).hot.all()
    few, many = (chip(hot_pixel_share=share).hot for share in (0.01, 0.05))
    assert np.all(many[few])


def test_hot_pixels_lie_apart_from_the_other_patterns():
    device = chip(prnu=0.02, dsnu_e=5.0, hot_pixel_share=0.3, column_offset_e=3.0)
    for pattern in (device.photo_response, device.dark_offset_e):
        assert abs(np.corrcoef(device.hot.ravel(), pattern.ravel())[0, 1]) < 4.5 / 512  # twice 7e-6


def test_a_smaller_chip_of_the_same_seed_is_the_larger_one_s_corner():
    large, small = (chip(shape, prnu=0.02, dsnu_e=5.0, **REAL) for shape in ((20, 30), (6, 11)))
    assert small.shape == (6, 11)
    np.testing.assert_array_equal(small.photo_response, large.photo_response[:6, :11])
    np.testing.assert_array_equal(small.column_gain, large.column_gain[:11])
    np.testing.assert_array_equal(small.hot, large.hot[:6, :11])
    np.testing.assert_array_equal(small.dark_offset_e, large.dark_offset_e[:6, :11])
