"""Philox and the normal draws in Dr.Jit against the NumPy form, and the sum over bands in closed form."""

import numpy as np
import pytest
from loop import loop
from scipy import stats

from rodcone.device_arrays import divisor, tile_cell
from rodcone.jit import arrays, backend, dr
from sensor.kernel.kernel import normal_pair, philox, weighted_sum
from sensor.random import philox as philox_numpy

pytestmark = pytest.mark.skipif(backend() == "numpy", reason="Dr.Jit has neither LLVM nor CUDA here")


def words(values):
    return arrays().UInt(np.ascontiguousarray(values, dtype=np.uint32))


@loop("key", [0, 0x0123456789ABCDEF, 2**64 - 1, 2**32, 2**31])
def test_philox_is_the_numpy_form_s_word_for_word(key):
    counter = np.random.default_rng(key % 1000).integers(0, 2**32, (4, 257), dtype=np.uint64)
    counter[:, :2] = [[0, 2**32 - 1]] * 4
    made = philox(tuple(words(c) for c in counter), (words([key & 0xFFFFFFFF]), words([key >> 32])))
    for mine, reference in zip(made, philox_numpy(tuple(counter), key), strict=True):
        np.testing.assert_array_equal(mine.numpy(), reference.astype(np.uint32))


def test_a_pair_of_normals_is_box_muller_of_31_bits():
    first, second = np.random.default_rng(1).integers(0, 2**32, (2, 4096), dtype=np.uint64)
    first[:3] = [0, 2**32 - 1, 2**31]
    sine, cosine = (x.numpy() for x in normal_pair(words(first), words(second)))
    radius = np.sqrt(-2 * np.log(((first >> np.uint64(1)) + 0.5) / 2.0**31))
    angle = 2 * np.pi * (second >> np.uint64(1)) / 2.0**31
    # an angle near 2 pi has steps of 5e-7; the smallest radius, 2.2e-5, comes out as 0
    np.testing.assert_allclose(sine, radius * np.sin(angle), rtol=0, atol=2.5e-5)
    np.testing.assert_allclose(cosine, radius * np.cos(angle), rtol=0, atol=2.5e-5)
    assert radius[0] == pytest.approx(np.sqrt(64 * np.log(2)), rel=1e-12)  # the furthest draw, 6.66


def test_both_normals_of_a_pair_are_standard_and_independent():
    rng = np.random.default_rng(2)
    pair = [x.numpy() for x in normal_pair(*(words(rng.integers(0, 2**32, 1 << 18, dtype=np.uint64)) for _ in "ab"))]
    for draw in pair:
        assert stats.kstest(draw, "norm").pvalue > 1e-4  # false-alarm rate 1e-4 each
    for one, other in ((pair[0], pair[1]), (pair[0] ** 2, pair[1] ** 2)):
        assert abs(np.corrcoef(one, other)[0, 1]) < 4.5 / np.sqrt(1 << 18)


@loop(("width", "first"), [(1, 0), (7, 0), (7, 21), (4099, 4099 * 100_000)])
def test_each_pixel_takes_the_weights_of_its_own_cell(width, first):
    jit, count, tile_width = arrays(), 4200, 3
    cells = np.array([0, 1, 2, 1, 3, 0], dtype=np.uint32)  # two rows of three
    planes = np.random.default_rng(3).random((5, count), dtype=np.float32)
    weights = np.random.default_rng(4).random((4, 5))
    opaque = [[dr.opaque(jit.Float, float(w)) for w in row] for row in weights]
    divisors = [divisor(n) for n in (2, tile_width, width)]
    pixel = dr.arange(jit.UInt, count) + dr.opaque(jit.UInt, first)
    own = dr.gather(jit.UInt, words(cells), tile_cell(pixel, divisors[2], (divisors[0], divisors[1])))
    made = weighted_sum([jit.Float(plane) for plane in planes], opaque, own).numpy()
    row, column = np.divmod(first + np.arange(count), width)
    channel = cells[(row % 2) * tile_width + column % tile_width]
    np.testing.assert_array_equal(own.numpy(), channel)
    np.testing.assert_allclose(made, np.einsum("bn,nb->n", planes.astype(np.float64), weights[channel]), rtol=1e-6)
