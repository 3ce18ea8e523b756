"""Facts of a study: which engine made the numbers, and what fell back, in words."""

import numpy as np
import pytest

from sensor.cfa import channels
from studies import results
from studies.camera import build_camera, photograph
from studies.results import environment, notes
from studies.truth import Light


def test_the_engine_of_captures_is_the_one_that_a_study_s_photographs_name() -> None:
    nm = np.arange(400.0, 701.0, 10.0)
    light = Light(nm, np.full(nm.size, 10.0), np.full(nm.size, 1e-3))
    camera = build_camera("bayer", "low_noise", light, (16, 16), np.random.default_rng(1))
    assert channels(camera.sensor.cfa) == ("R", "G", "B")
    expected_e, truth = np.full((16, 16), 1000.0), np.full((16, 16, 3), 0.5)
    shot = photograph(camera, expected_e, truth, light, 25.0, 0.01, np.random.default_rng(2))
    assert environment()["engine of captures"] == shot.raw.engine


def test_what_ran_in_numpy_is_told_for_render_captures_and_reconstruction(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(results, "backend", lambda: "llvm")
    assert notes() == []
    monkeypatch.setattr(results, "backend", lambda: "numpy")
    (line,) = notes()
    for part in ("scalar_spectral", "captures", "reconstruction", "NumPy"):
        assert part in line
