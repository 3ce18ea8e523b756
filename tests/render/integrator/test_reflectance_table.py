"""The table of reflectances against closed forms: offsets within bands, rows of curves, surfaces that get a row."""

from dataclasses import replace

import numpy as np
import pytest
from loop import loop
from scipy.stats import norm

from render.engine import render
from render.integrator.matte import STEPS, band_offsets, reflectance_table, with_rows
from render.scene import spectrum_node, uniform_node
from render.spectrum import Spectrum, flat, line_spectrum
from scenes.catalog import load
from scenes.reflectances import edge

FALSE_ALARM = 1e-5
RED, BLUE = (spectrum_node(edge(nm, 12, 0.05, 0.8)) for nm in (600, 450))
CHECKS = {"type": "checkerboard", "color0": RED, "color1": BLUE}


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
    scene = {"a": matte(RED), "in": {"type": "sphere", "b": matte(BLUE)}, "c": matte(dict(RED)), "d": matte(CHECKS)}
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
        {**CHECKS, "color1": uniform_node(0.0)},
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
