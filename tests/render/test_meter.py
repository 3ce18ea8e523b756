"""The irradiance meter against closed forms: a surface that samples lights as any other does.

Each light is at unit emission, as the engine renders it. Random ones are compared within standard errors: by chance a
test may fail at most `FALSE_ALARM` of the time, over all its comparisons; seeds are fixed.
"""

from dataclasses import replace

import numpy as np
import pytest
from loop import loop
from scipy.stats import chi2, norm
from scipy.stats import t as student

from render import meter
from render.engine import render
from render.geometry import look_at, to_world
from render.scene import LightGroup, Scene
from render.spectrum import flat
from scenes.catalogue import load
from scenes.materials import disk, floor, matte, panel
from scenes.reflectances import grey

FALSE_ALARM = 1e-5
BANDS_NM = np.arange(430.0, 780.0, 100.0)  # four bands fill 380-780 nm
SIDE_M = 0.5
PATHS = 64 * 64 * 2 * 16  # however many samples the picture has


def metered_scene(lights, **more):
    """Square plate that faces up, under lights at unit emission."""
    camera = {"type": "perspective", "fov": 20.0, "to_world": to_world(look_at((0, 2, 2), (0, 0, 0)))}
    plate = panel(floor(0, 0, 0), SIDE_M, SIDE_M, matte(grey(0.5)))
    paths = tuple(f"{name}/emitter" if "emitter" in node else name for name, node in lights.items())
    geometry = {"type": "scene", "sensor": camera, "plate": plate, **lights, **more}
    return Scene("meter", geometry, {"lights": LightGroup(paths, flat())}, reference_plane="plate")


def metered(lights, seed=0, **more):
    """Irradiance on the plate, shape (band,)."""
    return render(metered_scene(lights, **more), (1, 1), wavelength_nm=BANDS_NM, spp=1, seed=seed).irradiance[0]


def from_seeds(light, count):
    """Mean irradiance in the first band and its standard error; the bands share their paths."""
    values = np.array([metered({"light": light}, seed) for seed in range(count)])
    assert np.ptp(values, axis=1).max() <= 1e-6 * values.max()
    return values[:, 0].mean(), values[:, 0].std(ddof=1) / np.sqrt(count)


def assert_is(truth, light, finest):
    count = 6
    mean, error = from_seeds(light, count)
    assert error < finest * truth
    # Sums in float32 within a kernel and Mitsuba's own geometry: a part in a million.
    assert abs(mean - truth) < student.isf(FALSE_ALARM / 2, count - 1) * error + 1e-6 * truth


@loop("degrees", [0.0, 35.0, 60.0, 89.0])
def test_a_beam_gives_the_cosine_of_its_angle(degrees):
    down = [np.sin(np.radians(degrees)), -np.cos(np.radians(degrees)), 0.0]
    seen = metered({"beam": {"type": "directional", "direction": down}})
    assert seen == pytest.approx(np.full(4, np.cos(np.radians(degrees))), rel=1e-4 if degrees > 80 else 1e-6)


def test_a_beam_from_behind_and_a_beam_behind_a_shade_give_nothing():
    up, down = ({"beam": {"type": "directional", "direction": [0.3, y, 0.0]}} for y in (1.0, -1.0))
    assert not metered(up).any()
    shade = panel(floor(0, 0.5, 0), 2.0, 2.0, matte(grey(0.0)))
    assert not metered(down, shade=shade).any()


@pytest.mark.sample(1)
@pytest.mark.parametrize("height_m", [0.1, 3.0])
def test_a_point_light_gives_the_plates_solid_angle_over_its_area(height_m):
    half = SIDE_M / 2
    solid_angle = 4 * np.arcsin(half**2 / (half**2 + height_m**2))
    truth = solid_angle / SIDE_M**2
    # Points on the plate in the worst case independent: their scatter about the mean, by the midpoint rule.
    at = (np.arange(400) + 0.5) / 400 * SIDE_M - half
    squared = at[:, None] ** 2 + at**2 + height_m**2
    values = height_m / squared**1.5
    assert values.mean() == pytest.approx(truth, rel=1e-5)
    error = values.std() / np.sqrt(PATHS)
    assert_is(truth, {"type": "point", "position": [0.0, height_m, 0.0]}, 1.5 * error / truth)


def under_a_disk(centre, facing, radius_m):
    """Mean irradiance on the plate under a disk of radiance 1: both cut into small pieces, cos cos / d^2 of each."""
    along = (np.arange(20) + 0.5) / 20 * SIDE_M - SIDE_M / 2
    plate = np.stack(np.meshgrid(along, [0.0], along, indexing="ij"), axis=-1).reshape(-1, 1, 3)
    radius, turn = radius_m * np.sqrt((np.arange(8) + 0.5) / 8), np.arange(12) * np.pi / 6
    left, up = look_at(centre, np.add(centre, facing))[:3, :2].T
    ring = np.cos(turn)[:, None] * left + np.sin(turn)[:, None] * up
    way = centre + (radius[:, None, None] * ring).reshape(1, -1, 3) - plate
    distance = np.linalg.norm(way, axis=-1)
    return np.pi * radius_m**2 * np.mean(way[..., 1] * -(way @ facing) / distance**4)


