"""Random numbers by coordinates: known answers, distributions, independence of tiling.

Statistical tests run with fixed keys. With fresh ones each comparison would fail by chance with the rate stated.
"""

import numpy as np
import pytest
from loop import loop
from scipy import stats

from sensor.random import NoiseTerm, draw_key, normals, philox, poisson

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
