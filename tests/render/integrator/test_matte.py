"""The dense path's Lambertian surface against Mitsuba's own, direction by direction; and which surfaces become it."""

from dataclasses import replace

import numpy as np
import pytest
from loop import loop
from scipy.stats import norm

from render.engine import render
from render.integrator.matte import STEPS, TableReader, band_offsets, reflectance_table, with_matte_surfaces, with_rows
from render.loader import mitsuba_module, own_mitsuba_variant
from render.scene import spectrum_node, uniform_node
from render.spectrum import Spectrum, flat, line_spectrum
from rodcone.jit import dr
from scenes.catalogue import load
from scenes.materials import checks, printed
from scenes.reflectances import edge, grey

RAMP = {"type": "regular", "wavelength_min": 380.0, "wavelength_max": 780.0, "values": "0.1,0.8"}
DIFFUSE = {"type": "diffuse", "reflectance": RAMP}
TWOSIDED = {"type": "twosided", "bsdf": DIFFUSE}
COUNT = 400


@pytest.fixture(scope="module")
def situation():
    """Interactions with directions of either side, directions towards a light, and random numbers."""
    mi, rng = mitsuba_module(), np.random.default_rng(1)
    directions = rng.normal(size=(2, 3, COUNT))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    directions[0, 2, :3], directions[1, 2, 3:6] = 0.0, 0.0  # along the surface
    si = dr.zeros(mi.SurfaceInteraction3f, COUNT)
    si.wi = mi.Vector3f(*directions[0].astype(np.float32))
    si.wavelengths = mi.Spectrum(400.0, 500.0, 600.0, 750.0)
    return si, mi.Vector3f(*directions[1].astype(np.float32)), mi.Point2f(*rng.random((2, COUNT)).astype(np.float32))


@loop("stock", [DIFFUSE, TWOSIDED])
def test_value_density_and_sample_are_those_of_mitsuba(stock, situation):
    mi, (si, wo, numbers) = mitsuba_module(), situation
    own, other = mi.load_dict(with_matte_surfaces({"bsdf": stock})["bsdf"]), mi.load_dict(stock)
    context = mi.BSDFContext()
    assert np.asarray(own.eval(context, si, wo)) == pytest.approx(np.asarray(other.eval(context, si, wo)), rel=1e-5)
    assert np.asarray(own.pdf(context, si, wo)) == pytest.approx(np.asarray(other.pdf(context, si, wo)), rel=1e-5)
    sample, weight = own.sample(context, si, 0.5, numbers)
    expected, expected_weight = other.sample(context, si, 0.5, numbers)
    assert np.asarray(weight) == pytest.approx(np.asarray(expected_weight), rel=1e-5)
    kept = np.asarray(expected_weight)[0] > 0  # Mitsuba gives a density also where it gives no weight
    assert 0.3 * COUNT < kept.sum() <= COUNT
    assert np.asarray(sample.pdf)[kept] == pytest.approx(np.asarray(expected.pdf)[kept], rel=1e-5)
    assert np.array_equal(np.asarray(sample.pdf) > 0, kept)
    assert np.asarray(sample.wo)[:, kept] == pytest.approx(np.asarray(expected.wo)[:, kept], abs=1e-6)
    for part in ("sampled_type", "sampled_component", "eta"):
        own_part, other_part = (np.broadcast_to(np.asarray(getattr(x, part)), COUNT)[kept] for x in (sample, expected))
        assert np.array_equal(own_part, other_part), part


@loop("stock", [DIFFUSE, TWOSIDED])
def test_all_bands_at_once_are_the_bands_one_by_one(stock, situation):
    mi, (si, wo, numbers) = mitsuba_module(), situation
    own, context = mi.load_dict(with_matte_surfaces({"bsdf": stock})["bsdf"]), mi.BSDFContext()
    groups = [mi.Spectrum(400.0, 420.0, 440.0, 460.0), mi.Spectrum(500.0, 600.0, 700.0, 770.0)]
    values, density, sample, weights = own.scatter_bands(si, wo, numbers, groups, None, None)
    for group, value, weight in zip(groups, values, weights, strict=True):
        si.wavelengths = group
        assert np.asarray(value) == pytest.approx(np.asarray(own.eval(context, si, wo)), rel=1e-5, abs=1e-9)
        one, one_weight = own.sample(context, si, 0.5, numbers)
        assert np.asarray(weight) == pytest.approx(np.asarray(one_weight), rel=1e-5)
        assert np.array_equal(np.asarray(sample.wo), np.asarray(one.wo))
    assert np.asarray(density) == pytest.approx(np.asarray(own.pdf(context, si, wo)), rel=1e-6)


CHECKS = {
    "type": "checkerboard",
    "color0": RAMP,
    "color1": {"type": "regular", "wavelength_min": 380.0, "wavelength_max": 780.0, "values": "0.9,0.3,0.2"},
}