@pytest.mark.thorough
def test_a_small_sun_gives_its_solid_angle_times_the_cosine():
    degrees, distance_m, radius_m = 70.0, 100.0, 0.4653  # the sun's own radius, 0.2666 degrees
    towards = np.array([np.sin(np.radians(degrees)), np.cos(np.radians(degrees)), 0.0])
    sun = disk(look_at(distance_m * towards, (0, 0, 0)), radius_m, matte(grey(0.0)), emitter={"type": "area"})
    truth = under_a_disk(distance_m * towards, -towards, radius_m)
    assert truth == pytest.approx(2 * np.pi * (1 - np.cos(np.radians(0.2666))) * towards[1], rel=1e-4)
    assert_is(truth, sun, 1e-4)


def test_a_constant_environment_gives_pi_within_the_derived_error():
    # A lamp under the plate, which can't light it, takes half of the samples of lights. One of the sky (density a over
    # the sphere, half of which is below) and one of the cosine c (density b), weighted by the power heuristic: their
    # variance by the midpoint rule. Stratified samples scatter less.
    c = (np.arange(100_000) + 0.5) / 100_000
    a, b = 0.5 / (4 * np.pi), c / np.pi
    light, cosine = c / np.pi / a * a**2 / (a**2 + b**2), b**2 / (a**2 + b**2)
    first, second = light.mean() / 4, (2 * c * cosine).mean()  # density of c over the hemisphere: 1, and 2 c
    assert first + second == pytest.approx(1.0, abs=1e-9)
    variance = (light**2).mean() / 4 - first**2 + (2 * c * cosine**2).mean() - second**2
    error = np.sqrt(variance / PATHS)
    lamp = disk(floor(0, -1, 0), 0.1, matte(grey(0.0)), emitter={"type": "area"})
    for seen in (
        metered({"sky": {"type": "constant"}, "lamp": lamp}, seed=3),
        metered({"sky": {"type": "constant"}}, seed=3),  # may take a shorter way, of less error
    ):
        assert seen / np.pi == pytest.approx(np.ones(4), abs=norm.isf(FALSE_ALARM / 2 / 2) * error)
    assert error < 6e-4


def lit_plate(**options):
    scene = load("flat_field")
    return render(scene, (2, 3), wavelength_nm=BANDS_NM, spp=1, **options)


@pytest.fixture
def loads(monkeypatch):
    """Counts how often a scene is loaded with its meter, from outside of what traces it."""
    made = []
    original = meter.load_groups
    monkeypatch.setattr(meter, "load_groups", lambda *given, **how: made.append(given) or original(*given, **how))
    return made


def test_nothing_is_traced_before_lux_are_asked_for_and_then_once(loads):
    made = lit_plate()
    made.relight(luminance_cd_m2=3.0)
    made.level()
    assert not loads
    made.relight(illuminance_lux=3.0)
    made.relight(illuminance_lux=30.0)
    replace(made, groups=dict(made.groups)).illuminance_lux(1.0)
    assert len(loads) == 1
    lit_plate(resume=made).illuminance_lux(1.0)
    assert len(loads) == 1, "a result that is gone on from keeps what it measured"


def test_a_folder_of_renders_keeps_the_irradiance(tmp_path, loads):
    made = lit_plate(cache=tmp_path)
    renders = set(tmp_path.iterdir())
    first = made.irradiance
    (kept,) = set(tmp_path.iterdir()) - renders
    other_size = render(load("flat_field"), (5, 4), wavelength_nm=BANDS_NM, spp=2, cache=tmp_path)
    assert np.array_equal(first, other_size.irradiance)
    assert np.array_equal(first, lit_plate(cache=tmp_path).irradiance)
    assert len(loads) == 1
    kept.write_bytes(kept.read_bytes()[:-1])
    assert np.array_equal(first, lit_plate(cache=tmp_path).irradiance)
    assert len(loads) == 2, "a damaged file is made again"


@pytest.mark.thorough
def test_the_error_told_is_the_scatter_over_seeds():
    """The mean of the squared errors told, over the variance of 24 seeds: a ratio of chi-squared to its expectation."""
    count, lights = 24, {"point": {"type": "point", "position": [0.1, 0.3, 0.0]}, "sky": {"type": "constant"}}
    scene = metered_scene(lights)
    levels = [
        render(scene, (1, 1), wavelength_nm=BANDS_NM, spp=1, seed=seed).meter().level(np.full((1, 4), 0.25))
        for seed in range(count)
    ]
    values = np.array([level.value for level in levels])
    told = np.mean([(level.relative_error * level.value) ** 2 for level in levels])
    low, high = (chi2.ppf(tail, count - 1) / (count - 1) for tail in (FALSE_ALARM / 2, 1 - FALSE_ALARM / 2))
    assert low < values.var(ddof=1) / told < high
