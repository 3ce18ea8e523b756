"""Hard cases of rendering and relighting, each with a clear outcome: glass, nothing, fireflies, 10^8 in one picture.

A line in a coarse grid, caustics, one pixel, 1 x N pixels, a missing mesh, no light and a hostile file have their tests
in tests/statistics, test_engine and user_scene.
"""

import numpy as np
import pytest
from command_line import in_new_python
from loop import loop
from refusal import refusal
from scipy.stats import norm

from render.engine import render
from render.geometry import look_at, scale, to_world, translate
from render.illuminants import illuminant
from render.scene import LightGroup, Scene
from render.spectrum import flat
from rodcone.errors import InputError
from rodcone.jit import backend
from scenes.catalogue import load
from scenes.materials import ball, disk, floor, glass, glossy, matte, panel
from scenes.reflectances import grey

FALSE_ALARM = 1e-5
BANDS_NM = np.arange(430.0, 780.0, 100.0)  # four bands fill 380-780 nm


def scene_of(camera, light, **things):
    geometry = {"type": "scene", "sensor": {"type": "perspective", **camera}, "lamp": light, **things}
    return Scene("hard", geometry, {"lamp": LightGroup(("lamp/emitter",), flat())})


@loop(
    ("kind", "ior"), [("dielectric", 1.5), ("dielectric", 2.4), ("thindielectric", 1.5)]
)  # thin: one surface that stands for a pane
def test_a_light_seen_through_a_pane_is_dimmed_by_all_its_reflections(kind, ior):
    pane = {"type": kind, "int_ior": ior, "ext_ior": 1.0}
    narrow = {"fov": 2.0, "to_world": to_world(look_at((0, 0, 2), (0, 0, 0)))}
    light = panel(translate(0, 0, -1), 4.0, 4.0, matte(grey(0.0)), emitter={"type": "area"})
    flat_pane = {"type": "rectangle", "to_world": to_world(translate(0, 0, 1), scale(2, 2, 1)), "bsdf": pane}
    thick = {"type": "cube", "to_world": to_world(translate(0, 0, 1), scale(2, 2, 0.01)), "bsdf": pane}
    scene = scene_of(narrow, light, pane=thick if kind == "dielectric" else flat_pane)
    made = render(scene, (8, 8), wavelength_nm=BANDS_NM, spp=256, max_depth=40, seed=5)
    reflected = ((ior - 1) / (ior + 1)) ** 2
    truth = (1 - reflected) / (1 + reflected)
    error = np.sqrt(made.variance[0, 0].sum(dtype=np.float64)) / 64
    assert error < 0.01
    seen = made.radiance[0].mean(axis=(1, 2), dtype=np.float64)
    assert seen == pytest.approx(np.full(4, truth), abs=norm.isf(FALSE_ALARM / 2) * error)
    # Half a degree off the normal changes Fresnel's reflection by less than 1e-4.
    assert norm.isf(FALSE_ALARM / 2) * error < 1 - truth  # sees the pane


def firefly():
    """Tiny lamp in a clear glass ball over a floor: paths find it by chance alone."""
    camera = {"fov": 30.0, "to_world": to_world(look_at((0, 1, 3), (0, 0, 0)))}
    lamp = disk(look_at((0, 0.6, 0), (0, 0, 0), (0, 0, 1)), 0.02, matte(grey(0.0)), emitter={"type": "area"})
    ground = panel(floor(0, 0, 0), 4.0, 4.0, glossy(grey(0.6), 0.1))
    return scene_of(camera, lamp, ground=ground, ball=ball(0, 0.6, 0, 0.2, glass()))


@pytest.mark.thorough
def test_fireflies_are_finite_and_a_render_full_of_them_does_not_claim_to_be_done():
    made = render(firefly(), (16, 16), wavelength_nm=BANDS_NM, max_spp=256, noise=0.05, seed=6)
    lit = made.radiance[0, 0] > 0
    assert np.isfinite(made.radiance).all()
    assert np.isfinite(made.variance).all()
    assert lit.any()
    assert made.radiance.max() > 20 * made.radiance[0, 0].mean()
    assert made.stopped_by == "samples"
    assert made.relative_mc_error > 0.25
    far = render(firefly(), (16, 16), wavelength_nm=BANDS_NM, spp=4096, seed=7)
    # The error is no understatement: what is missing to a far finer render is as large as it says.
    brightest = far.radiance[0, 0] > np.median(far.radiance[0, 0])
    off = (made.radiance[0, 0] - far.radiance[0, 0])[brightest] / far.radiance[0, 0][brightest]
    assert np.sqrt(np.mean(off**2)) > made.relative_mc_error / 3


