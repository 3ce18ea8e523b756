"""Margins, transformed raw images, and the page: closed forms."""

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from isp.bilinear import bilinear
from rodcone.errors import InputError
from rodcone.jit import backend
from sensor.cfa import letter_map
from sensor.raw import RawImage
from studies.commands.cli import main
from studies.stress import CASES, LIMITS, Result, choose, unexpected
from studies.stress_case import Margin, worse, worst_of
from studies.stress_page import as_json, catalogue, limits, page, summary
from studies.stress_pictures import cut, mirrored
from studies.stress_raw import allowed_errors, bias

PAGE = Path(__file__).resolve().parents[2] / "docs" / "hard_cases.md"


def raw_image(shape, tile=("RG", "BW"), seed=0):
    dn = np.random.default_rng(seed).integers(0, 900, shape).astype(np.uint16)
    return RawImage(dn, tile, 10.0, 1000.0, 1.0, 1.0, 0.0, 0.0, 0.01, defects=np.array([[0, 1], [2, 0]]))


def test_the_margin_is_taken_where_error_over_allowed_is_largest():
    margin = worst_of([1.0, -3.0, 0.5], [1.0, 4.0, 0.25], "e⁻")
    assert (margin.worst, margin.allowed, margin.share, margin.kept) == (0.5, 0.25, 2.0, False)
    assert worst_of([0.0, 0.0], 0.0, "e⁻").share == 0.0
    assert worst_of([[1e-9]], 0.0, "e⁻").share == np.inf
    assert not worst_of([np.nan, 0.0], 1.0, "e⁻").kept
    assert not worst_of([np.inf], np.inf, "e⁻").kept
    assert Margin(1.0, 1.0, "e⁻").kept
    assert worse(Margin(2.0, 4.0, "a"), Margin(1.0, 1.0, "b")).unit == "b"


@pytest.mark.parametrize("tile", [("RG", "BW"), ("RG", "GB"), ("WGWR", "GWRW", "WBWG", "BWGW"), ("RGB",)])
@pytest.mark.parametrize("shape", [(8, 12), (5, 7), (4, 9)])
@pytest.mark.parametrize("axis", [0, 1])
def test_a_mirrored_frame_holds_each_sample_under_its_own_letter_and_each_defect_at_its_place(tile, shape, axis):
    raw = raw_image(shape, tile)
    turned = mirrored(raw, axis)
    assert np.array_equal(turned.dn, np.flip(raw.dn, axis))
    assert np.array_equal(letter_map(turned.cfa, shape), np.flip(letter_map(raw.cfa, shape), axis))
    here, there = np.zeros(shape, bool), np.zeros(shape, bool)
    here[tuple(raw.defects.T)] = there[tuple(turned.defects.T)] = True
    assert np.array_equal(there, np.flip(here, axis))


def test_a_cut_frame_begins_at_the_next_phase_of_the_mosaic():
    raw = raw_image((6, 7))
    part = cut(raw)
    assert np.array_equal(letter_map(part.cfa, (5, 6)), letter_map(raw.cfa, (6, 7))[1:, 1:])
    assert np.array_equal(part.dn, raw.dn[1:, 1:])
    assert part.defects is None
    bayer = replace(raw, cfa=("RG", "GB"), defects=None)
    order = [("R", "G", "B").index(letter) for letter in ("R", "G", "B")]
    assert bilinear(cut(bayer))[2:-2, 2:-2] == pytest.approx(bilinear(bayer)[3:-2, 3:-2][..., order], rel=1e-12)


def test_bias_is_a_mean_in_its_own_standard_errors():
    errors = np.array([1.0, 3.0])  # mean 2, standard error 1
    assert bias(errors, 1.0) == Margin(2.0, allowed_errors(2), "standard errors")
    assert allowed_errors(12) == pytest.approx(9.70, abs=0.01)  # Student's t of 11 degrees of freedom at 5e-7
    assert bias(np.full(4, 1e-3), 1.0).unit == "e⁻"
    assert not bias(np.full(4, 1e-3), 1.0).kept


