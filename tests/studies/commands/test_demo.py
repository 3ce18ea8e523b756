"""The main job end to end, small; levels as written by a user; nothing half-written."""

import json
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from rodcone.errors import InputError
from scenes.levels import DEMO_LEVELS
from studies.commands.demo import Demo, Outcome, run, write
from studies.study.levels import parse_level

SMALL = Demo(size=48, spp=16, sensors=("low_noise",), levels=("0.5cd/m2", "500lux"))


@pytest.fixture(scope="module")
def outcome() -> Outcome:
    return run(SMALL)


def test_seven_levels_run_from_moonlight_to_daylight() -> None:
    luminances = [level.luminance_cd_m2 for level in DEMO_LEVELS]
    assert len(luminances) == 7
    assert luminances == sorted(luminances)
    assert luminances[0] == 0.036
    assert luminances[-1] == pytest.approx(100_000 * 0.18 / np.pi)


def test_every_condition_has_a_cell_and_a_picture(outcome: Outcome) -> None:
    cells = outcome.results["cells"]
    assert {(cell["level"], cell["camera"]) for cell in cells} == {
        (level, camera) for level in (0, 1) for camera in ("interleaved", "bayer")
    }
    assert set(outcome.pictures) == {cell["picture"] for cell in cells} | {"truth"}


def test_level_in_lux_is_illuminance_on_the_reference_plane(outcome: Outcome) -> None:
    assert [level["illuminance_lux"] for level in outcome.results["levels"]][1] == pytest.approx(500.0)
    assert outcome.results["levels"][0]["luminance_cd_m2"] == 0.5


def test_dim_picture_is_better_from_the_interleaved_camera(outcome: Outcome) -> None:
    psnr = {cell["camera"]: cell["psnr_db"] for cell in outcome.results["cells"] if cell["level"] == 0}
    assert psnr["interleaved"] > psnr["bayer"]


def test_results_state_render_error_and_monte_carlo_share(outcome: Outcome) -> None:
    assert 0 < outcome.results["render"]["relative_mc_error"] < 1
    assert all(cell["mc_share"] > 0 for cell in outcome.results["cells"])


def test_same_seed_gives_the_same_numbers(outcome: Outcome) -> None:
    again = run(SMALL).results["cells"]
    for ours, theirs in zip(outcome.results["cells"], again, strict=True):
        assert {k: v for k, v in ours.items() if k != "seconds"} == {k: v for k, v in theirs.items() if k != "seconds"}


def test_files_are_written_whole(outcome: Outcome, tmp_path: Path) -> None:
    report = write(outcome, tmp_path / "new" / "folder")
    assert report.read_text(encoding="utf-8").lstrip().lower().startswith("<!doctype html>")
    assert json.loads((report.parent / "results.json").read_text())["scene"] == "still_life"
    with Image.open(report.parent / "overview.png") as sheet:
        assert sheet.size == (2 * 48 + 4, 2 * 48 + 4)
    assert sorted(path.name for path in report.parent.iterdir()) == ["overview.png", "report.html", "results.json"]


def test_failed_write_leaves_nothing_half_done(
    outcome: Outcome, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    real = Path.write_bytes

    def full_disk(path: Path, data: bytes) -> int:
        if path.name == "report.html":
            raise OSError(28, "No space left on device", str(path))
        return real(path, data)

    monkeypatch.setattr(Path, "write_bytes", full_disk)
    with pytest.raises(OSError, match="No space left"):
        write(outcome, tmp_path)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("text", "value", "unit"),
    [("25cd/m2", 25.0, "cd/m2"), (" 0.5 lux ", 0.5, "lux"), ("1e-3 cd/m²", 1e-3, "cd/m2"), (".25lux", 0.25, "lux")],
)
def test_levels_are_read_with_their_unit(text: str, value: float, unit: str) -> None:
    assert parse_level(text) == (value, unit)


@pytest.mark.parametrize("text", ["25nits", "25", "bright", "-3lux", "0cd/m2", "1e99lux", ""])
def test_bad_levels_are_refused_in_one_line(text: str) -> None:
    with pytest.raises(InputError) as caught:
        parse_level(text)
    assert "\n" not in str(caught.value)
    assert str(caught.value).startswith("level")


@pytest.mark.parametrize(
    ("demo", "message"),
    [
        (Demo(scene="still_live"), r"^scene: 'still_live' is unknown; allowed: .*did you mean 'still_life'\?"),
        (Demo(sensors=("lownoise",)), r"^sensor preset: 'lownoise' is unknown"),
        (Demo(sensors=()), r"^demo: \(\) is not allowed"),
        (Demo(size=4), r"^size: 4 is outside 16 to 4096"),
        (Demo(longest_s=-1.0), r"^longest exposure: -1.0 is outside"),
        (Demo(seed=-1), r"^seed: -1 is outside"),
        (Demo(spp=0), r"^spp: 0 is outside"),
    ],
)
def test_bad_input_is_refused_before_the_render(demo: Demo, message: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("studies.commands.demo.render_quietly", lambda *args, **more: pytest.fail("rendered"))
    with pytest.raises(InputError, match=message):
        run(demo)