def test_a_black_scene_is_black_at_no_error_and_has_no_level():
    away = {"fov": 30.0, "to_world": to_world(look_at((0, 0, 3), (0, 0, 9)))}
    lamp = panel(look_at((0, 0, 0), (0, 0, 1)), 1.0, 1.0, matte(grey(0.0)), emitter={"type": "area"})
    made = render(scene_of(away, lamp), (3, 4), wavelength_nm=BANDS_NM, max_spp=128, noise=0.02)
    lit = made.relight({"lamp": "sodium_low"})
    assert not made.radiance.any()
    assert not made.variance.any()
    assert not made.coverage.mean.any()
    assert not lit.values.any()
    assert lit.relative_mc_error == 0.0
    assert not any(made.band_error({"lamp": "sodium_low"}).values())
    refusal(made.relight, luminance_cd_m2=10.0, match="can't be reached, the scene gives no light")


def two_rooms():
    """White wall behind a black partition, a point light 0.5 m before each half: one group each."""
    camera = {"type": "perspective", "fov": 30.0, "to_world": to_world(look_at((0, 0, 4), (0, 0, 0)))}
    black = matte(grey(0.0))
    geometry = {
        "type": "scene",
        "sensor": camera,
        "wall": panel(translate(0, 0, 0), 8.0, 8.0, matte(grey(0.5))),
        "partition": panel(look_at((0, 0, 0), (1, 0, 0)), 8.0, 8.0, black),
        "left": {"type": "point", "position": [-0.5, 0.0, 0.5]},
        "right": {"type": "point", "position": [0.5, 0.0, 0.5]},
    }
    groups = {name: LightGroup((name,), illuminant("E")) for name in ("left", "right")}
    return Scene("two_rooms", geometry, groups)


@loop("dim", [1.0, 1e-6])
def test_both_ends_of_a_range_of_1e8_in_one_picture_are_right_in_relative_terms(dim):
    size = 16
    made = render(two_rooms(), (size, size), wavelength_nm=BANDS_NM, spp=256, max_depth=2, seed=9)
    powers = {"left": dim, "right": dim * 1e8}
    lit = made.relight(powers=powers)
    assert lit.values.dtype == np.float32
    # Radiance of a matte wall under a point light of intensity I: rho / pi I h / r^3, averaged over each pixel.
    side = 2 * 4 * np.tan(np.radians(15)) / size
    at = (np.arange(16 * size) + 0.5) / 16 * side - size / 2 * side
    y, x = np.meshgrid(at, at, indexing="ij")
    fine = 0.5 / np.pi * 0.5 / ((np.abs(x) - 0.5) ** 2 + y**2 + 0.25) ** 1.5
    shape = fine.reshape(size, 16, size, 16).mean(axis=(1, 3))
    power = np.where(np.arange(size) < size // 2, powers["left"], powers["right"])
    emission = illuminant("E").band_average(BANDS_NM, 100.0)
    truth = shape[..., None] * power[None, :, None] * emission
    error = np.sqrt(made.variance.max(axis=0, initial=0)).max(axis=0) / shape
    assert error.max() < 0.03
    assert (np.abs(lit.values / truth - 1).max(axis=-1) < norm.isf(FALSE_ALARM / 2 / size**2) * error + 1e-3).all()
    ends = lit.values[:, size // 2 :].max() / lit.values[:, : size // 2].min()
    assert 1e8 < ends < 1e10
    # The bright half adds nothing to the dark one: bit for bit what it is alone.
    alone = made.relight(powers=powers | {"right": 0.0}).values
    assert np.array_equal(alone[:, : size // 2], lit.values[:, : size // 2])


@pytest.fixture(scope="module")
def wall():
    return render(load("flat_field", light="E"), (2, 3), wavelength_nm=BANDS_NM, spp=8)


def test_a_huge_power_is_right_until_it_leaves_float32_and_is_then_refused(wall):
    lit = wall.relight({"sky": flat()}, powers={"sky": 1e30})
    assert lit.values == pytest.approx(1e30 * np.moveaxis(wall.radiance[0].astype(np.float64), 0, -1), rel=1e-6)
    assert lit.relative_mc_error == pytest.approx(wall.relight({"sky": flat()}).relative_mc_error, rel=1e-5)
    with pytest.raises(InputError, match=r"radiance: inf at row 0, column 0, band 0; allowed: finite numbers >= 0"):
        wall.relight({"sky": flat(1e10)}, powers={"sky": 1e30})


THREADS = """
import hashlib, sys
import numpy as np
from rodcone.jit import dr
dr.set_thread_count(int(sys.argv[1]))
from render.engine import render
from operator import attrgetter
from scenes.catalogue import load
made = render(load("cornell_box"), (40, 56), wavelength_nm=np.arange(430.0, 780.0, 100.0), spp=32, seed=4)
for name in ("radiance", "variance", "light.difference", "irradiance", "coverage.mean"):
    print(name, hashlib.sha256(np.ascontiguousarray(attrgetter(name)(made)).tobytes()).hexdigest())
print(made.radiance.any(), made.irradiance.any())
"""


@pytest.mark.thorough
@pytest.mark.skipif(backend() != "llvm", reason="threads are the LLVM backend's")
def test_the_same_seed_gives_the_same_bits_whatever_the_number_of_threads():
    said = [in_new_python(THREADS, count) for count in (1, 5)]
    assert said[0].endswith("True True")
    assert said[0] == said[1]
