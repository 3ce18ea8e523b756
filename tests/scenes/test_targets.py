"""Targets that have closed forms: a furnace that is 1, an edge of known lean and contrast, a star of counted spokes.

By chance each statistical test may fail at most `FALSE_ALARM` of the time, over all its comparisons; seeds are fixed.
"""

from dataclasses import replace

import numpy as np
import pytest
from loop import loop
from outside_truth import colour_science
from scipy.stats import norm
from scipy.stats import t as student

from render.engine import render
from render.geometry import look_at, to_world
from render.spectrum import Spectrum, luminance
from scenes import lit_and_shadowed, night_street, still_life_outdoor
from scenes.catalogue import load
from scenes.contrast_patches import patch_pairs
from scenes.cornell_box import paint
from scenes.dead_leaves import chart
from scenes.oecf import grey_scale
from scenes.siemens_star import RADIUS_M

FALSE_ALARM = 1e-5
BANDS_NM = np.arange(430.0, 780.0, 100.0)  # four bands fill 380-780 nm
PASSES = 8


def test_every_pixel_and_band_of_the_furnace_is_one_within_its_error():
    made = render(load("furnace"), (16, 16), wavelength_nm=BANDS_NM, spp=256, seed=1)
    radiance, error = made.radiance[0].astype(np.float64), np.sqrt(made.variance[0].astype(np.float64))
    # Under a constant environment a path that leaves for it brings 1 whatever its direction: exact but where a path
    # that meets ball and block again ends by chance.
    sky = error.max(axis=0) < 1e-6
    assert 0.02 < (~sky).mean() < 0.5
    assert radiance[:, sky] == pytest.approx(np.ones((4, sky.sum())), abs=1e-6)
    z = ((radiance - 1) / np.where(sky, 1, error))[:, ~sky]
    assert np.abs(z).max() < student.isf(FALSE_ALARM / 2 / z.size, PASSES - 1)
    mean_error = np.sqrt((error[0][~sky] ** 2).sum()) / (~sky).sum()
    assert mean_error < 1e-3
    assert abs(radiance[0][~sky].mean() - 1) < norm.isf(FALSE_ALARM / 2) * mean_error
    # Rays from the block that meet the ball or itself find 1 too, within the noise of paths.
    assert made.irradiance / np.pi == pytest.approx(np.ones((1, 4)), abs=5e-3)


@loop(("contrast", "angle_deg"), [(4.0, 5.0), (20.0, -8.0)])
def test_the_edge_has_its_contrast_and_leans_by_its_angle(contrast, angle_deg):
    scene = load("slanted_edge", contrast=contrast, angle_deg=angle_deg)
    made = render(scene, (40, 40), wavelength_nm=BANDS_NM, spp=256, seed=2)
    picture = made.radiance[0].mean(axis=0, dtype=np.float64)
    error = np.sqrt(made.variance[0, 0].mean(dtype=np.float64))  # bands share their paths
    dark, bright = picture[:, :8].mean(), picture[:, -8:].mean()
    assert bright == pytest.approx(0.6, abs=norm.isf(FALSE_ALARM / 2) * error / np.sqrt(320))
    assert dark == pytest.approx(0.6 / contrast, abs=norm.isf(FALSE_ALARM / 2) * error / np.sqrt(320))
    dark_pixels = ((bright - picture) / (bright - dark)).sum(axis=1)
    rows = np.arange(40) - 19.5
    slope, middle = np.polyfit(rows, dark_pixels, 1)
    row_error = np.sqrt(40) * error / (bright - dark)
    bound = norm.isf(FALSE_ALARM / 4)
    assert slope == pytest.approx(np.tan(np.radians(angle_deg)), abs=bound * row_error / np.sqrt((rows**2).sum()))
    assert middle == pytest.approx(20.0, abs=bound * row_error / np.sqrt(40))
    assert bound * row_error / np.sqrt((rows**2).sum()) < np.tan(np.radians(0.5))  # sees half a degree


def test_the_grey_scale_s_patches_have_the_cube_root_steps_of_the_standard():
    """12 patches clockwise from the top; the reflectance of a middle one by hand: ((0.9^1/3 + 0.009^1/3) / 2)^3."""
    scene = load("oecf", patches=13)
    assert grey_scale(13, 100.0)[6] == pytest.approx(((0.9 ** (1 / 3) + 0.009 ** (1 / 3)) / 2) ** 3)
    made = render(scene, (50, 50), wavelength_nm=BANDS_NM, spp=16, seed=5)
    picture, error = made.radiance[0].mean(axis=0, dtype=np.float64), np.sqrt(made.variance[0, 0].max())
    bound = norm.isf(FALSE_ALARM / 2 / 14) * max(error, 1e-6)
    for index, reflectance in enumerate(grey_scale(13, 100.0)):
        turn = 2 * np.pi * index / 13
        row, column = 25 - 17 * np.cos(turn), 25 + 17 * np.sin(turn)  # 1 cm a pixel
        assert picture[int(row), int(column)] == pytest.approx(reflectance, abs=bound)
    assert picture[24, 24] == pytest.approx(0.18, abs=bound)
    assert grey_scale(12, 1000.0)[0] / grey_scale(12, 1000.0)[-1] == pytest.approx(1000.0)


