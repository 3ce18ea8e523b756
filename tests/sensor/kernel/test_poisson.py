"""The Dr.Jit Poisson draws against the exact law, with evenly spread random numbers in place of random ones.

Where the numbers are even, the share of draws up to a count is the distribution function to one step of them: the
errors measured here are errors, not chance.
"""

import numpy as np
import pytest
from loop import loop
from scipy import stats
from scipy.special import ndtri

from rodcone.jit import arrays, backend, dr
from sensor.kernel.poisson import EXACT_BELOW_E, LARGEST_ERROR, TABLE_ERROR, alias_table, poisson

pytestmark = pytest.mark.skipif(backend() == "numpy", reason="Dr.Jit has neither LLVM nor CUDA here")

STRATA = 1 << 21


def draws(mean_e, normal=None, words=None):
    jit = arrays()
    count = next(len(x) for x in (normal, *(words or ())) if x is not None and np.ndim(x))
    normal = np.zeros(count) if normal is None else normal
    first, second = (
        jit.UInt(np.ascontiguousarray(np.broadcast_to(word, count), dtype=np.uint32)) for word in words or (0, 0)
    )
    made = poisson(
        dr.full(jit.Float, mean_e, count), jit.Float(normal.astype(np.float32)), (first, second), table_on_device()
    )
    return made.numpy().astype(np.int64)


def table_on_device():
    return arrays().UInt(alias_table().ravel())


def distribution_error(counts, mean_e):
    share = np.cumsum(np.bincount(counts)) / counts.size
    return np.abs(share - stats.poisson.cdf(np.arange(share.size), mean_e)).max()


def even_normals():
    return ndtri((np.arange(STRATA) + 0.5) / STRATA)


def test_the_tables_hold_the_exact_probabilities_of_every_whole_mean():
    table = alias_table()
    assert table.shape == (30, 128)
    worst = 0.0
    for mean, row in enumerate(table):
        own, other = (row >> 7) / 2.0**25, row & 127
        probability = (own + np.bincount(other, 1 - own, minlength=128)) / 128
        worst = max(worst, np.abs(np.cumsum(probability) - stats.poisson.cdf(np.arange(128), mean)).max())
    assert 1e-11 < worst < TABLE_ERROR  # 25-bit shares are neither perfect nor worse than stated


@loop("mean_e", [1.0, 7.0, 12.0, 29.0])
def test_draws_of_whole_means_are_the_table_s(mean_e):
    words = (np.arange(STRATA, dtype=np.uint64) << 11).astype(np.uint32)
    # the second word is the fraction's: with none, it draws 0 whatever it is. Each of 128 bins ends within one step.
    assert distribution_error(draws(mean_e, words=(words, 123456789)), mean_e) < 128 / STRATA


@loop("mean_e", [1e-30, 1e-3, 0.05, 0.3, 0.999])
def test_draws_of_means_under_one_invert_the_distribution_function(mean_e):
    words = (np.arange(STRATA, dtype=np.uint64) << 11).astype(np.uint32)
    assert distribution_error(draws(mean_e, words=(0, words)), np.float32(mean_e)) < 1.5 / STRATA


def test_a_photon_in_ten_thousand_million_pixels_is_drawn_where_the_words_say():
    # chance 1e-10 of one: words of (0, w) stand for a uniform number of about w / 2^64
    low = (np.array([0.5e-10, 0.99e-10, 1.01e-10, 2e-10]) * 2.0**64).astype(np.uint64)
    made = draws(1e-10, words=((low & 0xFFFFFFFF).astype(np.uint32), (low >> 32).astype(np.uint32)))
    # the upper word's last bit isn't used: steps of 2^-31 would round all four to 0 and draw a photon each
    np.testing.assert_array_equal(made[[0, 3]], [1, 0])


@loop("mean_e", [30.0, 31.7, 50.0, 100.0, 1e3, 3e4, 1e6])
def test_from_30_electrons_on_the_largest_error_is_the_stated_one_at_the_foot(mean_e):
    error = distribution_error(draws(mean_e, normal=even_normals()), np.float32(mean_e))
    print(mean_e, error)
    assert error < min(LARGEST_ERROR, LARGEST_ERROR * (30.0 / mean_e) ** 1.5 + 3e-6)
    if mean_e == 30.0:
        assert error > 0.8 * LARGEST_ERROR  # what is stated isn't slack
    assert LARGEST_ERROR < 1e-5


def test_draws_on_both_sides_of_the_seam_are_whole_and_never_negative():
    for mean_e in (np.nextafter(np.float32(EXACT_BELOW_E), np.float32(0)), EXACT_BELOW_E):
        made = draws(mean_e, normal=np.array([-6.7, 0.0, 6.7]), words=(np.array([0, 2**31, 2**32 - 1]), 2**32 - 1))
        assert made.min() >= 0
        assert made.max() < 90
