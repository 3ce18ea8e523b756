"""Arrays that reach Dr.Jit aligned and unchanged, and whole division that is exact."""

from itertools import product

import numpy as np
import pytest

from rodcone.device_arrays import divide, divisor, upload
from rodcone.jit import arrays, backend

pytestmark = pytest.mark.skipif(backend() == "numpy", reason="Dr.Jit has no backend here")


def test_values_and_type_are_kept_wherever_the_memory_begins() -> None:
    for dtype, offset in product((np.float32, np.float64, np.uint32, np.int32), (0, 1, 7)):
        memory = np.arange(200).astype(dtype)
        for values in (memory[offset : offset + 60].reshape(6, 10), memory[offset::2][:60].reshape(6, 10).T):
            device = upload(values)
            assert device.numpy().dtype == dtype
            assert np.array_equal(device.numpy(), values.ravel()), (dtype, offset)


def test_division_is_exact_at_every_multiple() -> None:
    """Errors show first beside the multiples, and at the largest numbers."""
    most = 2**31 - 1
    for number in (1, 2, 3, 7, 641, 4093, 65537, most):
        rng = np.random.default_rng(number)
        multiples = rng.integers(0, most // number, 20_000, endpoint=True) * number
        values = np.unique(np.clip([multiples - 1, multiples, multiples + 1, [most] * multiples.size], 0, most))
        quotient, rest = divide(arrays().UInt(values.astype(np.uint32)), divisor(number))
        assert np.array_equal(quotient.numpy(), values // number), number
        assert np.array_equal(rest.numpy(), values % number), number
