"""Every hard case: a few of each kind quickly, the rest slow."""

import re
from csv import DictReader

import numpy as np
import pytest
from builders import raw_image
from hard.case import Margin, worse, worst_of
from hard.catalogue import CASES, INVARIANTS, LIMITS, OWN, Result, run_case, unexpected
from hard.invariants_raw import allowed_errors, bias
from hard.invariants_symmetry import mirrored
from hard.page import PAGE, catalogue, limits, summary
from loop import loop
from page_parts import unstamped

from rodcone.jit import backend
from sensor.cfa import BAYER, MOSAICS, RGBW, channel_map

needs_kernel = pytest.mark.skipif(backend() == "numpy", reason="without Dr.Jit a case takes minutes")

# One of each kind, on the shared render alone and without a long search; and more for `make test-all`.
QUICK = ("all_saturated", "well_1e6_8bit")
THOROUGH = ("frame_5x7", "starlight", "neighbours_1e8", "all_black_quiet", "half_saturated", "prnu_50")
BY_NAME = {case.name: case for case in CASES}


def marks(name):
    return () if name in QUICK else pytest.mark.thorough if name in THOROUGH else pytest.mark.slow


@needs_kernel
@pytest.mark.filterwarnings("ignore:crosstalk. 0.25 isn't undone")
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


# Margins, transformed raw images and bias: closed forms.


def exposure(shape, tile=RGBW, seed=0):
    dn = np.random.default_rng(seed).integers(0, 900, shape)
    return raw_image(dn, tile, black_dn=10.0, white_dn=1000.0, dsnu_e=0.0, defects=np.array([[0, 1], [2, 0]]))


def test_the_margin_is_taken_where_error_over_allowed_is_largest():
    margin = worst_of([1.0, -3.0, 0.5], [1.0, 4.0, 0.25], "e⁻")
    assert (margin.worst, margin.allowed, margin.share, margin.kept) == (0.5, 0.25, 2.0, False)
    assert worst_of([0.0, 0.0], 0.0, "e⁻").share == 0.0
    assert worst_of([[1e-9]], 0.0, "e⁻").share == np.inf
    assert not worst_of([np.nan, 0.0], 1.0, "e⁻").kept
    assert not worst_of([np.inf], np.inf, "e⁻").kept
    assert Margin(1.0, 1.0, "e⁻").kept
    assert worse(Margin(2.0, 4.0, "a"), Margin(1.0, 1.0, "b")).unit == "b"


@loop("tile", [RGBW, BAYER, MOSAICS["rgbw_4x4"], ("RGB",)])
@loop("shape", [(8, 12), (5, 7), (4, 9)])
@loop("axis", [0, 1])
def test_a_mirrored_frame_holds_each_sample_under_its_own_letter_and_each_defect_at_its_place(tile, shape, axis):
    raw = exposure(shape, tile)
    turned = mirrored(raw, axis)
    assert np.array_equal(turned.dn, np.flip(raw.dn, axis))
    assert np.array_equal(channel_map(turned.cfa, shape), np.flip(channel_map(raw.cfa, shape), axis))
    here, there = np.zeros(shape, bool), np.zeros(shape, bool)
    here[tuple(raw.defects.T)] = there[tuple(turned.defects.T)] = True
    assert np.array_equal(there, np.flip(here, axis))


def test_bias_is_a_mean_in_its_own_standard_errors():
    errors = np.array([1.0, 3.0])  # mean 2, standard error 1
    assert bias(errors, 1.0) == Margin(2.0, allowed_errors(2), "standard errors")
    assert allowed_errors(12) == pytest.approx(9.70, abs=0.01)  # Student's t of 11 degrees of freedom at 5e-7
    assert bias(np.full(4, 1e-3), 1.0).unit == "e⁻"
    assert not bias(np.full(4, 1e-3), 1.0).kept


# The page of hard cases: its tables, and that the one in the docs is of this catalogue.


def test_the_tables_tell_shares_limits_and_counts():
    results = [result("largest_number", linear=Margin(2e3, 1.0, "e⁻"), bounded=Margin(0.123, 1.0, "e⁻"))]
    head, row = catalogue(results)
    shares = dict(zip(head, row, strict=True))
    assert [shares[name] for name in ("bounded", "monotone", "linear", "kept")] == ["0.12", "", "2e+03", "no"]
    assert summary(results) == "1 cases, 2 invariants measured: 1 kept, 1 not; 0 cases keep all of theirs."
    (row,) = limits(results).splitlines()[2:]
    assert row == f"| `largest_number` | linear | 2e+03 e⁻ | 1 | {LIMITS['largest_number', 'linear']} |"
    assert "inf" in catalogue([result("largest_number", linear=Margin(np.inf, 1.0, "e⁻"))])[1]


def test_the_page_in_the_docs_is_of_this_catalogue_and_its_limits():
    text = PAGE.read_text(encoding="utf-8")
    table = unstamped((PAGE.parent / "results" / "hard_cases.csv").read_text("utf-8"))
    setups = {row["case"]: row["how it is set up"] for row in DictReader(table.splitlines())}
    assert setups == {case.name: case.setup for case in CASES}
    part = text.partition("## Limits")[2].partition("##")[0]
    assert sorted(re.findall(r"^\| `([\w.]+)`", part, re.MULTILINE)) == sorted(name for name, _ in LIMITS)
    assert all(reason in part for reason in LIMITS.values())
