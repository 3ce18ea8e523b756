"""Glare with wings: the veil by angle against the closed forms, its energy, and a black patch in a bright field."""

from dataclasses import replace
from math import atan, degrees, radians, tan

import numpy as np
import pytest
import scipy
from refusal import refusal

from render.engine import render
from render.geometry import camera, look_at
from render.radiance import SpectralRadiance
from scenes.catalogue import load
from scenes.materials import disk, matte, under_sky
from scenes.reflectances import grey
from sensor.config import LensConfig
from sensor.lens.scatter import scattered_share, scatters, veil_per_sr
from sensor.optics import camera_equation, form_image, left_out
from sensor.presets import low_noise
from studies.study.model import LensTerms

NM = np.array([450.0, 550.0, 650.0])
LENSES = {
    "slope 2": LensConfig(2.8, scatter=0.03),
    "slope 1.5": LensConfig(2.8, scatter=0.02, scatter_slope=1.5, scatter_shoulder_deg=0.05),
    "slope 3": LensConfig(2.8, scatter=0.05, scatter_slope=3.0, scatter_shoulder_deg=0.3),
    "eye of 25": LensConfig(2.8, eye_age_years=25.0),
    "eye of 70": LensConfig(2.8, eye_age_years=70.0, eye_pigmentation=1.0),
}


def image(picture, lens, view_deg, **options):
    """Radiance that the sensor sees in each pixel: irradiance over what a lamp of that radiance gives."""
    radiance = SpectralRadiance(np.repeat(picture[..., None], 3, axis=2), NM, horizontal_view_deg=view_deg, **options)
    sensor = replace(low_noise(), lens=lens)
    return form_image(radiance, sensor).values[..., 1] / camera_equation(lens)


def by_hand(theta, lens):
    """P(theta) as the papers have it, with the integral done by quadrature."""
    if lens.eye_age_years:
        ageing = 1 + (lens.eye_age_years / 62.5) ** 4
        p = lens.eye_pigmentation
        return 10 / theta**3 + (5 / theta**2 + 0.1 * p / theta) * ageing + 0.0025 * p

    def shape(angle):
        return (1 + (np.sin(angle) / np.sin(radians(lens.scatter_shoulder_deg))) ** 2) ** (-lens.scatter_slope / 2)

    whole = over_angles(lambda a: np.cos(a) * shape(a), 0.0, 90.0)
    return lens.scatter * shape(radians(theta)) / whole


def over_angles(function, from_deg, to_deg):
    """Integral over directions, 2 pi sin(a) da, between two angles from a lamp."""
    corners = [from_deg, *(x for x in (0.03, 0.1, 0.3, 1.0, 3.0, 10.0, 30.0) if from_deg < x < to_deg), to_deg]
    parts = zip(np.radians(corners[:-1]), np.radians(corners[1:]), strict=True)
    return sum(scipy.integrate.quad(lambda a: 2 * np.pi * np.sin(a) * function(a), *part)[0] for part in parts)


@pytest.mark.parametrize("name", LENSES)
@pytest.mark.parametrize("view_deg", [4.0, 50.0])
def test_veil_of_a_lamp_has_the_closed_form_at_every_angle(name, view_deg):
    """Within 2 %, from 0.5 to 20 degrees; a lamp of one pixel gives its luminance times the pixel's solid angle."""
    lens, side, luminance = LENSES[name], 256, 1e5
    picture = np.zeros((33, side))
    picture[16, 20] = luminance
    seen = image(picture, lens, view_deg)[16]
    step = tan(radians(view_deg / 2)) / (side / 2)
    columns = np.arange(24, side)  # a pixel averages the steep wing over its width: to 2 % from the fourth one on
    theta = np.array([degrees(atan((column - 20) * step)) for column in columns])
    asked = (theta >= 0.5) & (theta <= 20)
    assert asked.sum() > 50
    expected = luminance * step**2 * np.array([by_hand(angle, lens) for angle in theta[asked]])
    np.testing.assert_allclose(seen[columns[asked]], expected, rtol=0.02)


def test_share_is_what_the_wings_hold():
    for name, lens in LENSES.items():
        first = 0.1 if lens.eye_age_years else 0.0
        whole = over_angles(lambda a, its=lens: np.cos(a) * float(veil_per_sr(np.degrees(a), its)), first, 90.0)
        assert whole == pytest.approx(scattered_share(lens), rel=1e-3), name


def test_light_is_kept_but_for_what_falls_beside_the_picture():
    lens, side = LENSES["slope 3"], 257
    picture = np.zeros((side, side))
    picture[128, 128] = 1.0
    rim = tan(radians(30))
    cone = over_angles(lambda a: float(veil_per_sr(np.degrees(a), lens)) / np.cos(a) ** 3, 0.0, 30.0)  # in a plane
    corners = (4 - np.pi) * rim**2 * float(veil_per_sr(30.0, lens))  # at most, of a square around the cone's circle
    assert 1 - lens.scatter + cone <= image(picture, lens, 60.0).sum() <= 1 - lens.scatter + cone + corners