@pytest.mark.parametrize("twosided", [False, True], ids=["one side", "two sides"])
@pytest.mark.parametrize("reflectance", [RAMP, CHECKS], ids=["plain", "checks"])
def test_reflectance_read_from_the_table_is_that_of_the_texture(reflectance, twosided, situation):
    mi, (si, wo, numbers) = mitsuba_module(), situation
    bsdf = {"type": "diffuse", "reflectance": reflectance}
    node, curves = with_rows(with_matte_surfaces({"bsdf": {"type": "twosided", "bsdf": bsdf} if twosided else bsdf}))
    rng = np.random.default_rng(3)
    nm, step = rng.uniform(370.0, 790.0, (16, 8)), rng.integers(0, 16, COUNT)  # 380-780 nm is known
    reader = TableReader(mi, reflectance_table(curves, nm))
    si.uv = mi.Point2f(*rng.random((2, COUNT)).astype(np.float32))
    groups = [mi.Spectrum(*nm[step, first : first + 4].T.astype(np.float32)) for first in (0, 4)]
    surface, stock = mi.load_dict(node["bsdf"]), mi.load_dict(with_matte_surfaces({"bsdf": bsdf})["bsdf"])
    surface_of_stock = stock.reflectance
    values, density, sample, weights = surface.scatter_bands(si, wo, numbers, groups, reader, mi.UInt32(step))
    for group, value, weight in zip(groups, values, weights, strict=True):
        si.wavelengths = group
        expected = np.asarray(surface_of_stock.eval(si)) * (np.asarray(sample.pdf) > 0)
        assert len(np.unique(np.round(expected, 3))) > 20
        assert np.asarray(weight) == pytest.approx(expected, rel=1e-5, abs=2e-6)
        assert np.asarray(value) == pytest.approx(expected * np.asarray(density), rel=1e-5, abs=2e-6)


PRINT = printed("camera", edge(600, 12, 0.05, 0.3), grey(0.8), 3.0, 20.0)
CHEQUERED = printed("camera", grey(0.05), grey(0.8), 3.0, 20.0)
CHEQUERED["bsdf"]["a"] = checks(grey(0.3), grey(0.6), 4.0, 4.0)["bsdf"]


@own_mitsuba_variant()
@loop(("stock", "rows"), [(PRINT, True), (CHEQUERED, False)])
def test_a_picture_mixes_two_reflectances_as_mitsuba_s_blend_does(stock, rows, situation):
    """From the table where both have rows; checks under it are evaluated."""
    mi, (si, wo, numbers) = mitsuba_module(), situation
    node, curves = with_rows(with_matte_surfaces({"bsdf": stock}))
    assert (node["bsdf"]["type"], {"row", "other_row", "twosided"} < node["bsdf"].keys()) == ("matte", rows)
    nm, step = np.array([[450.0, 500.0, 600.0, 700.0]] * 16), np.zeros(COUNT, np.uint32)
    si.uv = mi.Point2f(*np.random.default_rng(3).random((2, COUNT)).astype(np.float32))
    si.wavelengths = mi.Spectrum(450.0, 500.0, 600.0, 700.0)
    reader = TableReader(mi, reflectance_table(curves or (grey(0.5),), nm))
    surface, blend = mi.load_dict(node["bsdf"]), mi.load_dict(stock)
    expected = np.asarray(blend.eval(mi.BSDFContext(), si, wo))
    assert expected.max() > 0.1
    (value,), _, _, _ = surface.scatter_bands(si, wo, numbers, [si.wavelengths], reader, mi.UInt32(step))
    assert np.asarray(value) == pytest.approx(expected, rel=1e-4, abs=2e-6)
    assert np.asarray(surface.eval(mi.BSDFContext(), si, wo)) == pytest.approx(expected, rel=1e-4, abs=2e-6)


def test_lambertian_surfaces_become_it_wherever_they_stand():
    scene = {"type": "scene", "ball": {"type": "sphere", "skin": DIFFUSE}, "shared": {**TWOSIDED, "id": "shared"}}
    made = with_matte_surfaces(scene)
    assert made["ball"]["skin"] == {"type": "matte", "reflectance": RAMP}
    assert made["shared"] == {"type": "matte", "reflectance": RAMP, "twosided": True, "id": "shared"}
    assert scene["ball"]["skin"] is DIFFUSE


@loop(
    "node",
    [
        {"type": "diffuse"},  # Mitsuba's default reflectance
        {"type": "diffuse", "reflectance": 0.5},
        {"type": "twosided", "front": DIFFUSE, "back": DIFFUSE},
        {"type": "roughplastic", "diffuse_reflectance": RAMP},
        {"type": "twosided", "bsdf": {"type": "conductor"}},
    ],
)
def test_other_surfaces_stay_what_they_are(node):
    kept = with_matte_surfaces({"bsdf": node})["bsdf"]
    assert kept["type"] == node["type"]
    assert set(kept) == set(node)


