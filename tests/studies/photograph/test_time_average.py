"""Light of a scene that moves: the mean over times, its errors, and the blur of an edge in closed form."""

from dataclasses import replace

import numpy as np
import pytest
from builders import transport_of
from refusal import refusal

import rodcone as public
from render.engine import render
from render.error_estimates import Halves
from render.geometry import camera, translate
from render.illuminants import illuminant
from render.scene import LightGroup, Scene
from rodcone.digests import digest_inputs
from scenes.catalogue import load
from scenes.materials import matte, panel
from scenes.reflectances import grey
from sensor.photodiodes import binned
from sensor.presets import low_noise
from studies.photograph.moments import moments_s, rolling_average, rolling_moments, time_average

NM, WIDTH = np.array([500.0, 600.0]), np.array([20.0, 20.0])
GROUPS = {"lamp": LightGroup((), illuminant("A"))}


def light_of(seed, **changes):
    values = np.random.default_rng(seed).uniform(0.5, 1.5, (1, 2, 4, 6)).astype(np.float32)
    halves = Halves(values, np.float32(0.1) * values[::-1])
    made = {"light": halves, "variance": values**2, "seconds": 2.0, "relative_mc_error": 0.1, **changes}
    return transport_of(values, GROUPS, NM, WIDTH, irradiance=np.full((1, 2), seed + 1.0), **made)


def test_the_times_of_an_exposure_are_the_middles_of_its_parts():
    assert moments_s(0.1, 4) == pytest.approx([0.0125, 0.0375, 0.0625, 0.0875])
    refusal(moments_s, 0.1, 0, match="count: 0")


def test_the_light_is_the_mean_and_its_variance_the_mean_variance_over_the_times():
    each = [light_of(seed) for seed in range(3)]
    made = time_average(iter(each))
    for part in ("mean", "difference"):
        expected = np.mean([getattr(x.light, part) for x in each], axis=0)
        assert getattr(made.light, part) == pytest.approx(expected, rel=1e-6)
    assert made.variance == pytest.approx(np.mean([x.variance for x in each], axis=0) / 3, rel=1e-6)
    assert (made.spp, made.seconds) == (3 * 64, 6.0)
    assert made.relative_mc_error == pytest.approx(0.1 / 3**0.5)
    assert made.irradiance == pytest.approx(np.full((1, 2), 2.0))
    means = np.mean([x.relight(powers={"lamp": 7.0}).luminance() for x in each], axis=0)
    assert made.relight(powers={"lamp": 7.0}).luminance() == pytest.approx(means, rel=1e-6)
    assert made.level(powers={"lamp": 7.0}).value == pytest.approx(means.mean(), rel=1e-6)


def test_one_time_is_its_own_light():
    one = light_of(5)
    assert np.array_equal(time_average([one]).radiance, one.radiance)
    assert np.array_equal(time_average([one]).counts, one.counts)


def test_light_that_is_not_of_one_scene_is_refused():
    refusal(time_average, [], match="transports: none given")
    refusal(public.time_average, [3], match=r"transports\[0\]: an int is none")
    refusal(public.time_average, 3, match="give a list or a generator")
    other = replace(light_of(1), wavelength_nm=NM + 1)
    refusal(time_average, [light_of(0), other], match=r"transports\[1\].*render all alike")


ROWS, COLUMNS, SPEED_PX_S = 24, 60, 300.0


def upright_edge(time_s):
    """Light left of an upright edge that moves to the right, area-sampled: a row's sum is the edge's place."""
    place = 10.0 + SPEED_PX_S * time_s
    row = np.clip(place - np.arange(COLUMNS), 0.0, 1.0)
    values = np.broadcast_to(row, (1, 2, ROWS, COLUMNS)).astype(np.float32)
    light = Halves(values, np.float32(0.1) * values)
    return transport_of(values, GROUPS, NM, WIDTH, light=light, variance=values**2 + np.float32(1.0))


@pytest.mark.parametrize("row_time_us", [1000.0, -1000.0])
@pytest.mark.parametrize("exposure_s", [0.002, 0.02])
def test_an_upright_edge_that_moves_is_slanted_by_speed_times_row_time(row_time_us, exposure_s):
    """Closed form: each row's edge lies where it is in the middle of the row's own exposure."""
    rolling = replace(low_noise(), row_time_us=row_time_us)
    times_s, shares = rolling_moments(rolling, ROWS, exposure_s, 40)
    made = rolling_average((upright_edge(float(time_s)) for time_s in times_s), shares)
    places = made.radiance[0, 0].sum(axis=1)
    starts_s = np.arange(ROWS)[:: 1 if row_time_us > 0 else -1] * 1e-3
    middles = 10.0 + SPEED_PX_S * (starts_s + exposure_s / 2)
    inner = (starts_s >= times_s[0]) & (starts_s + exposure_s <= times_s[-1])
    assert inner.sum() >= ROWS - 2
    np.testing.assert_allclose(places[inner], middles[inner], atol=2e-5)
    lean = np.diff(places)[inner[1:] & inner[:-1]]
    np.testing.assert_allclose(lean, SPEED_PX_S * row_time_us * 1e-6, atol=3e-5)
    # A row at either end loses the half part before the first time or after the last: at most an eighth of its way.
    lost = SPEED_PX_S * (times_s[1] - times_s[0]) ** 2 / 8 / exposure_s
    np.testing.assert_allclose(places, middles, atol=lost + 2e-5)


