"""Truth of a rendered scene: light groups sum to the picture, and each is what it gives alone."""

from pathlib import Path

import numpy as np
import pytest

from render.engine import render
from render.photometry import luminance
from scenes.catalog import load
from studies.dataset.truth_files import group_shares, scene_hash
from studies.study.lit_scene import open_choice
from studies.study.study import RenderLimits, SceneChoice, Study


@pytest.mark.thorough
def test_shares_of_lights_sum_to_the_picture_and_each_is_what_it_gives_alone() -> None:
    scene = load("night_street")
    transport = render(scene, (16, 24), wavelength_nm=[450, 550, 650], width_nm=[100] * 3, spp=8)
    assert len(transport.groups) > 2
    shares = group_shares(transport)

    def y(**powers: float) -> np.ndarray:
        view = transport.relight(powers=powers or None)
        return luminance(view.values.astype(float), view.wavelength_nm, view.widths_nm)

    whole = y()
    np.testing.assert_allclose(shares.sum(axis=-1) * whole, whole, rtol=1e-6)
    for index, name in enumerate(transport.groups):
        alone = y(**{other: transport.groups[other].power * (other == name) for other in transport.groups})
        # radiance is rounded to float32 after it is summed
        np.testing.assert_allclose(shares[..., index] * whole, alone, atol=1e-6 * whole.max())


def test_a_scene_has_one_hash_whatever_lights_it_and_another_for_other_shapes(tmp_path: Path) -> None:
    study = Study((SceneChoice("color_checker"),), ("1cd/m2",), render=RenderLimits(size=32))

    def hashed(*arguments: str, **changes: str) -> str:
        return scene_hash(open_choice(SceneChoice(*arguments, **changes), study))

    assert hashed("generated-1f") == hashed("generated-1f", light="A")
    assert hashed("generated-1f") != hashed("generated-2f")
