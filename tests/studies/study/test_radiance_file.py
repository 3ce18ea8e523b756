"""A study of a spectral picture file: what is assumed of it, and the sizes that are taken."""

from pathlib import Path

import numpy as np
import pytest
from refusal import refusal

from render.radiance import SpectralRadiance
from render.radiance_files.exr import write_exr
from studies.study.lit_scene import make_transport, open_choice
from studies.study.scene_source import file_white, open_radiance_file
from studies.study.study import RenderLimits, SceneChoice, Study

NM = 385.0 + 10 * np.arange(40)


def ramp(path: Path, height: int = 20, width: int = 26, error: float = 0.0) -> Path:
    """Picture in equal-energy greys, darker from left to right."""
    values = np.broadcast_to(np.linspace(1.0, 0.05, width)[None, :, None], (height, width, NM.size))
    write_exr(SpectralRadiance(values * 1e-3, NM, error), path)
    return path


def test_what_is_assumed_of_a_file_is_told(tmp_path: Path) -> None:
    path = tmp_path / "a.exr"
    uneven = np.array([450.0, 500.0, 600.0])
    write_exr(SpectralRadiance(np.ones((16, 16, 3)), uneven, width_nm=np.ones(3)), path)
    path.write_bytes(path.read_bytes().replace(b"rodconeBands_nm", b"rodconeBandz_nm"))
    white = file_white(path, None)
    transport, notes = open_radiance_file(path, white)
    assert transport.width_nm.tolist() == [50, 75, 100]
    assert [("half-way" in note, "D65" in note) for note in notes] == [(True, False), (False, True)]
    assert all(note.startswith("a.exr: ") for note in notes)
    assert white.spectrum.band_average([450.0], [5.0]) > white.spectrum.band_average([650.0], [5.0])
    assert [note for note in open_radiance_file(path, file_white(path, "D65"))[1] if "D65" in note] == []


@pytest.mark.parametrize("size", [None, 16])
def test_a_size_that_a_picture_does_not_take_is_told(tmp_path: Path, size: int | None) -> None:
    choice = SceneChoice(str(ramp(tmp_path / "a.exr")))
    study = Study((choice,), ("1cd/m2",), render=RenderLimits(size=size))
    lit, notes = make_transport(open_choice(choice, study), study, None, tmp_path, lambda share, error: None)
    assert lit.counts.shape == (20, 26)
    assert any("render.size" in note for note in notes) == (size is not None)


@pytest.mark.parametrize(("height", "width"), [(15, 20), (20, 4097)])
def test_picture_of_a_size_that_no_camera_takes_is_refused(tmp_path: Path, height: int, width: int) -> None:
    path = ramp(tmp_path / "a.exr", height, width)
    refusal(open_radiance_file, path, file_white(path, "E"), match=r"a\.exr: side")
