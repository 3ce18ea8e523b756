"""One chip: its fixed patterns."""

import numpy as np
import pytest
from loop import loop
from scipy import stats

from sensor.config import LensConfig, SensorConfig
from sensor.device import draw_device
from sensor.pixel import PixelConfig
from sensor.random import NoiseTerm, draw_key, normals, philox, poisson


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


# Random numbers by coordinates: known answers, distributions, independence of tiling.
#
# Statistical tests run with fixed keys. With fresh ones each comparison would fail by chance with the rate stated.


KEY = 0x0123456789ABCDEF
ALL_ONES = 0xFFFFFFFF


@loop(
    ("counter", "key_words", "answer"),  # known answers of Random123 for philox4x32 with 10 rounds
    [
        ((0, 0, 0, 0), (0, 0), (0x6627E8D5, 0xE169C58D, 0xBC57AC4C, 0x9B00DBD8)),
        ((ALL_ONES,) * 4, (ALL_ONES, ALL_ONES), (0x408F276D, 0x41C83B0E, 0xA20BC7C6, 0x6D5451FD)),
        (
            (0x243F6A88, 0x85A308D3, 0x13198A2E, 0x03707344),
            (0xA4093822, 0x299F31D0),
            (0xD16CFE09, 0x94FDCCEB, 0x5001E420, 0x24126EA1),
        ),
    ],
)
def test_philox_gives_the_known_answers(counter, key_words, answer):
    words = philox(tuple(np.array([word], np.uint64) for word in counter), key_words[0] | key_words[1] << 32)
    assert tuple(int(word[0]) for word in words) == answer


def test_normals_are_box_muller_of_philox_at_column_row_and_term():
    draws = normals(KEY, NoiseTerm.READ, (3, 5))
    for row, column in np.ndindex(3, 5):
        words = philox(tuple(np.array([word], np.uint64) for word in (column, row, int(NoiseTerm.READ), 0)), KEY)
        a, b, c, d = (int(word[0]) for word in words)
        first, second = (a << 32 | b) / 2**64, (c << 32 | d) / 2**64
        expected = np.sqrt(-2 * np.log(1 - first)) * np.cos(2 * np.pi * second)
        assert draws[row, column] == pytest.approx(expected, rel=1e-9, abs=1e-9)


@loop("shape", [(1, 1), (2, 3), (17, 9), (40, 2)])
def test_a_crop_s_draws_are_the_full_frame_s(shape):
    crop = np.s_[: shape[0], : shape[1]]
    np.testing.assert_array_equal(normals(KEY, NoiseTerm.DSNU, shape), normals(KEY, NoiseTerm.DSNU, (40, 40))[crop])
    mean = np.random.default_rng(0).uniform(0, 100, (40, 40))
    np.testing.assert_array_equal(poisson(KEY, NoiseTerm.SHOT, mean[crop]), poisson(KEY, NoiseTerm.SHOT, mean)[crop])


def test_a_row_s_poisson_draws_do_not_depend_on_the_other_rows():
    mean = np.full((6, 50), 7.0)
    changed = mean.copy()
    changed[[0, 1, 3, 5]] = 1e5
    first, second = poisson(KEY, NoiseTerm.SHOT, mean), poisson(KEY, NoiseTerm.SHOT, changed)
    np.testing.assert_array_equal(first[[2, 4]], second[[2, 4]])
    assert not np.array_equal(first[2], first[4])


@loop("mean", [0.3, 1.0, 9.9, 10.1, 24.0, 26.0, 1000.0])
def test_poisson_draws_follow_the_exact_probabilities(mean):
    draws = poisson(KEY, NoiseTerm.SHOT, np.full((256, 512), mean)).ravel()
    low, high = int(stats.poisson.ppf(1e-4, mean)), int(stats.poisson.isf(1e-4, mean))
    inner = np.bincount(np.clip(draws, low, high), minlength=high + 1)[low:]
    share = stats.poisson.pmf(np.arange(low, high + 1), mean)
    share[0], share[-1] = stats.poisson.cdf(low, mean), stats.poisson.sf(high - 1, mean)
    # chi-squared over all counts with the tails merged; false-alarm rate 1e-4 each, 7e-4 together
    assert stats.chisquare(inner, share * draws.size).pvalue > 1e-4


@loop("key", [5, 2**53, 2**63, 2**64 - 4096])
def test_every_bit_of_the_key_counts(key):
    mean = np.full((8, 64), 1e6)  # equal draws are rare: 500 pixels agree by chance with a probability under 1e-1000
    assert not np.array_equal(poisson(key, NoiseTerm.SHOT, mean), poisson(key + 1, NoiseTerm.SHOT, mean))
    assert not np.array_equal(normals(key, NoiseTerm.READ, (8, 64)), normals(key + 1, NoiseTerm.READ, (8, 64)))


def test_one_draw_from_the_generator_gives_a_key_of_64_bits():
    rng, twin = np.random.default_rng(3), np.random.default_rng(3)
    keys = [draw_key(rng) for _ in range(200)]
    assert keys == [int(twin.integers(0, 2**64, dtype=np.uint64)) for _ in range(200)]
    assert len(set(keys)) == 200
    assert any(key >= 2**63 for key in keys)