# The table of reflectances against closed forms: offsets within bands, rows of curves, surfaces that get a row.


FALSE_ALARM = 1e-5
RED, BLUE = (spectrum_node(edge(nm, 12, 0.05, 0.8)) for nm in (600, 450))
TWO_COLOURS = {"type": "checkerboard", "color0": RED, "color1": BLUE}


def matte(reflectance):
    return {"type": "matte", "reflectance": reflectance, "twosided": True}


@loop("seed", [0, 1, 2**32 - 1])
def test_each_step_has_a_place_in_its_own_part_of_the_band_and_their_mean_is_the_centre(seed):
    offsets = band_offsets(seed)
    assert offsets.shape == (STEPS,)
    assert np.array_equal(np.floor((offsets + 0.5) * STEPS), np.arange(STEPS))
    assert abs(offsets.mean()) < 1e-15
    assert np.array_equal(offsets, band_offsets(seed))


def test_a_pass_averages_the_steepest_reflectance_to_a_ten_thousandth():
    curve, nm = edge(600, 12, 0.05, 0.75), np.arange(385.0, 780.0, 10.0)
    exact = curve.band_average(nm, 10.0)
    for seed in range(50):
        found = reflectance_table((curve,), nm + 10.0 * band_offsets(seed)[:, None])[0].mean(axis=0, dtype=np.float64)
        assert np.abs(found - exact).max() < 1e-4
    assert exact.max() - exact.min() > 0.6


def test_the_table_holds_each_curve_at_each_wavelength_and_zero_outside():
    ramp, flat = (
        Spectrum(np.array([400.0, 500.0]), np.array([0.0, 1.0])),
        Spectrum(np.array([100.0, 999.0]), np.ones(2)),
    )
    nm = np.array([[390.0, 400.0, 450.0, 475.0], [500.0, 500.1, 425.0, 410.0]])
    table = reflectance_table((ramp, flat), nm)
    assert table.dtype == np.float32
    assert table[0] == pytest.approx(np.array([[0.0, 0.0, 0.5, 0.75], [1.0, 0.0, 0.25, 0.1]]), rel=1e-6)
    assert np.array_equal(table[1], np.ones((2, 4)))


def test_surfaces_get_the_row_of_their_curve_and_equal_curves_share_one():
    scene = {
        "a": matte(RED),
        "in": {"type": "sphere", "b": matte(BLUE)},
        "c": matte(dict(RED)),
        "d": matte(TWO_COLOURS),
    }
    made, curves = with_rows(scene)
    assert [made["a"]["row"], made["in"]["b"]["row"], made["c"]["row"]] == [0, 1, 0]
    assert (made["d"]["row"], made["d"]["other_row"]) == (0, 1)
    assert made["d"]["which"] == {"type": "checkerboard", "color0": uniform_node(0.0), "color1": uniform_node(1.0)}
    for curve, nm in zip(curves, (600, 450), strict=True):
        expected = edge(nm, 12, 0.05, 0.8)
        assert curve.wavelength_nm == pytest.approx(expected.wavelength_nm, rel=1e-12)
        assert np.array_equal(curve.values, expected.values)
    assert "row" not in scene["a"]


@loop(
    "reflectance",
    [
        uniform_node(0.0),
        {"type": "bitmap", "filename": "x.png"},
        {**TWO_COLOURS, "color1": uniform_node(0.0)},
        {**RED, "to_uv": 1},
    ],
)
def test_other_textures_are_left_as_they_are(reflectance):
    made, curves = with_rows({"a": matte(reflectance), "b": {"type": "roughplastic", "reflectance": RED}})
    assert made == {"a": matte(reflectance), "b": {"type": "roughplastic", "reflectance": RED}}
    assert curves == ()


def test_a_line_in_a_light_of_its_own_colour_is_met_anew_by_each_path():
    """A line of 0.1 nm in a band of 1 nm: 16 wavelengths a pass would miss it in most passes."""
    scene, line = load("flat_field"), line_spectrum([589.0], [2.0])
    sky = {"type": "constant", "radiance": spectrum_node(line)}
    own = replace(scene.groups["sky"], spectrum=flat(), coloured=True)
    scene = replace(scene, geometry=scene.geometry | {"sky": sky}, groups={"sky": own})
    made = render(scene, (24, 32), wavelength_nm=[589.0], width_nm=1.0, spp=64)
    # 2 W m^-2 sr^-1 in the line and a wall of 0.5. A triangle's square over its mean's: 4/3 x 1 nm / 0.1 nm.
    error = np.sqrt((4 / 3 * 10 - 1) / made.radiance.size / 64)
    assert made.radiance.mean(dtype=np.float64) == pytest.approx(1.0, rel=norm.isf(FALSE_ALARM / 2) * error)
