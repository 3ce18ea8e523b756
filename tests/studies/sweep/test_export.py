"""A ledger as a table: CSV that no spreadsheet runs."""

import csv
from dataclasses import replace
from io import StringIO
from pathlib import Path

from sweep_sample import ROW

from studies.sweep.database import COLUMNS, add, open_results, want
from studies.sweep.export import read_rows, to_csv


def test_a_text_that_a_spreadsheet_would_run_is_quoted() -> None:
    for start in ["=", "+", "-", "@", "\t", "\r"]:
        table = list(csv.reader(StringIO(to_csv([replace(ROW, scene=f"{start}cmd|' /C calc'!A0")]), newline="")))
        assert table[1][COLUMNS.index("scene")] == f"'{start}cmd|' /C calc'!A0", start


def test_csv_holds_every_value_and_numbers_as_they_are() -> None:
    header, values = csv.reader(StringIO(to_csv([ROW]), newline=""))
    assert tuple(header) == COLUMNS
    found = dict(zip(header, values, strict=True))
    assert (found["scene"], found["ssim"], found["snr_db"]) == ("desk, lit.exr", "-0.25", "-3.5")
    assert float(found["exposure_s"]) == ROW.exposure_s  # every digit
    assert (found["illuminance_lux"], found["psnr_db"]) == ("", "inf")


def test_rows_come_from_the_ledger_in_the_studys_order_or_all(tmp_path: Path) -> None:
    with open_results(tmp_path) as base:
        for key in ("a", "b", "c"):
            add(base, replace(ROW, key=key))
        want(base, ["c", "a"])
    assert [row.key for row in read_rows(tmp_path)] == ["c", "a"]
    assert read_rows(tmp_path, everything=True) == [replace(ROW, key=key) for key in "abc"]
