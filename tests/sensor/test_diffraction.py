"""Light that a lens spreads: closed forms of the transfer functions, energy, borders, and gratings."""

from dataclasses import replace
from itertools import product
from math import pi

import numpy as np
import pytest
from loop import loop
from scipy.integrate import quad
from scipy.special import j0, j1

from render.radiance import SpectralRadiance
from sensor.config import LensConfig, SensorConfig
from sensor.diffraction import defocus_otf, diffraction_otf, limit_per_um, sampled_otf
from sensor.lens.illumination import falloff
from sensor.optics import camera_equation, form_image
from sensor.pixel import PixelConfig

PIXEL = PixelConfig(pitch_um=2.2, fill_factor=0.9, full_well_e=15_000.0, read_noise_e=0.0, dsnu_e=0.0, prnu=0.0)
GREEN = np.array([550.0])
IDEAL = LensConfig(2.8, diffraction=1.0)


def camera(pitch_um=2.2, **lens):
    return SensorConfig(replace(PIXEL, pitch_um=pitch_um), LensConfig(**{"f_number": 2.8, **lens}))


def scene(values, nm=GREEN):
    values = np.asarray(values, dtype=np.float64)
    return SpectralRadiance(values[..., None] if values.ndim == 2 else values, nm, width_nm=np.full(nm.size, 10.0))


def image(values, samples=1, pitch_um=2.2, nm=GREEN, **lens):
    """Irradiance over what the camera equation gives."""
    sensor = camera(pitch_um, **lens)
    made = form_image(scene(values, nm), sensor, samples).values / camera_equation(sensor.lens)
    return made[..., 0] if nm.size == 1 else made


# The transfer functions


def test_diffraction_s_transfer_is_the_overlap_of_two_discs():
    for s in (0.0, 0.1, 0.3, 0.5, 0.9, 1.0, 1.5):
        overlap = quad(lambda x: 4 * np.sqrt(1 - x**2), min(s, 1.0), 1)[0] / pi  # lens-shaped area over the disc's
        made = diffraction_otf(np.array(s / (0.55 * 2.8)), 550.0, IDEAL)
        assert made == pytest.approx(overlap, abs=1e-9)


def test_the_limit_is_one_over_wavelength_times_the_working_f_number():
    assert limit_per_um(550.0, IDEAL) == pytest.approx(1 / (0.55 * 2.8), rel=1e-14)
    close = replace(IDEAL, magnification=1.0)
    assert limit_per_um(500.0, close) == pytest.approx(1 / (0.5 * 5.6), rel=1e-14)
    assert limit_per_um(500.0, replace(close, diffraction=2.0)) == pytest.approx(1 / (0.5 * 11.2), rel=1e-14)
    assert limit_per_um(500.0, replace(close, diffraction=0.0)) == np.inf


def test_defocus_is_the_transform_of_an_even_disc():
    for frequency in (0.0, 0.05, 0.2, 0.37, 1.0):
        integral = quad(lambda r, f=frequency: r * j0(2 * pi * f * r), 0, 1.5)[0] * 2 / 1.5**2
        assert defocus_otf(np.array([frequency]), 3.0)[0] == pytest.approx(integral, abs=1e-9)
    np.testing.assert_array_equal(defocus_otf(np.array([0.0, 0.3]), 0.0), 1.0)


@loop("f_number", [1.05, 1.4])
def test_folded_copies_are_the_transform_of_the_airy_pattern_at_the_samples(f_number):
    lens, step_um, size = replace(IDEAL, f_number=f_number), 0.55, 96
    assert limit_per_um(550.0, lens) > 0.5 / step_um
    x = np.arange(-size + 1, size) * step_um
    v = pi * np.hypot(x[:, None], x) / (0.55 * f_number)
    airy = np.divide(2 * j1(v), v, out=np.ones_like(v), where=v > 0) ** 2
    frequency = np.arange(12) / (2 * 12 * step_um)
    cosines = np.cos(2 * pi * frequency[:, None] * x)
    direct = cosines @ airy @ cosines.T
    made = sampled_otf((12, 12), step_um, lens, folded=True)(550.0)
    # beyond 96 samples lie 2 N lambda / (pi^2 96 step) of the light, 0.3 %
    np.testing.assert_allclose(made / made[0, 0], direct / direct[0, 0], atol=6e-3)
    assert np.abs(sampled_otf((12, 12), step_um, lens, folded=False)(550.0) - direct / direct[0, 0]).max() > 0.1


# Light


@loop("samples", [1, 4])
@loop(
    "lens", [{"diffraction": 1.0}, {"defocus_um": 9.0}, {"veiling_glare": 0.2}, {"diffraction": 2.0, "defocus_um": 4.0}]
)
def test_light_is_kept_and_a_uniform_picture_stays_uniform_up_to_its_border(lens, samples):
    even = image(np.full((8 * samples, 12 * samples), 3.0), samples, **lens)
    np.testing.assert_allclose(even, 3.0, rtol=1e-12)
    rng = np.random.default_rng(1)
    lamps = rng.random((8 * samples, 12 * samples)) ** 40 * 1e5  # five decades, lamps at the border too
    lamps[0, 0] = lamps[-1, 5] = 1e5
    spread = image(lamps, samples, **lens)
    assert spread.mean() == pytest.approx(lamps.mean(), rel=1e-12)
    assert spread.min() >= 0


