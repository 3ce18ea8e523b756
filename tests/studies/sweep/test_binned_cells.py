"""Cells of a camera that bins: half as large, against a truth of half the size; never beside one that doesn't."""

from pathlib import Path

import numpy as np
import pytest
import sweep_sample as SAMPLE

from rodcone.errors import InputError
from sensor.presets import preset_file
from studies.pages.report_pictures import opened
from studies.sweep.run_cell import run_cell


def quad_file(folder: Path, binning: str) -> str:
    path = folder / f"{binning}.toml"
    lines = preset_file("low_noise").read_text("utf-8").splitlines()
    kept = [line for line in lines if not line.startswith(("cfa", "bits"))]
    path.write_text("\n".join([f'binning = "{binning}"', 'cfa = "quad_bayer"', "bits = 12", *kept]), "utf-8")
    return str(path)


@pytest.mark.parametrize("binning", ["charge", "digital"])
def test_a_binned_cell_is_measured_at_its_own_size(binning: str, tmp_path: Path) -> None:
    study = SAMPLE.small_study(tmp_path, sensors=(quad_file(tmp_path, binning),), processors=("bayer",))
    cell = SAMPLE.made_cells(tmp_path, study)[0]
    whole, row = np.load(cell.truth), run_cell(cell)
    sizes = [opened((cell.pictures / name).read_bytes()).shape[:2] for name in (row.picture, row.truth)]
    assert sizes == [(whole.shape[0] // 2, whole.shape[1] // 2)] * 2
    assert row.psnr_db > 15.0  # one at a wrong scale, a factor of four, has under 10


def test_a_study_holds_cameras_that_bin_or_none(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"sensors: .* one bins, so that .*; give each a study of its own") as found:
        SAMPLE.small_study(tmp_path, sensors=("low_noise", quad_file(tmp_path, "charge")))
    assert "\n" not in str(found.value)


def test_a_picture_of_odd_size_is_refused_for_a_camera_that_bins(tmp_path: Path) -> None:
    SAMPLE.picture(tmp_path / "scene.exr", (17, 20))
    study = SAMPLE.small_study(tmp_path, sensors=(quad_file(tmp_path, "charge"),))
    with pytest.raises(InputError, match=r"size: 17 x 20 pixels with binning"):
        SAMPLE.made_cells(tmp_path, study)
