"""The report's cells: in order, means and intervals over seeds."""

import json
from dataclasses import replace
from typing import Any

import pytest
import report_sample as SAMPLE

from studies.pages.report_data import ReportCell
from studies.pages.report_sweep import SCATTERED, over_seeds
from studies.pages.report_text import exposure_name
from studies.sweep.row import Row


def cell_of(*rows: Row | None) -> ReportCell:
    return over_seeds(rows, "low_noise", 1, "interleaved", (8.0, None))


def made(seed: int = 0, **values: Any) -> Row:
    return SAMPLE.sample_row(1, 0, "interleaved", seed, **values)


def test_two_seeds_give_mean_and_student_s_interval() -> None:
    cell = cell_of(made(psnr_db=20.0, ssim=1.0, picture="a"), made(1, psnr_db=21.0, ssim=1.0, picture="b"))
    # n = 2: s / sqrt(2) = 0.5, and t of one degree of freedom at 97.5 % is tan(0.475 pi) = 12.7062 (the Cauchy law).
    assert cell.figures["psnr_db"] == 20.5
    assert cell.intervals["psnr_db"] == pytest.approx((20.5 - 6.3531, 20.5 + 6.3531), abs=1e-4)
    assert cell.intervals["ssim"] == (1.0, 1.0)
    assert cell.picture == "a"


def test_figure_unknown_for_a_seed_is_unknown() -> None:
    cell = cell_of(made(snr_db=None), made(1, psnr_db=float("inf")))
    assert cell.figures["snr_db"] is None
    assert cell.figures["psnr_db"] is None
    assert set(cell.intervals).isdisjoint({"snr_db", "psnr_db"})


def test_a_seed_that_is_not_made_yet_leaves_every_figure_unknown() -> None:
    for rows in ((made(), None), (None, made(1)), (None, None)):
        cell = cell_of(*rows)
        assert set(cell.figures.values()) == {None}
        assert cell.substitution is None
        assert cell.picture == (rows[0].picture if rows[0] else None)


def test_decisions_of_all_seeds_count() -> None:
    balances = [{"R": "gray world", "G": "gray world", "B": "calibrated" if seed == 2 else "gray world"}
                for seed in range(4)]  # fmt: skip
    rows = [made(seed, substitution=int(seed < 3), balance=json.dumps(balances[seed])) for seed in range(4)]
    cell = cell_of(*rows)
    assert cell.substitution == 0.75
    assert cell.balance == {"R": "gray world", "G": "gray world", "B": "calibrated"}


def test_one_seed_keeps_its_numbers() -> None:
    row = replace(made(), psnr_db=float("inf"))
    cell = cell_of(row)
    assert cell.figures == {key: getattr(row, key) for key in SCATTERED}
    assert cell.intervals == {}
    assert cell.first is row


def test_an_exposure_is_written_as_prose_does() -> None:
    assert exposure_name("auto") == "automatic"
    assert exposure_name("10ms") == "10\N{NO-BREAK SPACE}ms"
