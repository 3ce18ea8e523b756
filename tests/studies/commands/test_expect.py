"""The command `rodcone expect`: table, CSV, plot, JSON, and each wrong option in one line."""

import csv
import json
from pathlib import Path

import numpy as np
import pytest
from command_line import call, check_refusals

from sensor.presets import low_noise
from studies.design.expect import expect

CELLS = ["low_noise", "--mosaic", "bayer", "--mosaic", "RG/BW", "--level", "moonlight", "--level", "25cd/m2"]


def test_the_table_has_the_first_camera_and_gains_over_it() -> None:
    """436 lux on surfaces that give back 18 % are 436 x 0.18 / pi = 25.0 cd/m2."""
    code, out, _ = call(["expect", *CELLS, "--level", "436lux"])
    assert code == 0
    rows = [expect(low_noise(tile), [0.036, 25.0, 436 * 0.18 / np.pi]) for tile in ("bayer", "rgbw")]
    bayer, rgbw = ([row.psnr_db for row in of] for of in rows)
    head, first, second, *colours = out.splitlines()
    assert head.split()[-3:] == ["moonlight", "25cd/m2", "436lux"]
    assert first.split() == ["low_noise", "bayer", *(f"{db:.2f}" for db in bayer)]
    assert second.split() == ["low_noise", "RG/BW", *(f"{a - b:+.2f}" for a, b in zip(rgbw, bayer, strict=True))]
    assert colours[0].startswith("error of a*, b*")
    assert [line.split()[2:] for line in colours[1:]] == [[f"{row.colour:.2f}" for row in of] for of in rows]


@pytest.mark.thorough
def test_csv_json_and_plot_hold_the_same(tmp_path: Path) -> None:
    for ending in (".csv", ".svg"):
        _, out, _ = call(["expect", *CELLS, "--json", "-o", tmp_path / f"gain{ending}"])
    printed = json.loads(out.splitlines()[-1])
    rows = list(csv.DictReader((tmp_path / "gain.csv").read_text("utf-8").splitlines()))
    assert [row["camera"] for row in rows] == ["low_noise bayer"] * 2 + ["low_noise RG/BW"] * 2
    assert [float(row["psnr_db"]) for row in rows] == [x["psnr_db"] for one in printed.values() for x in one]
    assert "low_noise RG/BW" in (tmp_path / "gain.svg").read_text("utf-8")


def test_a_wrong_option_is_refused(tmp_path: Path) -> None:
    rows = (
        ("--mosaic bayr", "did you mean 'bayer'"),
        ("--mosaic RG/B", "differ in length"),
        ("--mosaic RGRGRG/GBGBGB", "isn't 1, 2 or 4 pixels high and wide"),
        ("--over street:moon", "over: 'street:moon' is not a range of levels"),
        ("--over 'sunlit day:moonlight'", "the darker first"),
        ("--level 25", "has no unit"),
        ("--light D66", "did you mean 'D65'"),
        ("--prior draw", "did you mean 'drawn'"),
        ("--exposure autoo", "did you mean 'auto'"),
        ("-o gain.pdf", "has another ending; allowed: .csv, .svg"),
        ("-o gain.svg", "plots gains over the first camera, and there is one"),
    )
    check_refusals("expect low_noise", rows, tmp_path)