def test_a_picture_and_its_mirror_image_side_by_side_are_spread_alike():
    picture = np.random.default_rng(3).random((16, 20))
    doubled = np.hstack([picture, picture[:, ::-1]])
    options = {"diffraction": 1.0, "defocus_um": 8.0, "f_number": 8.0}
    np.testing.assert_allclose(image(doubled, **options)[:, :20], image(picture, **options), rtol=1e-12)


def test_a_long_wavelength_spreads_further_and_bands_do_not_mix():
    values = np.zeros((33, 33, 3))
    values[16, 16] = 1.0
    nm = np.array([400.0, 550.0, 700.0])
    made = image(values, nm=nm, diffraction=1.0, f_number=8.0)
    centre = made[16, 16]
    assert centre[0] > centre[1] > centre[2]
    alone = image(values[..., 1], diffraction=1.0, f_number=8.0)
    np.testing.assert_allclose(made[..., 1], alone, rtol=1e-12)


def test_veiling_glare_is_a_share_of_the_mean_added_to_every_pixel():
    picture = np.zeros((10, 10))
    picture[:, :5] = 4.0
    made = image(picture, veiling_glare=0.05)
    np.testing.assert_allclose(made[:, :5], 0.95 * 4 + 0.05 * 2, rtol=1e-13)
    np.testing.assert_allclose(made[:, 5:], 0.05 * 2, rtol=1e-13)


def test_samples_of_a_pixel_are_averaged():
    picture = np.random.default_rng(4).random((12, 20))
    np.testing.assert_allclose(image(picture, 4), picture.reshape(3, 4, 5, 4).mean(axis=(1, 3)), rtol=1e-13)


def test_falloff_is_the_fourth_power_of_the_cosine_off_the_axis():
    lens = LensConfig(2.8, horizontal_view_deg=90.0)  # the sides' middles lie 45 degrees off
    shape = (301, 401)
    made = falloff(lens, shape)
    x, y = 200 / 200.5, 150 / 200.5  # pixel centres of the corner, in units of the distance to the lens
    assert made[0, 0] == pytest.approx(np.cos(np.arctan(np.hypot(x, y))) ** 4, rel=1e-12)
    assert made[150, 200] == pytest.approx(1.0, rel=1e-12)
    assert made[150, 0] == pytest.approx(0.25, rel=5e-3)
    np.testing.assert_allclose(made, made[::-1, ::-1], rtol=1e-12)
    np.testing.assert_allclose(image(np.full(shape, 2.0), horizontal_view_deg=90.0), 2 * made, rtol=1e-12)
    spread = image(np.full(shape, 2.0), horizontal_view_deg=90.0, veiling_glare=1e-12)  # the other way through
    np.testing.assert_allclose(spread, 2 * made, rtol=1e-9)


# Gratings


@loop(
    ("f_number", "pitch_um", "defocus_um", "samples"),
    [(2.8, 2.2, 0.0, 4), (1.4, 2.2, 0.0, 4), (8.0, 2.2, 0.0, 4), (2.8, 6.0, 0.0, 8), (2.8, 2.2, 3.0, 4)],
)
def test_gratings_at_any_angle_keep_what_lens_times_pixel_do_up_to_nyquist(f_number, pitch_um, defocus_um, samples):
    """Whole half waves along both sides of the frame, box-filtered as a render is."""
    size, lens = 32, replace(IDEAL, f_number=f_number)
    fine, coarse = ((np.arange(count) + 0.5) / count for count in (size * samples, size))
    for waves in list(product((0, 7, 20, 31), repeat=2))[1:]:
        down, across = (np.cos(pi * wave * fine) * np.sinc(wave / 2 / size / samples) for wave in waves)
        options = {"f_number": f_number, "diffraction": 1.0, "defocus_um": defocus_um}
        made = image(1 + np.outer(down, across), samples, pitch_um, **options)
        pattern = np.outer(*(np.cos(pi * wave * coarse) for wave in waves))
        frequency = np.hypot(*waves) / (2 * size * pitch_um)
        theory = diffraction_otf(frequency, 550.0, lens) * defocus_otf(frequency, defocus_um)
        theory = theory * np.prod(np.sinc(np.array(waves) / 2 / size))
        assert ((made - 1) * pattern).sum() / (pattern**2).sum() == pytest.approx(float(theory), abs=0.01), waves


# One sample a pixel


@loop("pitch_um", [1.0, 2.2, 6.0])
@loop("f_number", [1.4, 2.8, 5.6, 11.0])
def test_a_lamp_of_one_pixel_has_no_dots_around_it(f_number, pitch_um):
    """Its image falls off along a row as the rings' mean does, and is nowhere negative."""
    lamp = np.zeros((65, 65))
    lamp[32, 32] = 1.0
    sensor = camera(pitch_um, f_number=f_number, diffraction=1.0)
    nm = np.arange(400.0, 701.0, 10.0)
    planes = np.repeat(lamp[..., None], nm.size, axis=2)
    signed = SpectralRadiance(planes, nm, signed=True)  # nothing is cut
    made = form_image(signed, sensor).values / camera_equation(sensor.lens)
    assert made.min() > -1e-15
    np.testing.assert_allclose(made.sum(axis=(0, 1)), 1.0, rtol=1e-12)
    white = made.mean(axis=2)
    tail = white[32, 33:]
    # Dots: a pixel brighter than its neighbours in the row. From the fourth on the tail is 1/r^3 and what is
    # left of the rings, 1.2 at most where a pixel is narrower than one; cut at Nyquist the transfer made it 5 and more.
    assert (tail[3:-1] / np.sqrt(tail[2:-2] * tail[4:])).max() < 1.25
