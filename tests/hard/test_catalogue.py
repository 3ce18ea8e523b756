"""Every hard case: a few of each kind quickly, the rest slow."""

import pytest
from hard.case import Margin
from hard.catalogue import CASES, INVARIANTS, LIMITS, OWN, Result, run_case, unexpected

from rodcone.jit import backend

needs_kernel = pytest.mark.skipif(backend() == "numpy", reason="without Dr.Jit a case takes minutes")

# One of each kind, on the shared render alone and without a long search; and more for `make test-all`.
QUICK = ("all_saturated", "well_1e6_8bit")
THOROUGH = ("frame_5x7", "starlight", "neighbours_1e8", "all_black_quiet", "half_saturated", "prnu_50")
BY_NAME = {case.name: case for case in CASES}


def marks(name):
    return () if name in QUICK else pytest.mark.thorough if name in THOROUGH else pytest.mark.slow


@needs_kernel
@pytest.mark.parametrize("case", [pytest.param(case, id=case.name, marks=marks(case.name)) for case in CASES])
def test_a_hard_case_keeps_its_invariants_but_for_exactly_its_known_limits(case):
    assert unexpected(run_case(case)) == []


def test_the_catalogue_names_each_of_at_least_60_cases_once():
    assert len(BY_NAME) == len(CASES) >= 60
    assert all(case.setup and bool(case.own) == bool(case.promise) for case in CASES)
    assert {name for name, _ in LIMITS} <= set(BY_NAME)
    assert {name for _, name in LIMITS} <= {*INVARIANTS, OWN}
    assert {*QUICK, *THOROUGH} <= set(BY_NAME)


@pytest.mark.thorough
@needs_kernel
def test_every_invariant_says_something_about_an_ordinary_scene():
    margins = run_case(BY_NAME["starlight"]).margins
    assert [name for name, margin in margins.items() if margin is None] == [OWN]


def result(name, **margins):
    return Result(BY_NAME[name], {**dict.fromkeys((*INVARIANTS, OWN)), **margins})


def test_what_breaks_without_a_listed_limit_is_told_and_so_is_a_limit_that_is_kept():
    broken, kept = Margin(2.0, 1.0, "e⁻"), Margin(0.5, 1.0, "e⁻")
    assert unexpected(result("starlight", linear=kept)) == []
    (fault,) = unexpected(result("starlight", linear=broken))
    assert fault.startswith("starlight, linear: 2 e⁻ where 1 is allowed")
    assert ("largest_number", "linear") in LIMITS
    assert unexpected(result("largest_number", linear=broken)) == []
    (fault,) = unexpected(result("largest_number", linear=kept))
    assert fault == "largest_number, linear: kept, though listed as a limit; take it off the list"
    assert len(unexpected(result("largest_number"))) == 1  # not measured at all
