"""An error asked for is reached: 200 runs of the stop rule, all its looks counted, against a long reference."""

from functools import cache

import numpy as np
import pytest

from render.engine import render
from scenes.catalog import load

RUNS, BEYOND, MOST_BEYOND = 200, 1.1, 0.05
SIZE = (32, 32)
BANDS = {"wavelength_nm": np.array([450.0, 550.0, 650.0]), "width_nm": 60.0}
REFERENCE_SPP = {"cornell_box": 32768, "still_life": 16384, "siemens_star": 32768}
MEDIAN_OF_NORMAL = 0.6745  # of the absolute value, in standard deviations


@cache
def reference(name):
    return render(load(name), SIZE, spp=REFERENCE_SPP[name], seed=10**6, **BANDS).relight().values.astype(np.float64)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "goal"),
    [
        ("cornell_box", 0.11),
        ("cornell_box", 0.06),
        ("still_life", 0.04),
        ("still_life", 0.025),
        ("siemens_star", 0.035),
        ("siemens_star", 0.015),
    ],
)
def test_the_error_asked_for_is_exceeded_by_a_tenth_in_few_runs(name, goal):
    """The true error: the median of what pixels and bands are off, over their light, as a standard deviation.

    Where noise lies at edges alone, as in `siemens_star`, pooling gives their neighbours some: more is told than is.
    """
    scene, true = load(name), reference(name)
    lit = true > 0
    errors, told = [], []
    for seed in range(RUNS):
        made = render(scene, SIZE, noise=goal, max_spp=16384, seed=seed, **BANDS)
        assert made.stopped_by == "noise"
        off = np.abs(made.relight().values - true)[lit] / true[lit]
        errors.append(float(np.median(off)) / MEDIAN_OF_NORMAL)
        told.append(made.relative_mc_error)
    beyond = float(np.mean(np.array(errors) > BEYOND * goal))
    print(f"{name} {goal}: beyond {beyond:.3f}, true over told {np.mean(errors) / np.mean(told):.3f}, ", end="")
    print(f"true over goal {np.mean(errors) / goal:.3f} ± {np.std(errors) / goal:.3f}")
    assert beyond <= MOST_BEYOND
    assert np.mean(errors) < 1.05 * np.mean(told)
