"""The page of published reports: each figure beyond the limit has a reason, and the page in docs is of these."""

from pathlib import Path

import pytest
from real_cameras import REASONS, REPORTS, page, rows_of

from sensor.cameras.emva_report import EmvaReport, read_report

PAGE = Path(__file__).parents[2] / "docs" / "real_cameras.md"
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


def test_the_page_in_docs_holds_every_report_and_its_numbers():
    text = PAGE.read_text("utf-8")
    for report in FOUND.values():
        assert f"## {report.camera}\n\n{report.source}. Date: {report.date}." in text
        section = text.split(f"## {report.camera}\n", 1)[1].split("\n## ", 1)[0]
        for symbol in set(report.figures) - {"pixel_pitch_um", "eta", "lambda_nm"}:
            assert f"| {symbol} " in section, symbol


def test_a_figure_beyond_the_limit_without_a_reason_stops_the_page():
    figures = {"sigma_d": 3.0, "mu_e_sat": 5000.0, "DR_dB": 20.0}
    with pytest.raises(KeyError):
        page({"x": EmvaReport("X", "M", "s", "d", 12, None, figures)})