def test_veiling_glare_index_of_a_black_patch():
    """ISO 9358: a black patch of 5 degrees in a bright field of 39. The veil is the wings' integral over the field."""
    lens, side, view_deg = LENSES["slope 2"], 321, 40.0
    step = tan(radians(view_deg / 2)) / (side / 2)
    away = np.hypot(*np.meshgrid(*[(np.arange(side) - 160) * step] * 2, indexing="ij"))
    edge, rim = tan(radians(2.5)), tan(radians(19.5))
    picture = ((away > edge) & (away < rim)).astype(float)
    index = image(picture, lens, view_deg)[160, 160]
    expected = scipy.integrate.quad(lambda r: 2 * np.pi * r * by_hand(degrees(atan(r)), lens), edge, rim)[0]
    assert index == pytest.approx(expected, rel=0.02)
    even = image(picture, replace(lens, veiling_glare=0.01), view_deg)
    share = even[160, 160] - 0.99 * index
    assert share == pytest.approx(0.01 * image(picture, lens, view_deg).mean(), rel=1e-9)


def test_veiling_glare_index_of_a_rendered_chart():
    """ISO 9358: a black patch of 5 degrees before a bright field, as a camera of 40 degrees renders both.

    By hand the veil is the wings' integral over the square that the camera sees, less the patch.
    """
    lens, side, view_deg = LENSES["slope 2"], 81, 40.0
    edge, half = tan(radians(2.5)), tan(radians(view_deg / 2))
    patch = {"patch": disk(look_at((0, 0, 0), (0, 0, 1)), edge, matte(grey(0.0)))}
    chart = under_sky("chart", camera(view_deg, (0, 0, 1), (0, 0, 0)), patch, "D65", "patch")
    light = render(chart, (side, side), wavelength_nm=NM, spp=16).relight()
    assert light.values[0, 0, 1] > 0 == light.values[side // 2, side // 2, 1]
    seen = form_image(light, replace(low_noise(), lens=lens)).values[..., 1] / camera_equation(lens)

    def around(r):
        """Arc of a circle of this radius within the square."""
        return 2 * np.pi * r - 8 * r * (np.arccos(half / r) if r > half else 0.0)

    ends = edge, half, 2**0.5 * half
    parts = [
        scipy.integrate.quad(lambda r: around(r) * by_hand(degrees(atan(r)), lens), *ends[n : n + 2])[0] for n in (0, 1)
    ]
    assert seen[side // 2, side // 2] / light.values[0, 0, 1] == pytest.approx(sum(parts), rel=0.02)


def test_a_border_brings_no_light_and_takes_what_goes_beyond():
    """Padded, not mirrored: the middle of a straight border gets half of the veil that an even field gives within."""
    lens = LENSES["slope 2"]
    veil = image(np.ones((257, 257)), lens, 30.0) - (1 - lens.scatter)
    own = image(np.pad(np.ones((1, 1)), 128), lens, 30.0)[128, 128] - (1 - lens.scatter)  # a pixel's of itself
    twice = image(np.ones((513, 257)), lens, 30.0) - (1 - lens.scatter)
    assert (veil[0, 128] - own) / (twice[256, 128] - own) == pytest.approx(0.5, abs=0.08)
    lamp = np.zeros((64, 64))
    lamp[32, 0] = 1.0
    assert image(lamp, lens, 30.0)[32, 63] == pytest.approx(image(lamp[:, ::-1].copy(), lens, 30.0)[32, 0], rel=1e-9)


def test_scatter_is_linear_in_halves_and_comes_after_finer_samples():
    lens, rng = LENSES["eye of 25"], np.random.default_rng(1)
    even, odd = rng.normal(size=(2, 24, 24))
    parts = [image(half, lens, 30.0, signed=True) for half in (even, odd, even + odd)]
    np.testing.assert_allclose(parts[0] + parts[1], parts[2], atol=1e-12)
    fine = np.kron(np.abs(even), np.ones((3, 3)))
    radiance = SpectralRadiance(np.repeat(fine[..., None], 3, axis=2), NM, horizontal_view_deg=30.0)
    sampled = form_image(radiance, replace(low_noise(), lens=lens), 3).values[..., 1] / camera_equation(lens)
    np.testing.assert_allclose(sampled, image(np.abs(even), lens, 30.0), rtol=1e-9)


def test_a_rendered_scene_states_its_camera_s_view_from_the_cache_too(tmp_path):
    for _ in range(2):
        light = render(load("flat_field"), (4, 8), wavelength_nm=NM, spp=1, cache=tmp_path).relight()
        assert light.horizontal_view_deg == pytest.approx(30.0)
    assert np.all(form_image(light, replace(low_noise(), lens=LENSES["slope 2"])).values > 0)


def test_a_study_states_the_share_for_all_its_sensors():
    assert LensTerms(scatter=0.02).on(LensConfig(2.8, scatter_slope=3.0)) == LensConfig(
        2.8, scatter=0.02, scatter_slope=3.0
    )


def test_what_is_refused_and_what_is_told():
    lens = LENSES["slope 2"]
    assert scatters(lens)
    assert not scatters(LensConfig(2.8))
    refusal(image, np.ones((8, 8)), lens, None, match="scatter: the picture states no angle of view.*give horiz")
    refusal(LensConfig, 2.8, scatter=0.1, eye_age_years=30.0, match="scatter: 0.1 beside eye_age_years 30")
    refusal(LensConfig, 2.8, scatter=-0.1, match="scatter: -0.1 is outside 0 to 0.99")
    lines = left_out(replace(low_noise(), lens=replace(low_noise().lens, scatter=0.01)))
    assert not [line for line in lines if line.startswith("veiling glare")]
