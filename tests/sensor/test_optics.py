"""The camera equation in closed form, and what `form_image` leaves alone."""

from math import pi

import numpy as np
import pytest
from loop import loop

from render.radiance import SpectralRadiance
from rodcone.errors import InputError
from sensor.chip import PixelConfig
from sensor.config import LensConfig, SensorConfig
from sensor.optics import SpectralIrradiance, camera_equation, form_image

ISET_NM = np.arange(400.0, 701.0, 10.0)  # samples 10 nm apart, summed as rectangles


def camera(**lens):
    pixel = PixelConfig(pitch_um=2.2, fill_factor=0.9, full_well_e=15_000.0, read_noise_e=0.0, dsnu_e=0.0, prnu=0.0)
    return SensorConfig(pixel, LensConfig(**lens))


@loop("f_number", [0.5, 1.4, 2.8, 16.0])
@loop("magnification", [0.0, 0.00323, 1.0])
@loop("transmittance", [0.0, 0.8, 1.0])
def test_irradiance_is_pi_t_l_over_1_plus_4_n_squared_1_plus_m_squared(f_number, magnification, transmittance):
    lens = LensConfig(f_number, transmittance, magnification)
    cone = 1 / (2 * f_number * (1 + magnification))  # tangent of the exit pupil's half angle
    half_angle_sine_squared = cone**2 / (1 + cone**2)  # a disc of radiance L gives pi L sin^2
    assert camera_equation(lens) == pytest.approx(pi * transmittance * half_angle_sine_squared, rel=1e-13)


def test_each_value_is_scaled_by_the_camera_equation_and_nothing_is_mixed():
    rng = np.random.default_rng(1)
    radiance = SpectralRadiance(rng.random((5, 7, 31)), ISET_NM)
    sensor = camera(f_number=4.0, transmittance=0.5)
    image = form_image(radiance, sensor)
    np.testing.assert_allclose(image.values, radiance.values * (0.5 * pi / 65), rtol=1e-15)
    np.testing.assert_array_equal(image.wavelength_nm, ISET_NM)
    np.testing.assert_array_equal(image.widths_nm, 10.0)
    assert image.pitch_um == 2.2


def test_photons_and_lux_of_one_green_line_are_in_closed_form():
    # 555 nm, 1 W m^-2 in a band of 2 nm: V is 1 to 1e-4, and a photon carries h c / lambda
    image = SpectralIrradiance(np.full((2, 2, 1), 0.5), np.array([555.0]), 2.2, np.array([2.0]))
    np.testing.assert_allclose(image.illuminance(), 683.0, rtol=5e-4)
    np.testing.assert_allclose(image.photons(), 1e-12 * 555e-9 / (6.62607015e-34 * 299792458.0), rtol=1e-12)


@loop("shape", [(2, 2, 30), (2, 31)])
def test_an_irradiance_without_one_value_a_band_is_refused(shape):
    with pytest.raises(InputError, match=r"irradiance: shape .* is not \(h, w, 31\); give one value a band"):
        SpectralIrradiance(np.ones(shape), ISET_NM, 2.2)


@loop("value", [np.nan, -1e-9, np.inf])
def test_an_irradiance_that_cannot_be_is_refused_where_it_stands(value):
    values = np.ones((3, 4, 31))
    values[1, 2, 5] = value
    with pytest.raises(InputError, match=r"irradiance: .* at row 1, column 2, band 5; allowed: finite numbers >= 0"):
        SpectralIrradiance(values, ISET_NM, 2.2)