def result(name, **margins):
    case = next(case for case in CASES if case.name == name)
    return Result(case, {**dict.fromkeys(("bounded", "linear", "its own")), **margins})


def test_what_breaks_without_a_listed_limit_is_told_and_so_is_a_limit_that_is_kept():
    broken, kept = Margin(2.0, 1.0, "e⁻"), Margin(0.5, 1.0, "e⁻")
    assert unexpected([result("starlight", linear=kept)]) == []
    (fault,) = unexpected([result("starlight", linear=broken)])
    assert fault.startswith("case starlight, linear: 2 e⁻ where 1 is allowed")
    assert ("largest_number", "linear") in LIMITS
    assert unexpected([result("largest_number", linear=broken)]) == []
    (fault,) = unexpected([result("largest_number", linear=kept)])
    assert fault == "case largest_number, linear: kept, though listed as a limit; take it off the list"
    assert len(unexpected([result("largest_number")])) == 1  # not measured at all


def full(**margins):
    names = ("bounded", "monotone", "linear", "reciprocal", "shifted", "raw unbiased", "pictures unbiased")
    return Result(
        next(case for case in CASES if case.name == "largest_number"),
        {**dict.fromkeys((*names, "equivariant", "its own")), **margins},
    )


def test_the_table_tells_shares_limits_and_counts():
    results = [full(linear=Margin(2e3, 1.0, "e⁻"), bounded=Margin(0.123, 1.0, "e⁻"))]
    (row,) = catalogue(results).splitlines()[2:]
    assert "| 0.12 | – | **2e+03** | – |" in row
    assert row.endswith("| no |")
    assert summary(results) == "1 cases, 2 invariants measured: 1 kept, 1 not; 0 cases keep all of theirs."
    assert LIMITS["largest_number", "linear"] in limits(results)
    assert limits([full()]) == "None."
    infinite = as_json([full(linear=Margin(np.inf, 1.0, "e⁻"))])
    assert json.loads(json.dumps(infinite, allow_nan=False))["cases"][0]["invariants"]["linear"]["share"] is None


def test_the_page_in_the_docs_is_the_catalogue_of_today_with_its_limits():
    text = PAGE.read_text(encoding="utf-8")
    told = dict(re.findall(r"^\| `([\w.]+)` \| ([^|]+?) \| [\d*–]", text.partition("## All cases")[2], re.MULTILINE))
    assert told == {case.name: case.setup for case in CASES}
    part = text.partition("## Limits")[2].partition("##")[0]
    assert sorted(re.findall(r"^\| `([\w.]+)`", part, re.MULTILINE)) == sorted(name for name, _ in LIMITS)
    assert all(reason in part for reason in LIMITS.values())
    assert page([full()]).startswith("# Hard cases")


def test_an_unknown_case_is_one_line_of_advice():
    with pytest.raises(InputError, match=r"case: 'starlite' is unknown.*did you mean 'starlight'"):
        choose(["starlite"])


@pytest.mark.skipif(backend() == "numpy", reason="without Dr.Jit a case takes minutes")
def test_the_command_prints_the_table_writes_the_page_and_fails_for_what_is_not_kept(tmp_path, capsys, monkeypatch):
    with pytest.raises(SystemExit) as ended:
        main(["stress", "--case", "well_1e6_8bit", "-o", str(tmp_path / "a")])
    assert ended.value.code == 0
    assert "| `well_1e6_8bit` |" in capsys.readouterr().out
    assert "| `well_1e6_8bit` |" in (tmp_path / "a" / "hard_cases.md").read_text(encoding="utf-8")
    monkeypatch.setattr("studies.stress.LIMITS", {})
    with pytest.raises(SystemExit) as ended:
        main(["stress", "--case", "well_1e6_8bit", "-o", str(tmp_path / "b"), "--json"])
    assert ended.value.code == 1
    captured = capsys.readouterr()
    assert not json.loads(captured.out)["cases"][0]["kept"]
    assert "rodcone: case well_1e6_8bit, raw unbiased:" in captured.err
