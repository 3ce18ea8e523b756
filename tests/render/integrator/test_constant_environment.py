"""A constant environment along another light's paths: the same light as by itself, and an error that knows of both."""

from dataclasses import replace
from operator import attrgetter

import numpy as np
import pytest
from builders import block_means
from scipy.stats import norm

from render.engine import _checked_film, render
from render.error_estimates import relative_error
from render.geometry import look_at, to_world, translate
from render.loader import is_environment, load_groups
from render.runs import Means, add_run, no_means
from render.scene import LightGroup, Scene
from render.spectrum import flat
from scenes.catalogue import load
from scenes.materials import ball, checks, floor, glass, matte, panel
from scenes.reflectances import edge, grey

BANDS_NM, WIDTH_NM, SIZE, BLOCK = np.array([430.0, 500.0, 570.0, 640.0]), 30.0, (32, 40), 8
FALSE_ALARM = 1e-5
ARRAYS = ("radiance", "variance", "light.difference", "irradiance")


def courtyard():
    """Two coloured walls and a chequered floor with a glass ball, under a lamp and a constant environment."""
    camera = {"type": "perspective", "fov": 40.0, "to_world": to_world(look_at((0.9, 0.9, 2.0), (0.2, 0.25, 0)))}
    lamp = panel(look_at((1.2, 1.6, 0.9), (0.3, 0.0, 0.2)), 0.04, 0.04, matte(grey(0.02)), emitter={"type": "area"})
    geometry = {
        "type": "scene",
        "sensor": camera,
        "floor": panel(floor(0.5, 0, 0.5), 2.0, 2.0, checks(grey(0.8), edge(600, 12, 0.1, 0.7), 5, 5)),
        "wall": panel(translate(0.5, 0.3, -0.4), 2.0, 0.6, matte(edge(560, 40, 0.3, 0.8))),
        "side": panel(look_at((-0.3, 0.3, 0.5), (1, 0.3, 0.5)), 2.0, 0.6, matte(edge(480, 30, 0.7, 0.2))),
        "glass": ball(0.35, 0.12, 0.4, 0.12, glass()),
        "card": panel(floor(0.5, 0.001, 0.1), 0.1, 0.1, matte(grey(0.5))),
        "lamp": lamp,
        "sky": {"type": "constant"},
    }
    groups = {"sky": LightGroup(("sky",), flat(), 1.0), "lamp": LightGroup(("lamp/emitter",), flat(), 2000.0)}
    return Scene("courtyard", geometry, groups, reference_plane="card")


def sky_by_itself(scene):
    geometry = {key: value for key, value in scene.geometry.items() if key != "lamp"}
    black = panel(look_at((1.2, 1.6, 0.9), (0.3, 0.0, 0.2)), 0.04, 0.04, matte(grey(0.02)))
    return replace(scene, geometry=geometry | {"lamp": black}, groups={"sky": scene.groups["sky"]})


def made(scene, **options):
    return render(scene, SIZE, **({"wavelength_nm": BANDS_NM, "width_nm": WIDTH_NM, "spp": 128, "seed": 3} | options))


@pytest.fixture(scope="module")
def both():
    return made(courtyard())


@pytest.fixture(scope="module")
def several():
    scene = replace(courtyard(), reference_plane=None)
    return [made(scene, spp=16, seed=seed) for seed in range(20, 44)]


@pytest.mark.thorough
def test_the_sky_along_another_lights_paths_is_the_sky_by_itself(both):
    alone = made(sky_by_itself(courtyard()), spp=256, seed=8)
    variance = block_means(both.variance[0]) + block_means(alone.variance[0])
    z = (block_means(both.radiance[0]) - block_means(alone.radiance[0])) / np.sqrt(variance / BLOCK**2)
    # Block means of 64 pixels with 7 degrees of freedom each are close to normal.
    assert np.abs(z).max() < norm.isf(FALSE_ALARM / 2 / z.size)
    assert 0.5 < np.mean(z**2) < 1.7  # 20 blocks whose bands go together: standard error 0.32 at most
    # Two meters of 64x64 pixels and at least 128 samples; a sample scatters by less than the mean.
    assert both.irradiance[0] == pytest.approx(alone.irradiance[0], rel=5 * np.sqrt(2 / 64**2 / 128))


