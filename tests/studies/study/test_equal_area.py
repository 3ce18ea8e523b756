"""Sensors of one size: means over pixels of another grid, by hand, and the pixels that a pitch makes."""

from dataclasses import replace

import numpy as np
import pytest
from refusal import refusal

from render.radiance import SpectralRadiance
from studies.budget.ledger import as_stated
from studies.budget.plan import plan
from studies.commands.sweep import estimate
from studies.study.equal_area import EqualArea, area_average
from studies.study.lit_scene import open_all
from studies.study.study import RenderLimits, SceneChoice, Study

RNG = np.random.default_rng(3)
NM = np.array([450.0, 550.0, 650.0])


def test_whole_factors_are_means_of_blocks_and_a_finer_grid_repeats() -> None:
    picture = RNG.random((6, 8, 3))
    blocks = picture.reshape(3, 2, 4, 2, 3).mean(axis=(1, 3))
    assert area_average(picture, (3, 4)) == pytest.approx(blocks, rel=1e-12)
    assert area_average(blocks, (6, 8)) == pytest.approx(blocks.repeat(2, 0).repeat(2, 1), rel=1e-12)
    assert area_average(picture, (6, 8)) == pytest.approx(picture, rel=1e-12)


def test_pixels_follow_from_the_pitch_in_the_pictures_proportions() -> None:
    area = EqualArea(side_um=883.2, coarsest_um=6.9)
    assert area.shape((300, 400), 6.9) == (96, 128)
    assert area.shape((400, 300), 2.2) == (401, 301)
    assert area.shape((400, 300), 2.2, block=2) == (402, 302)
    view = area.view(SpectralRadiance(RNG.random((30, 40, 3)), NM), 6.9)
    assert view.shape == (96, 128)
    assert view.wavelength_nm == pytest.approx(NM)


def test_a_render_of_fewer_pixels_than_a_sensor_is_refused_and_memory_counts_the_sensors() -> None:
    asked = Study(
        scenes=(SceneChoice("flat_field"),),
        levels=("1cd/m2",),
        sensors=("low_noise",),
        sensor_side_um=220.0,
        render=RenderLimits(size=64),
    )
    refusal(open_all, asked, match=r"render\.size: 64, and low_noise has 100 pixels on 220 um; allowed: 100")
    need = [
        estimate(study, as_stated(study), open_all(study), 1, 0).largest_bytes
        for study in (replace(asked, render=RenderLimits(size=size)) for size in (100, 400))
    ]
    assert need[1] > need[0]


def test_a_plan_of_sensors_of_one_size_is_refused() -> None:
    asked = Study(scenes=(SceneChoice("flat_field"),), levels=("1cd/m2",), sensors=("low_noise",), sensor_side_um=220.0)
    refusal(plan, asked, match="sensor_side_um: 220 can't be planned")
