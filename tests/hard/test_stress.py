"""The catalogue of hard cases: a part of it here, all of it in `make verify`."""

import pytest

from rodcone.jit import backend
from studies.stress import CASES, INVARIANTS, LIMITS, OWN, choose, run_case, run_cases, unexpected

needs_kernel = pytest.mark.skipif(backend() == "numpy", reason="without Dr.Jit a case takes minutes")

# One or two of each kind, on the shared render alone and without a long search.
QUICK = (
    "starlight",
    "neighbours_1e8",
    "all_black_quiet",
    "all_saturated",
    "half_saturated",
    "well_1e6_8bit",
    "prnu_50",
    "frame_5x7",
)


@needs_kernel
@pytest.mark.parametrize("name", QUICK)
def test_a_quick_hard_case_keeps_its_invariants_but_for_its_known_limits(name):
    assert unexpected(run_cases(choose([name]))) == []


@needs_kernel
@pytest.mark.slow
@pytest.mark.timeout(1800)
def test_every_hard_case_keeps_its_invariants_and_the_list_of_limits_is_exact():
    results = run_cases(CASES)
    assert unexpected(results) == []
    broken = {(result.case.name, name) for result in results for name in result.broken}
    assert broken == set(LIMITS)


def test_the_catalogue_names_each_of_at_least_60_cases_once():
    names = [case.name for case in CASES]
    assert len(set(names)) == len(names) >= 60
    assert all(case.setup and bool(case.own) == bool(case.promise) for case in CASES)
    assert {name for name, _ in LIMITS} <= set(names)
    assert {name for _, name in LIMITS} <= {*INVARIANTS, OWN}
    assert set(QUICK) <= set(names)


@needs_kernel
def test_every_invariant_says_something_about_an_ordinary_scene():
    margins = run_case(choose(["starlight"])[0]).margins
    assert [name for name, margin in margins.items() if margin is None] == [OWN]
