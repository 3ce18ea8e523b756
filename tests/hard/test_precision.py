"""Single against double precision: the search finds what is planted, and every stage stays in its bound."""

from math import log10

import numpy as np
import pytest
from hard.case import Margin
from hard.precision import Found, Stage, beside_noise, search
from hard.stages import STAGES

from rodcone.jit import backend

needs_kernel = pytest.mark.skipif(backend() == "numpy", reason="NumPy's forms work in double precision throughout")


def test_the_search_climbs_to_a_peak_that_random_parameters_miss():
    def measure(parameters):
        far = (log10(parameters["x"]) - 2.3) ** 2 + (log10(parameters["y"]) + 1.1) ** 2
        return Found(1.0 / (1e-3 + far), 1.0, Margin(0.0, 1.0, "e⁻"))

    stage = Stage("peak", "none", {"x": (1e-3, 1e6), "y": (1e-3, 1e6)}, measure)
    worst = search(stage, np.random.default_rng(3), 30, 300)
    alone = search(stage, np.random.default_rng(3), 330, 0)
    assert worst.tried == alone.tried == 330
    assert log10(worst.parameters["x"]) == pytest.approx(2.3, abs=0.2)
    assert log10(worst.parameters["y"]) == pytest.approx(-1.1, abs=0.2)
    assert worst.found.error_e > alone.found.error_e


def test_error_beside_noise_and_beside_its_bound_may_be_worst_in_different_pixels():
    found = beside_noise([3.0, -4.0], [1.0, 2.0], [10.0, 8.0])
    assert (found.error_e, found.noise_e, found.share_of_noise) == (3.0, 1.0, 3.0)
    assert found.bound == Margin(4.0, 8.0, "e⁻")


@pytest.mark.sample(3)
@needs_kernel
@pytest.mark.parametrize("stage", STAGES, ids=lambda stage: stage.name)
def test_a_short_search_finds_nothing_beyond_the_bound_that_the_roundings_give(stage):
    worst = search(stage, np.random.default_rng(11), 4, 2)
    assert worst.bound.kept, worst
    assert np.isfinite(worst.found.share_of_noise)
    assert worst.found.noise_e > 0


@pytest.mark.slow
@pytest.mark.timeout(900)
@needs_kernel
@pytest.mark.parametrize("stage", STAGES, ids=lambda stage: stage.name)
def test_a_long_search_finds_nothing_beyond_the_bound_and_comes_near_it(stage):
    worst = search(stage, np.random.default_rng([12, STAGES.index(stage)]), 60, 60)
    assert worst.bound.kept, worst
    assert worst.bound.share > 0.1  # a bound that nothing comes near would hide a fault ten times as large
