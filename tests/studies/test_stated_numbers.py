"""What rows and results state of how pictures were made, counted another way: paths, arrays, wells."""

import json
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest
from path_counter import count_paths
from sweep_sample import swept

from render.engine import render
from rodcone.jit import backend
from sensor.presets import low_noise
from studies.study import render_noise
from studies.study.study import RenderLimits, SceneChoice, Study
from studies.sweep.database import last_run
from studies.sweep.export import read_rows, results_json


def test_bands_and_samples_are_those_of_the_stored_render(tmp_path: Path) -> None:
    limits = RenderLimits(size=16, spp=17, band_nm=50.0)
    study = Study((SceneChoice("flat_field"),), ("1cd/m2",), processors=("bayer",), render=limits)
    swept(study, tmp_path)
    (stored,) = (tmp_path / "renders").iterdir()  # 32 bytes of digest go before NumPy's file
    (row,) = read_rows(tmp_path)
    with np.load(BytesIO(stored.read_bytes()[32:])) as render:
        assert row.bands == render["light_mean"].shape[1] == 8
        assert row.spp == 2 * (limits.spp // 2 + 1), "a half has whole points"


def test_an_automatic_exposure_fills_the_well_or_ends_at_the_longest(tmp_path: Path) -> None:
    """A flat grey: at 1000 cd/m^2 green holds 80 % of its well, at 1e-3 it can't."""
    limits = RenderLimits(size=16, spp=16, band_nm=50.0)
    study = Study(
        (SceneChoice("flat_field"),),
        ("1000cd/m2", "0.001cd/m2"),
        exposures=("auto",),
        processors=("bayer",),
        longest_exposure_s=0.05,
        render=limits,
    )
    swept(study, tmp_path)
    bright, dark = sorted(read_rows(tmp_path), key=lambda row: -row.luminance_cd_m2)
    well = low_noise("bayer").pixel.full_well_e
    assert max(json.loads(bright.mean_electrons).values()) == pytest.approx(0.8 * well, rel=0.05)
    assert bright.exposure_s < 0.05
    assert dark.exposure_s == 0.05
    assert max(json.loads(dark.mean_electrons).values()) < 0.01 * well


@pytest.mark.skipif(backend() == "numpy", reason="counts the wavefronts of Dr.Jit")
def test_the_results_state_the_render_that_was_made(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    paths, made = count_paths(monkeypatch), []
    monkeypatch.setattr(render_noise, "render", lambda *a, **k: made.append(render(*a, **k)) or made[-1])
    size = 16  # of the sensor: an edge's render has two samples along each side of its pixels
    limits = RenderLimits(size=size, spp=33, noise_share=1e-6)
    study = Study((SceneChoice("slanted_edge"),), ("0.001cd/m2", "1000cd/m2"), render=limits)
    swept(study, tmp_path)
    found = json.loads(results_json(last_run(tmp_path)))["rows"]
    (transport,), told = made, found[0]["render"]
    assert found[0]["spp"] == paths["camera"] / (2 * size) ** 2 / len(transport.groups)
    assert told["stopped_by"] == "samples"
    assert told["brightest_share"] > 1e-6
    bands = found[0]["bands"]
    assert bands == transport.radiance.shape[1]
    low, high = told["first_nm"] - told["width_nm"] / 2, told["last_nm"] + told["width_nm"] / 2
    assert (low, high) == pytest.approx((380, 780))
    assert bands * told["width_nm"] == pytest.approx(high - low)
    # One light of one power in every band: the error of the mean over pixels, by their halves' scatter.
    halves = transport.light.difference.sum(axis=(0, 1))
    error = halves.std() / halves.size**0.5 / transport.radiance.sum(axis=(0, 1)).mean()
    assert told["relative_level_error"] == pytest.approx(error, rel=0.3)
