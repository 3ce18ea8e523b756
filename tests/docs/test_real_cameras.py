"""The page of published reports: each figure beyond the limit has a reason, and the page in docs is of these."""

import csv

import pytest
from page_parts import RESULTS, fill, unstamped
from real_cameras import PAGE, REASONS, REPORTS, rows_of

from sensor.cameras.emva_report import read_report

FOUND = {path.stem: read_report(path) for path in sorted(REPORTS.glob("*.toml"))}


@pytest.mark.thorough
def test_what_was_put_in_comes_back_and_what_was_not_is_near_or_has_a_reason():
    beyond = set()
    for name, report in FOUND.items():
        for row in rows_of(report):
            if row.is_input and row.off is not None:
                assert abs(row.off) < 0.03, (name, row)  # saturation lies on a grid of 2 %
            if not row.within:
                beyond.add((name, row.symbol))
    assert beyond == set(REASONS)


@pytest.mark.thorough
def test_the_two_whole_reports_are_recovered_in_figures_that_are_no_input():
    for name in ("framos_imx900_lcg", "framos_imx900_hcg"):
        rows = {row.symbol: row for row in rows_of(FOUND[name], seed=1)}
        for symbol in ("mu_e_sat", "mu_e_min", "SNR_max_dB", "DR_dB"):
            assert not rows[symbol].is_input
            assert rows[symbol].off is not None
            assert rows[symbol].within


def test_the_page_in_docs_holds_every_report_and_the_table_its_numbers():
    text = PAGE.read_text("utf-8")
    rows = list(csv.DictReader(unstamped((RESULTS / "real_cameras.csv").read_text("utf-8")).splitlines()))
    for report in FOUND.values():
        assert f"| {report.camera} |" in text
        assert report.source
        assert report.date
        symbols = {row["figure"].partition(" ")[0] for row in rows if row["camera"] == report.camera}
        assert set(report.figures) - {"pixel_pitch_um", "eta", "lambda_nm"} <= symbols


def test_a_part_is_filled_between_its_marks_alone_and_one_that_is_missing_is_told():
    text = "before\n\n<!-- a -->\nold\n<!-- end -->\n\n<!-- b -->\n<!-- end -->\nafter\n"
    filled = fill(text, {"a": "new \\1"})
    assert filled == "before\n\n<!-- a -->\n\nnew \\1\n\n<!-- end -->\n\n<!-- b -->\n<!-- end -->\nafter\n"
    with pytest.raises(KeyError, match="c"):
        fill(text, {"c": ""})
