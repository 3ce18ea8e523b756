"""Patches of one light that are estimated in parts: each is in one part, and one part is the last."""

import numpy as np
import pytest

from isp.ple.estimate import TOGETHER, LitPatches
from isp.ple.tables import Sampling


@pytest.mark.parametrize("count", [1, TOGETHER - 1, TOGETHER, TOGETHER + 1, 3 * TOGETHER - 1])
def test_each_patch_is_in_one_part_in_its_order(count: int) -> None:
    index = np.random.default_rng(1).permutation(count)
    sampling = Sampling(8, (0, 5), (1.0, 1.0, 1.0, 1.0), (1.0, 1.0, 1.0, 1.0), 0.0)
    parts = list(LitPatches(sampling, -3, index).parts())
    assert np.array_equal(np.concatenate([part.index for part in parts]), index)
    assert max(len(part.index) for part in parts) <= TOGETHER
    assert [part.last for part in parts] == [False] * (len(parts) - 1) + [True]
    assert all((part.sampling, part.step) == (sampling, -3) for part in parts)
