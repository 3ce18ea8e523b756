"""Indirect light by itself: identities of the same paths."""

import numpy as np
import pytest

from render.engine import _checked_film
from render.geometry import look_at, to_world
from render.loader import load_groups
from render.runs import Means, add_run, no_means
from render.scene import LightGroup, Scene
from render.spectrum import flat
from scenes.catalog import load
from scenes.materials import floor, matte, panel
from scenes.reflectances import grey

SIZE, POINTS = (20, 24), 16
BANDS_NM = np.arange(405.0, 780.0, 50.0)


def drawn(scene: Scene, depth: int, *, split: bool = True) -> Means:
    film = _checked_film(scene, SIZE, BANDS_NM, None, depth)
    means, loaded = no_means(scene, film, np.ones(film.size, np.uint32), split=split), load_groups(scene, film)
    while means.count < POINTS:
        add_run(loaded, means, film, POINTS, 3)
    return means


def two_lights() -> Scene:
    """A corner of two walls under a lamp and the sky: the sky's light comes along the lamp's paths."""
    geometry = {
        "type": "scene",
        "sensor": {"type": "perspective", "fov": 50.0, "to_world": to_world(look_at((2, 1.5, 2), (0, 0.3, 0)))},
        "ground": panel(floor(0, 0, 0), 3.0, 3.0, matte(grey(0.6))),
        "wall": panel(to_world(look_at((0, 0.5, -0.6), (0, 0.5, 1))), 2.0, 1.0, matte(grey(0.8))),
        "lamp": {"type": "point", "position": [0.4, 1.2, 0.6]},
        "sky": {"type": "constant"},
    }
    groups = {name: LightGroup(emitters=(name,), spectrum=flat(1.0)) for name in ("lamp", "sky")}
    return Scene(name="two_lights", geometry=geometry, groups=groups)


def mirrored() -> Scene:
    """A matte floor before a perfect mirror, under a round lamp."""
    geometry = {
        "type": "scene",
        "sensor": {"type": "perspective", "fov": 50.0, "to_world": to_world(look_at((0, 1.0, 2), (0, 0.3, -0.5)))},
        "ground": panel(floor(0, 0, 0), 2.0, 2.0, matte(grey(0.6))),
        "mirror": panel(
            to_world(look_at((0, 0.5, -1), (0, 0.5, 1))), 2.0, 1.0, {"type": "conductor", "material": "none"}
        ),
        "lamp": {"type": "sphere", "center": [0.0, 1.0, 0.5], "radius": 0.15, "emitter": {"type": "area"}},
    }
    return Scene("mirrored", geometry, {"lamp": LightGroup(emitters=("lamp/emitter",), spectrum=flat(1.0))})


@pytest.mark.sample(1)
@pytest.mark.parametrize("make", [two_lights, lambda: load("cornell_box")], ids=["two_lights", "cornell_box"])
def test_without_mirrors_direct_light_is_what_paths_of_two_segments_bring(make) -> None:
    whole, direct = drawn(make(), 8), drawn(make(), 2)
    assert whole.indirect is not None
    assert whole.indirect.mean.mean() > 0.02 * whole.light.mean.mean()
    scale = direct.light.mean.max()
    assert np.allclose(whole.light.mean - whole.indirect.mean, direct.light.mean, rtol=1e-5, atol=1e-5 * scale)
    assert direct.indirect is not None
    assert not direct.indirect.mean.any()


def test_light_is_direct_in_a_mirror_and_indirect_from_one() -> None:
    """Paths of three segments: the lit floor in the mirror is direct, the lamp's light off the mirror on it isn't.

    Floor and mirror meet 2.8 degrees under the camera's axis, in row 11.
    """
    scene = mirrored()
    whole, direct = drawn(scene, 3), drawn(scene, 2)
    assert whole.indirect is not None
    mirror, ground = np.s_[0, :, :11], np.s_[0, :, 12:]
    assert (whole.light.mean > direct.light.mean)[mirror].mean() > 0.1  # beside the lamp in it, the floor
    assert not whole.indirect.mean[mirror].any()
    assert whole.indirect.mean[ground].mean() > 0.01 * direct.light.mean[ground].mean()
    assert np.allclose(
        (whole.light.mean - whole.indirect.mean)[ground], direct.light.mean[ground], rtol=1e-5, atol=1e-6
    )
