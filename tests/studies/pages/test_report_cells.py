"""The report's cells: means and intervals over seeds."""

import json
from math import isnan
from typing import Any

import pytest
import report_sample as SAMPLE

from studies.pages import report_text as text
from studies.pages.report_data import ReportCell
from studies.sweep.row import Row


def cell_of(*rows: Row | None) -> ReportCell:
    return ReportCell(1, "interleaved", 8.0, None, rows, None)


def made(seed: int = 0, **values: Any) -> Row:
    return SAMPLE.sample_row(1, 0, "interleaved", seed, **values)


def test_two_seeds_give_mean_and_student_s_interval() -> None:
    cell = cell_of(made(psnr_db=20.0, ssim=1.0), made(1, psnr_db=21.0, ssim=1.0))
    # n = 2: s / sqrt(2) = 0.5, and t of one degree of freedom at 97.5 % is tan(0.475 pi) = 12.7062 (the Cauchy law).
    assert (cell.mean("psnr_db"), cell.half("psnr_db")) == pytest.approx((20.5, 6.3531), abs=1e-4)
    assert (cell.mean("ssim"), cell.half("ssim")) == (1.0, 0.0)
    assert text.figure_text(cell, "psnr_db", 1, "dB").replace("\N{NO-BREAK SPACE}", " ") == "20.5 ± 6.4 dB"


def test_a_figure_that_is_unknown_for_a_seed_is_unknown() -> None:
    for rows in [
        (made(psnr_db=None), made(1)),
        (made(), made(1, psnr_db=float("inf"))),
        (made(), None),
        (None, made(1)),
        (None, None),
    ]:
        cell = cell_of(*rows)
        assert isnan(cell.mean("psnr_db")), rows
        assert isnan(cell.half("psnr_db")), rows
        assert text.figure_text(cell, "psnr_db", 1, "dB") == "—", rows


def test_decisions_of_all_seeds_count() -> None:
    balances = [{"R": "gray world", "G": "gray world", "B": "calibrated" if seed == 2 else "gray world"}
                for seed in range(4)]  # fmt: skip
    rows = [made(seed, substitution=int(seed < 3), balance=json.dumps(balances[seed])) for seed in range(4)]
    assert cell_of(*rows).substitution == 0.75
    assert cell_of(*rows).balance == {"R": "gray world", "G": "gray world", "B": "calibrated"}
    assert cell_of(rows[0], None).substitution is None
