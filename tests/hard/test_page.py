"""The page of hard cases: its tables, and that the one in the docs is of this catalogue."""

import re
from csv import DictReader

import numpy as np
from hard.case import Margin
from hard.catalogue import CASES, INVARIANTS, LIMITS, OWN, Result
from hard.page import PAGE, catalogue, limits, page, precision, summary
from hard.precision import Found, Stage, Worst


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


def test_the_page_in_the_docs_has_the_text_that_is_written_today():
    stage = Stage("a stage", "u e", {"level_e": (1.0, 2.0)}, measure=lambda parameters: found)
    found = Found(1e-3, 2.0, Margin(1.0, 4.0, "e⁻"))
    worst = Worst(stage, {"level_e": 1.5, "seed": 3.0}, found, found.bound, 64)
    made = page([result()], [worst])
    assert "is 0.0005 of the noise, in stage *a stage*" in made
    assert precision([worst])[1] == ["a stage", "level_e 1.5", "0.001", "2", "0.0005", "u e", "0.25"]
    assert prose(made) == prose(PAGE.read_text(encoding="utf-8"))


def prose(text):
    """All but the tables and the counts."""
    return [line for line in text.splitlines() if not re.match(r"\||\d+ cases|.*The largest error is", line)]