def test_the_contrast_patches_have_the_reflectances_of_their_pairs():
    """In the middle of each patch; 64 pixels, each patch 9 wide."""
    made = render(load("contrast_patches"), (64, 64), wavelength_nm=BANDS_NM, spp=16, seed=7)
    picture = made.radiance[0].mean(axis=0, dtype=np.float64)
    for pair in patch_pairs():
        for column, sign in ((pair.bright_column, 1), (pair.dark_column, -1)):
            seen = picture[int(pair.row * 64), int(column * 64)]
            assert seen == pytest.approx(pair.mean * (1 + sign * pair.contrast), rel=1e-3)  # the sky is even
    assert picture[1, 1] == pytest.approx(0.18, rel=1e-3)


def test_dead_leaves_are_the_chart_that_their_seed_draws():
    """Pixels are means of 32 x 32 squares, within the error of their paths; another seed draws another chart."""
    made = render(load("dead_leaves", seed=4), (32, 32), wavelength_nm=BANDS_NM, spp=256, seed=6)
    picture, error = (np.asarray(x, np.float64) for x in (made.radiance[0, 0], np.sqrt(made.variance[0, 0])))
    expected = chart(4).reshape(32, 32, 32, 32).mean(axis=(1, 3))
    assert np.abs(picture - expected).max() < 0.03  # 256 paths in strata; 0.6 at a chart turned over
    assert abs(picture.mean() - expected.mean()) < norm.isf(FALSE_ALARM / 2) * np.sqrt((error**2).sum()) / error.size
    assert np.abs(chart(4) - chart(5)).mean() > 0.2
    assert np.unique(chart(4)).size > 200


@loop("spokes", [9, 24])
def test_the_star_has_its_spokes_black_on_white(spokes):
    pixels = 96
    made = render(load("siemens_star", spokes=spokes), (pixels, pixels), wavelength_nm=BANDS_NM, spp=16, seed=3)
    picture = made.radiance[0].mean(axis=0, dtype=np.float64)
    pixel_m = 2 * 1.25 * np.tan(np.radians(10.0)) / pixels
    angle = (np.arange(4 * 360) + 0.5) * np.pi / 720
    rings = []
    for share in (0.7, 0.95):
        radius = share * RADIUS_M / pixel_m  # a sector of 24 spokes is 3.6 pixels wide at 0.7
        column, row = pixels / 2 + radius * np.cos(angle), pixels / 2 - radius * np.sin(angle)
        rings.append(picture[row.astype(int), column.astype(int)] > 0.445)  # half way from 0.04 to 0.85
        assert np.count_nonzero(rings[-1] != np.roll(rings[-1], 1)) == 2 * spokes
        assert rings[-1].mean() == pytest.approx(0.5, abs=0.05)
    assert (rings[0] == rings[1]).mean() > 0.75  # spokes run straight out; half a pixel's error at each side
    assert np.percentile(picture, 2) == pytest.approx(0.04, rel=0.15)
    assert np.percentile(picture, 85) == pytest.approx(0.85, rel=0.05)


def test_the_cornell_boxs_paints_are_its_published_ones():
    at_nm = np.array([400.0, 500.0, 600.0, 700.0])
    published = {"white": [0.343, 0.747, 0.740, 0.737], "green": [0.092, 0.285, 0.160, 0.159]}
    for colour, values in (published | {"red": [0.040, 0.058, 0.287, 0.642]}).items():
        curve = paint(colour)
        assert np.interp(at_nm, curve.wavelength_nm, curve.values) == pytest.approx(values)
        assert curve.values[0] == values[0]
        assert curve.values[-1] == values[-1]


def test_the_cornell_box_is_red_on_the_left_green_on_the_right_and_white_between():
    made = render(load("cornell_box", light="E"), (32, 32), wavelength_nm=BANDS_NM, spp=64, seed=4)
    blue, green, _, red = made.radiance[0, :, 10:22, :].mean(axis=1, dtype=np.float64)
    left, right, back = red[2:5].mean() / green[2:5].mean(), red[27:30].mean() / green[27:30].mean(), red / green
    # Paints at 730 and 530 nm: red 0.64 / 0.06, green 0.16 / 0.47, white 0.74 / 0.73; light from wall to wall blurs it.
    assert left > 5
    assert right < 0.7
    assert 0.7 < back[16:24].mean() < 1.5
    assert (blue > 0).all()
    assert made.coverage.mean.any()


# Scenes of several lights: sun and sky in their true proportion, a dark half beside a lit one, a street by night.


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
