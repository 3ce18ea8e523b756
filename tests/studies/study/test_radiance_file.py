"""The main job on a spectral picture file: its own size, its notes, refusals before any work."""

from io import BytesIO
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from render.radiance import SpectralRadiance
from render.radiance_files.exr import write_exr
from rodcone.errors import InputError
from studies.commands.demo import Demo, check, run, write
from studies.study.radiance_file import open_radiance_file

NM = 385.0 + 10 * np.arange(40)


def ramp(path: Path, height: int = 20, width: int = 26, error: float = 0.0) -> Path:
    """Picture in equal-energy greys, darker from left to right."""
    values = np.broadcast_to(np.linspace(1.0, 0.05, width)[None, :, None], (height, width, NM.size))
    write_exr(path, SpectralRadiance(values * 1e-3, NM, error))
    return path


def test_demo_runs_from_a_file_in_the_files_own_size(tmp_path: Path) -> None:
    path = ramp(tmp_path / "my scene.exr", error=0.25)
    outcome = run(Demo(scene=str(path), sensors=("low_noise",), levels=("25cd/m2",), light="E"))
    results = outcome.results
    assert results["scene"] == "my scene.exr"
    assert results["size"] == [20, 26]
    assert results["levels"][0]["illuminance_lux"] is None
    assert results["render"]["integrator"] == "file"
    assert results["render"]["bands"] == 40
    assert len(results["cells"]) == 2
    assert any("relative Monte Carlo error of 0.250" in note for note in results["notes"])
    assert "my scene.exr" in write(outcome, tmp_path / "out").read_text("utf-8")


def test_grey_picture_is_grey_under_its_own_light_alone(tmp_path: Path) -> None:
    """Equal energy is neutral under E; under D65, which is bluer, it is reddish."""
    path = ramp(tmp_path / "a.exr")
    spread = {}
    for light in ("E", None):
        outcome = run(Demo(scene=str(path), sensors=("low_noise",), levels=("100cd/m2",), light=light))
        with Image.open(BytesIO(outcome.pictures["truth"])) as truth:
            pixels = np.asarray(truth.convert("RGB"), dtype=int)
        spread[light] = (pixels[:, :, 0] - pixels[:, :, 2]).max()
    assert spread["E"] <= 1  # 40 bands round the neutral by less than a step of 8 bits
    assert spread[None] > 10


def test_what_is_assumed_of_a_file_is_told(tmp_path: Path) -> None:
    path = tmp_path / "a.exr"
    uneven = np.array([450.0, 500.0, 600.0])
    write_exr(path, SpectralRadiance(np.ones((16, 16, 3)), uneven, width_nm=np.ones(3)))
    path.write_bytes(path.read_bytes().replace(b"rodconeBands_nm", b"rodconeBandz_nm"))
    transport, light, told = open_radiance_file(path, None)
    assert transport.width_nm.tolist() == [50, 75, 100]
    assert [("half-way" in note, "D65" in note) for note in told] == [(True, False), (False, True)]
    assert all(note.startswith("a.exr: ") for note in told)
    assert light.band_average([450.0], [5.0]) > light.band_average([650.0], [5.0])
    assert [note for note in open_radiance_file(path, "D65")[2] if "D65" in note] == []


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ({"scene": "missing.exr"}, "no such file"),
        ({"levels": ("500lux",)}, "reference plane"),
        ({"light": "D66"}, "D66"),
        ({"levels": ("500candles",)}, "candles"),
    ],
)
def test_bad_request_is_refused_before_the_file_is_read(tmp_path: Path, change: dict[str, object], told: str) -> None:
    path = tmp_path / "a.exr"
    path.write_text("never read")
    with pytest.raises(InputError, match=told):
        check(Demo(**{"scene": str(path), **change}))  # type: ignore[arg-type]


@pytest.mark.parametrize(("height", "width"), [(15, 20), (20, 4097)])
def test_picture_of_a_size_that_no_camera_takes_is_refused(tmp_path: Path, height: int, width: int) -> None:
    with pytest.raises(InputError, match=r"a\.exr: side"):
        open_radiance_file(ramp(tmp_path / "a.exr", height, width), "E")


def test_light_of_a_scene_by_name_reaches_its_builder() -> None:
    with pytest.raises(InputError, match="D66"):
        check(Demo(light="D66"))
    with pytest.raises(InputError, match="furnace: option"):
        check(Demo(scene="furnace", light="A"))
    check(Demo(scene="flat_field", light="A"))
