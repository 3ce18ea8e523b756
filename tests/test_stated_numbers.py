"""The table of stated numbers fits the tests and the planted faults; no number of a row is without a line."""

import ast
import csv
import sys
from dataclasses import fields
from pathlib import Path

from render.transport import Transport
from studies.speed.points import Times
from studies.sweep.row import Row

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "tests" / "faults"))

from plant_faults import FAULTS  # noqa: E402

with (ROOT / "docs" / "results" / "stated_numbers.csv").open(encoding="utf-8") as table:
    STATED = list(csv.DictReader(table))
TOLD = {name for stated in STATED for name in stated["told by"].split(", ")}
# Light and its errors: physics, which other tests compare with closed forms and other programs.
LIGHT = {"light", "coverage", "seen", "scene_means", "meter", "groups", "wavelength_nm", "width_nm", "shared"}
LIGHT |= {"integrator", "denoised"}
# What a cell is, what it is made from, and the figures of its picture.
ASKED = {"key", "scene", "spectrum", "level", "exposure", "sensor", "white_balance", "frames", "processor", "seed"} | {
    "lens"
}
ASKED |= {"budget_share"}
FIGURES = {
    "psnr_db", "ssim", "delta_e_median", "delta_e_p95", "s_cielab_median", "s_cielab_p95", "flip_mean", "pu21_psnr_db",
    "mtf50_cy_per_px", "chart_delta_e_mean", "patch_snr_db", "snr_db", "substitution", "balance", "mean_electrons",
    "balance_delta_e", "illuminance_lux",
}  # fmt: skip
# Names of files and places; the picture's is its digest, which is checked where it is read.
NAMES = {"picture", "truth", "finished", "host", "machine", "worker"}


def test_no_number_about_the_work_is_left_out() -> None:
    made = {f"Transport.{field.name}" for field in fields(Transport) if field.name not in LIGHT}
    made |= {f"row.{field.name}" for field in fields(Row) if field.name not in ASKED | FIGURES | NAMES}
    made |= {f"bench {field.name}" for field in fields(Times)}
    assert made - TOLD == set()


def test_a_number_has_its_test_and_a_fault_that_this_test_is_asked_to_notice() -> None:
    for stated in STATED:
        file, function = stated["test"].split("::")
        tree = ast.parse((ROOT / file).read_text("utf-8"))
        functions = {node.name for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)}
        assert function in functions, stated["number"]
        (fault,) = [fault for fault in FAULTS if fault.name == stated["planted fault"]]
        assert file in fault.tests, stated["number"]
