"""Light in the corners: the cosine's power by the scene's own camera, and a rim that cuts the pupil."""

from dataclasses import replace

import numpy as np
import pytest
from refusal import refusal

from render.radiance import SpectralRadiance
from sensor.capture import photograph_radiance
from sensor.config import LensConfig
from sensor.lens.illumination import darkens, falloff, framed, pupil_share
from sensor.optics import form_image
from sensor.presets import low_noise

NM = np.arange(400.0, 781.0, 40.0)
RIMS = [
    LensConfig(1.4, vignetting=lost, vignetting_from=start) for lost in (0.1, 0.6, 0.99) for start in (0.0, 0.4, 0.9)
]
BY_SCENE = LensConfig(2.8, falloff_power=4.0)


def even(view_deg=None) -> SpectralRadiance:
    return SpectralRadiance(np.ones((12, 16, NM.size)), NM, horizontal_view_deg=view_deg)


@pytest.mark.parametrize("lens", RIMS)
def test_corners_lose_what_is_stated_and_the_middle_nothing_up_to_the_rim_s_height(lens):
    assert pupil_share(np.array([1.0]), lens)[0] == pytest.approx(1 - lens.vignetting, abs=1e-9)
    assert pupil_share(np.array([0.0, lens.vignetting_from]), lens) == pytest.approx(1.0, abs=1e-9)
    rising = pupil_share(np.linspace(0, 1, 101), lens)
    assert np.all(np.diff(rising) <= 1e-12)
    assert rising.min() >= 0


def test_the_rim_s_share_is_that_of_places_in_the_pupil_that_it_leaves():
    lens = LensConfig(1.4, vignetting=0.6, vignetting_from=0.4)
    grid = (np.arange(2000) + 0.5) / 1000 - 1
    x, y = np.meshgrid(grid, grid)
    pupil = x**2 + y**2 < 1

    def seen(shift, height):
        return float(((x - shift * height) ** 2 + y**2 < (1 + shift * lens.vignetting_from) ** 2)[pupil].mean())

    # The one number left, by halving: the corners' loss.
    low, high = 0.0, 10.0
    for _ in range(30):
        middle = (low + high) / 2
        low, high = (middle, high) if seen(middle, 1.0) > 0.4 else (low, middle)
    for height in (0.45, 0.6, 0.8, 0.95):
        assert pupil_share(np.array([height]), lens)[0] == pytest.approx(seen(low, height), abs=2e-4)


def test_equal_circles_share_the_textbook_s_area():
    lens = LensConfig(1.4, vignetting=0.6, vignetting_from=0.0)
    # Two circles of radius 1, d apart: 2 arccos(d / 2) - d / 2 sqrt(4 - d^2).
    d = 0.8
    area = 2 * np.arccos(d / 2) - d / 2 * np.sqrt(4 - d**2)
    heights = np.linspace(0, 1, 20001)
    found = float(np.interp(-area / np.pi, -pupil_share(heights, lens), heights))
    twice = 2 * np.arccos(d) - d * np.sqrt(4 - 4 * d**2)
    assert pupil_share(np.array([2 * found]), lens)[0] == pytest.approx(twice / np.pi, abs=1e-6)


def test_height_is_counted_to_the_picture_s_corner_and_both_causes_multiply():
    shape, rim = (30, 40), LensConfig(1.4, vignetting=0.5, vignetting_from=0.2)
    light = falloff(rim, shape)
    away = np.hypot(*np.meshgrid(np.arange(40) - 19.5, np.arange(30) - 14.5)) / 25.0  # half of the diagonal
    np.testing.assert_allclose(light, pupil_share(away, rim), rtol=1e-12)
    natural = falloff(LensConfig(1.4, horizontal_view_deg=60.0), shape)
    np.testing.assert_array_equal(falloff(replace(rim, horizontal_view_deg=60.0), shape), natural * light)


def test_the_scene_s_own_camera_gives_the_angle_and_a_stated_one_goes_before_it():
    typed = replace(low_noise(), lens=replace(low_noise().lens, diffraction=0.0, horizontal_view_deg=50.0))
    own = replace(typed, lens=replace(typed.lens, horizontal_view_deg=0.0, falloff_power=4.0))
    np.testing.assert_array_equal(form_image(even(50.0), own).values, form_image(even(), typed).values)
    assert form_image(even(50.0), own).values[0, 0, 0] < 0.8 * form_image(even(50.0), own).values[6, 8, 0]
    raws = [photograph_radiance(even(50.0), sensor, 1e-4) for sensor in (own, typed)]
    np.testing.assert_array_equal(raws[0].dn, raws[1].dn)
    assert framed(own.lens, 50.0) == replace(own.lens, horizontal_view_deg=50.0)
    both = replace(own.lens, horizontal_view_deg=20.0)
    np.testing.assert_array_equal(falloff(both, (12, 16), 50.0), falloff(both, (12, 16)))
    softer = replace(own.lens, falloff_power=2.0)
    np.testing.assert_allclose(falloff(softer, (12, 16), 50.0) ** 2, falloff(own.lens, (12, 16), 50.0), rtol=1e-12)


def test_without_the_terms_a_scene_s_camera_changes_nothing():
    plain = LensConfig(2.8)
    assert not darkens(plain)
    assert framed(plain, 50.0) is plain
    sensor = replace(low_noise(), lens=plain)
    np.testing.assert_array_equal(form_image(even(50.0), sensor).values, form_image(even(), sensor).values)


def test_wrong_numbers_and_pictures_without_an_angle_are_refused():
    refusal(falloff, BY_SCENE, (12, 16), match="falloff_power: the picture states no angle of view")
    refusal(form_image, even(), replace(low_noise(), lens=BY_SCENE), match="falloff_power: .*give horizontal_view_deg")
    refusal(LensConfig, 2.8, falloff_power=9.0, match="falloff_power: 9.0")
    refusal(LensConfig, 2.8, vignetting=1.0, match="vignetting: 1.0")
    refusal(LensConfig, 2.8, vignetting_from=1.0, match="vignetting_from: 1.0")