def test_a_row_s_errors_are_those_of_its_shares():
    times_s, shares = rolling_moments(replace(low_noise(), row_time_us=1000.0), ROWS, 0.004, 5)
    made = rolling_average((upright_edge(float(time_s)) for time_s in times_s), shares)
    each = [upright_edge(float(time_s)) for time_s in times_s]
    for found, parts, powers in (
        (made.radiance, [x.radiance for x in each], 1),
        (made.light.difference, [x.light.difference for x in each], 1),
        (made.variance, [x.variance for x in each], 2),
    ):
        expected = np.einsum("kr,kgbrx->gbrx", shares**powers, np.array(parts))
        np.testing.assert_allclose(found, expected, atol=1e-6)
    assert np.all(made.counts <= sum(x.counts for x in each))


@pytest.mark.parametrize("count", [1, 2, 7])
def test_rows_that_start_together_take_each_time_alike_and_all_rows_take_the_whole(count):
    for row_time_us in (0.0, 1e-6):
        times_s, shares = rolling_moments(replace(low_noise(), row_time_us=row_time_us), 6, 0.01, count)
        np.testing.assert_allclose(times_s, moments_s(0.01, count), rtol=1e-8)
        np.testing.assert_allclose(shares, 1 / count, rtol=1e-7)
    _, shares = rolling_moments(replace(low_noise(), row_time_us=700.0), 30, 0.003, count)
    np.testing.assert_allclose(shares.sum(axis=0), 1.0, rtol=1e-12)
    assert shares.min() >= 0
    photodiodes = replace(binned(low_noise("quad_bayer"), "charge"), row_time_us=700.0)
    _, by_pixel = rolling_moments(photodiodes, 30, 0.003, count)
    np.testing.assert_array_equal(by_pixel[:, ::2], by_pixel[:, 1::2])


def white_half(time_s):
    """A glowing sheet 4 m wide whose right edge passes a camera at 1 m/s, 1 m in view on 32 pixels."""
    view = camera(2 * np.degrees(np.arctan(0.5 / 8 / 10.0)), (0, 0, 10.0), (0, 0, 0))  # of the 4 rows
    sheet = panel(translate(time_s - 2.0 - 0.25, 0, 0), 4.0, 4.0, matte(grey(0.5)), emitter={"type": "area"})
    lights = {"sheet": LightGroup(("sheet/emitter",), illuminant("E"))}
    return Scene("sheet", {"type": "scene", "sensor": view, "sheet": sheet}, lights)


@pytest.mark.thorough
def test_a_moving_edge_is_blurred_into_a_ramp_as_long_as_its_way():
    """Closed form: the share of the exposure for which the sheet has passed a place, over the pixel's width."""
    exposure_s, count = 0.5, 8
    made = time_average(
        render(white_half(float(time_s)), (4, 32), wavelength_nm=NM, width_nm=WIDTH, spp=64, seed=seed)
        for seed, time_s in enumerate(moments_s(exposure_s, count))
    )
    profile = made.radiance[0].mean(axis=(0, 1)) / made.radiance.max()
    edges = np.linspace(-0.5, 0.5, 33)
    # The edge starts at -0.25 m and moves to 0.25 m: each step is one pixel's width.
    passed = np.clip((0.25 - (edges[:-1] + edges[1:]) / 2) / exposure_s, 0.0, 1.0)
    assert np.abs(profile - passed).max() < 0.5 / count + 0.01
    assert profile.mean() == pytest.approx(passed.mean(), abs=0.003)


@pytest.mark.thorough
def test_the_stated_variance_is_the_scatter_of_averages_of_other_seeds():
    """24 means of three renders: sums over 64 pixels, whose ratio scatters by some 10 % (a forgotten 1 / k: by 3)."""
    size, scene = (8, 8), load("cornell_box")
    seeds = np.arange(72).reshape(24, 3)
    made = [
        time_average(render(scene, size, wavelength_nm=NM, width_nm=WIDTH, spp=8, seed=int(seed)) for seed in three)
        for three in seeds
    ]
    scatter = np.var([x.radiance for x in made], axis=0, ddof=1).sum()
    stated = np.mean([x.variance for x in made], axis=0).sum()
    assert scatter == pytest.approx(stated, rel=0.35)
    assert {x.spp for x in made} == {24.0}


def test_the_walker_moves_and_the_street_stays():
    early, late = load("walker"), load("walker", time_s=0.5)
    nodes = early.geometry
    moved = {key for key in nodes if digest_inputs([nodes[key]]) != digest_inputs([late.geometry[key]])}
    assert moved == {key for key in early.geometry if key.startswith("walker_")}
    street = load("night_street").geometry
    assert digest_inputs([{key: early.geometry[key] for key in street}]) == digest_inputs([street])
    assert late.geometry["walker_head"]["center"][0] - early.geometry["walker_head"]["center"][0] == pytest.approx(0.7)