def test_only_the_sky_shares_paths_and_it_is_told_with_which(both):
    assert both.shared.groups == (1, 0)
    assert both.shared.correlation.shape == both.variance.shape[1:]
    assert -1 <= both.shared.correlation.min() < -0.5
    assert 0.5 < both.shared.correlation.max() <= 1
    assert made(sky_by_itself(courtyard()), spp=8).shared is None


@pytest.mark.thorough
@pytest.mark.parametrize("sign", [1, -1])
def test_the_stated_variance_of_both_lights_is_the_scatter_of_renders(several, sign):
    """Where errors rise together, and where one falls as the other rises; half of the renders tell where that is."""
    chosen, judged = several[::2], several[1::2]
    where = sign * np.mean([one.shared.correlation for one in chosen], axis=0) > 0.35
    emitted = np.ones((2, 4))
    sky, lamp = np.mean([one.variance for one in chosen], axis=0)[:, where]
    emitted[0] = np.median(np.sqrt(lamp / sky))
    lit = [np.einsum("gb,gbhw->bhw", emitted, one.radiance, dtype=np.float64)[where] for one in judged]
    apart = np.mean([np.einsum("gb,gbhw->bhw", emitted**2, one.variance)[where] for one in judged], axis=0)
    joint = np.mean([one.shared.term(emitted, one.variance)[where] for one in judged], axis=0)
    ratio = np.var(lit, axis=0, ddof=1) / (apart + joint)
    assert np.count_nonzero(where.any(axis=0)) > 60
    # A ratio has 11 over 84 degrees of freedom: 60 pixels' mean scatters by 6 %, and lies 84 / 82 high.
    assert ratio.mean() == pytest.approx(1.0, rel=0.3)
    assert sign * np.median(joint / apart) > 0.3  # without it the ratio would be off by that much


def test_the_error_told_knows_of_the_correlation(both):
    lights = np.array([g.spectrum.band_average(BANDS_NM, np.full(4, WIDTH_NM)) * g.power for g in both.groups.values()])
    expected = relative_error(lights, both.radiance, both.variance, both.shared)
    assert both.relative_mc_error == both.relight().relative_mc_error == expected
    assert abs(expected / relative_error(lights, both.radiance, both.variance) - 1) > 0.005


def test_a_render_gone_on_from_and_a_cached_one_keep_the_correlation(tmp_path):
    small = {"spp": None, "noise": 1e-6}
    whole = made(courtyard(), max_spp=32, **small)
    part = made(courtyard(), max_spp=16, cache=tmp_path, **small)
    assert (part.spp, whole.spp) == (16, 32)
    on = made(courtyard(), max_spp=32, cache=tmp_path, **small)
    again = made(courtyard(), max_spp=32, cache=tmp_path, **small)
    assert np.array_equal(on.radiance, whole.radiance)
    noisy = (whole.variance > 1e-6 * whole.radiance**2).all(axis=0)
    assert np.count_nonzero(noisy) > 1000
    assert on.shared.correlation[noisy] == pytest.approx(whole.shared.correlation[noisy], abs=1e-3)
    assert all(np.array_equal(attrgetter(name)(on), attrgetter(name)(again)) for name in ARRAYS)
    assert again.shared.groups == on.shared.groups
    assert np.array_equal(again.shared.correlation, on.shared.correlation)
    assert again.relative_mc_error == on.relative_mc_error


def test_a_sky_of_its_own_colour_or_with_another_light_is_rendered_by_itself():
    scene = courtyard()
    assert is_environment(scene, "sky")
    assert not is_environment(scene, "lamp")
    own = replace(scene.groups["sky"], coloured=True)
    assert not is_environment(replace(scene, groups=scene.groups | {"sky": own}), "sky")
    together = LightGroup(("sky", "lamp/emitter"), flat())
    assert not is_environment(replace(scene, groups={"all": together}), "all")


# Indirect light by itself: identities of the same paths.


FRAME, POINTS = (20, 24), 16
NM = np.arange(405.0, 780.0, 50.0)


def drawn(scene: Scene, depth: int, *, split: bool = True) -> Means:
    film = _checked_film(scene, FRAME, NM, None, depth)
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
