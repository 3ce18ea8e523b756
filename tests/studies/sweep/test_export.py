"""A ledger as a table: CSV that no spreadsheet runs."""

import csv
from dataclasses import replace
from io import StringIO

from sweep_sample import ROW

from studies.sweep.database import COLUMNS
from studies.sweep.export import to_csv


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
