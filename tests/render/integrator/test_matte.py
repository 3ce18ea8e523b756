"""The dense path's Lambertian surface against Mitsuba's own, direction by direction; and which surfaces become it."""

import numpy as np
import pytest
from loop import loop

from render.integrator.matte import TableReader, reflectance_table, with_matte_surfaces, with_rows
from render.loader import as_guest, mitsuba_module
from rodcone.jit import dr
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


@as_guest()
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
