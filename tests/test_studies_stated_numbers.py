"""What a row states of how its picture was made, counted another way: from stored arrays, wells and clocks."""

import json
from pathlib import Path

import numpy as np
import pytest
from sweep_sample import swept

from sensor.presets import low_noise
from studies.ledger import open_ledger, rows
from studies.study import RenderLimits, SceneChoice, Study


def test_bands_and_samples_are_those_of_the_stored_render(tmp_path: Path) -> None:
    limits = RenderLimits(size=16, spp=17, band_nm=50.0)
    study = Study((SceneChoice("flat_field"),), ("1cd/m2",), processors=("bayer",), render=limits)
    swept(study, tmp_path)
    (stored,) = (tmp_path / "renders").iterdir()
    with np.load(stored) as render, open_ledger(tmp_path) as base:
        (row,) = rows(base)
        assert row.bands == render["radiance"].shape[1] == 8
        assert row.spp == render["pass_spp"].sum()


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
    with open_ledger(tmp_path) as base:
        bright, dark = sorted(rows(base), key=lambda row: -row.luminance_cd_m2)
    well = low_noise("bayer").pixel.full_well_e
    assert max(json.loads(bright.mean_electrons).values()) == pytest.approx(0.8 * well, rel=0.05)
    assert bright.exposure_s < 0.05
    assert dark.exposure_s == 0.05
    assert max(json.loads(dark.mean_electrons).values()) < 0.01 * well
