"""`rodcone demo` end to end, small: its files, its numbers, and what it refuses before it renders."""

import json
import re
from itertools import product
from pathlib import Path
from typing import Any

import pytest
from command_line import call, check_refusals
from refusal import refusal

from scenes.levels import DEMO_LEVELS
from studies.study.levels import parse_level
from studies.study.study_file import DEMO_STUDY, read_study
from studies.sweep.export import read_rows

SMALL = ["--size", "48", "--spp", "16", "--sensor", "low_noise", "--level", "0.5cd/m2", "--level", "500lux"]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What a small demo leaves."""
    out = tmp_path_factory.mktemp("demo") / "new" / "folder"
    assert call(["demo", *SMALL, "-o", out])[0] == 0
    return out


def results(folder: Path) -> dict[str, Any]:
    found: dict[str, Any] = json.loads((folder / "results.json").read_text("utf-8"))
    return found


def test_seven_levels_run_from_moonlight_to_daylight() -> None:
    """In order, as tests/scenes/test_catalogue.py has them."""
    levels = [parse_level(level) for level in read_study(DEMO_STUDY).levels]
    assert levels == [(level.luminance_cd_m2, "cd/m2") for level in DEMO_LEVELS]


@pytest.mark.thorough
def test_every_condition_has_a_row_of_the_ledger_and_a_picture_and_states_its_render(folder: Path) -> None:
    found = results(folder)
    rows = found["rows"]
    cameras = ("interleaved", "bayer", "ple_rgbw", "ple_bayer")
    assert {(row["level"], row["processor"], row["white_balance"], row["seed"]) for row in rows} == set(
        product(("0.5cd/m2", "500lux"), cameras, ("as-shot", "gray-world"), (0, 1, 2))
    )
    assert len(rows) == 48
    assert all((folder / "pictures" / row["picture"]).is_file() for row in rows)
    for told, row in zip(rows, read_rows(folder), strict=True):
        assert [told[name] == getattr(row, name) for name in ("key", "psnr_db", "mc_share", "exposure_s")] == [True] * 4
        assert told["mc_share"] > 0
        assert 0 < told["render"]["relative_mc_error"] < 1
    assert found["study"]["render"]["spp"] == 16
    assert {"renders", "captures", "develop interleaved", "metrics", "other"} <= set(found["stages"])


@pytest.mark.thorough
def test_the_report_names_a_level_and_its_source_and_a_noisy_render_is_told(tmp_path: Path) -> None:
    small = ["--size", "16", "--spp", "2", "--level", "moonlight", "--level", "sunlit day"]
    code, _, told = call(["demo", *small, "-o", tmp_path])
    assert code == 0
    assert re.search(r"^rodcone: still_life, sunlit day, low_noise, \w+: the render's noise has", told, re.M)
    assert re.search(r"; \d+ samples a pixel would do$", told, re.M)
    page = (tmp_path / "report.html").read_text("utf-8")
    assert "moonlight" in page
    assert "10 photons per µm² and second" in page
    assert results(tmp_path)["rows"][0]["luminance_cd_m2"] == 0.036


def test_levels_are_read_with_their_unit_and_bad_ones_refused() -> None:
    for text, value, unit in (
        ("25cd/m2", 25.0, "cd/m2"),
        (" 0.5 lux ", 0.5, "lux"),
        ("1e-3 cd/m²", 1e-3, "cd/m2"),
        (".25lux", 0.25, "lux"),
        ("5lx", 5.0, "lux"),
        ("5 cd/m^2", 5.0, "cd/m2"),
    ):
        assert parse_level(text) == (value, unit)
    for text in ("25nits", "25", "bright", "-3lux", "0cd/m2", "1e99lux", ""):
        refusal(parse_level, text, match=r"^level.*\Z")


def test_bad_input_is_refused_before_the_render(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("studies.sweep.prepare.make_transport", lambda *args, **more: pytest.fail("rendered"))
    (tmp_path / "a.exr").write_text("never read", "utf-8")
    rows = (
        ("--scene still_live", "scene: 'still_live' is unknown; allowed: "),
        ("--scene missing.exr", "no such file"),
        ("--scene a.exr --level 500lux", "reference plane"),
        ("--sensor lownoise", "sensor preset: 'lownoise' is unknown ... did you mean 'low_noise'?"),
        ("--level 500candles", "candles"),
        ("--level 1lux --level 1lux", "levels: ['1lux', '1lux'] is not allowed"),
        ("--light D66", "D66"),
        ("--scene furnace --light A", "furnace: option"),
        ("--size 4", "render.size: 4 is outside"),
        ("--longest-exposure=0s", "longest_exposure_s: 0.0 is outside"),
        ("--seed=-1", "render.seed: -1 is outside"),
        ("--processor intrleaved", "processors: 'intrleaved' is unknown"),
        ("--spp 0", "render.spp: 0 is outside"),
        ("--max-seconds 0", "render.max_seconds: 0.0 is outside"),
    )
    check_refusals("demo -o out", rows, tmp_path)
