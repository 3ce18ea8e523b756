"""The page of hard cases: its tables, and that the one in the docs is of this catalogue."""

import re
from csv import DictReader

import numpy as np
from hard.case import Margin
from hard.catalogue import CASES, INVARIANTS, LIMITS, OWN, Result
from hard.page import PAGE, catalogue, limits, summary


def result(**margins):
    case = next(case for case in CASES if case.name == "largest_number")
    return Result(case, {**dict.fromkeys((*INVARIANTS, OWN)), **margins})


def test_the_tables_tell_shares_limits_and_counts():
    results = [result(linear=Margin(2e3, 1.0, "e⁻"), bounded=Margin(0.123, 1.0, "e⁻"))]
    head, row = catalogue(results)
    shares = dict(zip(head, row, strict=True))
    assert [shares[name] for name in ("bounded", "monotone", "linear", "kept")] == ["0.12", "", "2e+03", "no"]
    assert summary(results) == "1 cases, 2 invariants measured: 1 kept, 1 not; 0 cases keep all of theirs."
    (row,) = limits(results).splitlines()[2:]
    assert row == f"| `largest_number` | linear | 2e+03 e⁻ | 1 | {LIMITS['largest_number', 'linear']} |"
    assert "inf" in catalogue([result(linear=Margin(np.inf, 1.0, "e⁻"))])[1]


def test_the_page_in_the_docs_is_of_this_catalogue_and_its_limits():
    text = PAGE.read_text(encoding="utf-8")
    with (PAGE.parent / "results" / "hard_cases.csv").open(encoding="utf-8", newline="") as file:
        setups = {row["case"]: row["how it is set up"] for row in DictReader(file)}
    assert setups == {case.name: case.setup for case in CASES}
    part = text.partition("## Limits")[2].partition("##")[0]
    assert sorted(re.findall(r"^\| `([\w.]+)`", part, re.MULTILINE)) == sorted(name for name, _ in LIMITS)
    assert all(reason in part for reason in LIMITS.values())
