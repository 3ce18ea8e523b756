"""Scenes of several lights: sun and sky in their true proportion, a dark half beside a lit one, a street by night."""

from dataclasses import replace

import numpy as np
import pytest
from outside_truth import colour_science
from scipy.stats import norm

from render.engine import render
from render.geometry import look_at, to_world
from render.spectrum import Spectrum, luminance
from scenes import lit_and_shadowed, night_street, still_life_outdoor
from scenes.catalog import load

FALSE_ALARM = 1e-5
BANDS_NM = np.arange(430.0, 780.0, 100.0)  # four bands fill 380-780 nm


def test_the_suns_beam_is_the_tables_and_its_disk_has_the_suns_size():
    table = colour_science().plotting.datasets.SD_ASTMG173_DIRECT_CIRCUMSOLAR
    nm, width_nm = np.arange(360.5, 830.0), np.ones(470)
    beam_lux = luminance(Spectrum(table.wavelengths, table.values).band_average(nm, width_nm), nm, width_nm)
    assert pytest.approx(float(beam_lux), rel=1e-3) == still_life_outdoor.SUN_BEAM_LUX
    assert pytest.approx(6.80e-5, rel=1e-3) == still_life_outdoor.SUN_SR  # pi (radius over distance)^2
    groups = load("still_life_outdoor").groups
    assert 1.3e9 < groups["sun"].power < 1.6e9
    assert groups["sky"].power * np.pi == pytest.approx(13_454.0, rel=1e-3)


@pytest.mark.thorough
def test_the_sun_lights_the_table_unblocked_with_its_solid_angle_times_the_cosine():
    scene = load("still_life_outdoor")
    corner, above = np.array([-0.22, 0.0002, 0.50]), np.array([-0.22, 1.2, 0.51])  # the meter card
    camera = scene.geometry["sensor"] | {"fov": 3.0, "to_world": to_world(look_at(above, corner))}
    geometry = {key: node for key, node in scene.geometry.items() if key != "sky"} | {"sensor": camera}
    sun = replace(scene, geometry=geometry, groups={"sun": scene.groups["sun"]}, reference_plane=None)
    made = render(sun, (6, 6), wavelength_nm=BANDS_NM, width_nm=10.0, spp=64, max_depth=2, seed=1)
    values = np.array(geometry["meter_card"]["bsdf"]["bsdf"]["reflectance"]["values"].split(","), dtype=float)
    reflectance = Spectrum(np.arange(380.0, 781.0, 5.0), values).band_average(BANDS_NM, 10.0)
    height, bearing = np.radians([still_life_outdoor.SUN_HEIGHT_DEG, still_life_outdoor.SUN_BEARING_DEG])
    towards = np.array([-np.sin(bearing) * np.cos(height), np.sin(height), np.cos(bearing) * np.cos(height)])
    way = 100.0 * towards - corner  # the sun is aimed at the middle of the table, half a metre off
    distance = np.linalg.norm(way)
    solid_angle = np.pi * (100.0 * np.tan(np.radians(0.2666))) ** 2 * (way @ towards) / distance**3
    expected = reflectance / np.pi * solid_angle * way[1] / distance
    error = np.sqrt(made.variance[0, 0].sum(dtype=np.float64)) / 36
    # A path's wavelength is jittered over 10 nm, across which the reflectance rises by 4 %: 3e-4 over 2304 paths.
    assert error < 5e-3 * expected[0]
    bound = norm.isf(FALSE_ALARM / 2 / 4) * error / made.radiance[0, 0].mean()
    assert made.radiance[0].mean(axis=(1, 2)) == pytest.approx(expected, rel=bound + 1e-3)


def test_the_dark_half_is_scotopic_and_the_lit_one_photopic():
    assert lit_and_shadowed.DARK_CD_M2 < 0.005  # CIE 191:2010
    assert lit_and_shadowed.LIT_CD_M2 > 5.0
    groups = load("lit_and_shadowed").groups
    assert set(groups) == {"night", "lamp"}
    doubled = load("lit_and_shadowed", dark_cd_m2=0.004, lit_cd_m2=50.0).groups
    assert [doubled[name].power / groups[name].power for name in groups] == pytest.approx([2.0, 2.0])


def test_the_street_has_four_lights_of_their_stated_fluxes():
    groups = load("night_street").groups
    assert set(groups) == {"moon", "sodium", "led", "window"}
    assert groups["moon"].power * np.pi * np.radians(0.259) ** 2 == pytest.approx(0.25, rel=1e-4)
    assert groups["sodium"].power * np.pi * 0.08 == pytest.approx(4800.0)
    assert groups["led"].power * np.pi * 0.08 == pytest.approx(3200.0)
    assert groups["window"].power == night_street.WINDOW_CD_M2


@pytest.mark.slow
def test_the_street_holds_more_than_five_decades_and_shows_all_its_lights():
    made = render(load("night_street"), (96, 96), wavelength_nm=BANDS_NM, spp=64)
    assert (made.radiance.max(axis=(1, 2, 3)) > 0.1).all()  # unit emission fills a tenth of some pixel
    seen = made.relight().luminance()
    lit = seen[(seen > 0) & (made.coverage.mean == 0)]
    assert seen.max() / np.percentile(lit, 1) > 1e5
    moonlit = made.relight(powers={"sodium": 0.0, "led": 0.0, "window": 0.0}).luminance()[(made.coverage.mean == 0)]
    assert 1e-4 < np.median(moonlit[moonlit > 0]) < 0.05  # 0.25 lux on plaster or asphalt, or its reflection
