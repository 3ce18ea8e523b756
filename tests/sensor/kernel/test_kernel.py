"""Philox and the normal draws in Dr.Jit against the NumPy form, and the sum over bands in closed form."""

import numpy as np
import pytest
from loop import loop

from rodcone.jit import arrays, backend
from sensor.kernel.kernel import normal_pair, philox
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
