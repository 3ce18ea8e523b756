"""The numbers that Parmar & Wandell (2009) give, and what is exact about them."""

import numpy as np
import pytest

from render.illuminants import illuminant
from render.radiance import SpectralRadiance
from sensor.cfa import RGBW, mask
from sensor.chip import PixelConfig
from sensor.config import LensConfig, SensorConfig
from sensor.optics import form_image
from sensor.response import channel_electrons, expected_electrons

MOONLIGHT_CD_M2 = 0.036
FIGURE_2_NM = np.arange(400.0, 701.0, 10.0)  # 400-700 nm, where the paper shows its curves


def camera(pitch_um, f_number, window_nm=(395.0, 705.0)):
    pixel = PixelConfig(pitch_um, 1.0, full_well_e=1e6, read_noise_e=0.0, dsnu_e=0.0, prnu=0.0)
    return SensorConfig(pixel, LensConfig(f_number), window_nm=window_nm)


def scene(light, luminance_cd_m2, nm=FIGURE_2_NM, shape=(2, 2)):
    values = illuminant(light).band_average(nm, np.full(nm.size, nm[1] - nm[0]))
    values = np.broadcast_to(values, (*shape, nm.size))
    unit = SpectralRadiance(values, nm).luminance()[0, 0]
    return SpectralRadiance(values * (luminance_cd_m2 / unit), nm)


def decibels(ratio):
    return 20 * np.log10(ratio)


def test_moonlight_through_f_5_6_is_10_photons_a_square_micrometre_and_second():
    photons = form_image(scene("D65", MOONLIGHT_CD_M2), camera(2.0, 5.6)).photons()[0, 0]
    assert photons == pytest.approx(10.0, rel=5e-3)  # exact: 9.97; 0.0361 cd/m^2 would be 10.00


def test_6_um_against_2_um_is_9_54_db_of_two_sensors_at_100_cd_m2_and_f_4():
    for channel in "RGBW":
        # Figure 1b. Shot noise alone: the SNR is the root of the electrons.
        radiance = scene("D65", 100.0)
        large, small = (
            expected_electrons(form_image(radiance, sensor), sensor, 0.01)[mask(RGBW, channel, (2, 2))][0]
            for sensor in (camera(6.0, 4.0), camera(2.0, 4.0))
        )
        assert decibels(np.sqrt(large) / np.sqrt(small)) == pytest.approx(9.542425, abs=1e-6), channel


def ratios(light, nm):
    """Electrons of W over those of R, G and B."""
    sensor = camera(2.0, 4.0, window_nm=(nm[0] - 0.5, nm[-1] + 0.5))
    red, green, blue, white = channel_electrons(form_image(scene(light, 1.0, nm), sensor), sensor, 1.0)[0, 0]
    return white / red, white / green, white / blue


def test_w_gathers_the_exact_multiple_of_each_colour():
    for light, nm, exact in [
        ("E", np.arange(380.5, 780.0), (10.16, 5.85, 13.81)),
        ("D65", np.arange(380.5, 780.0), (9.80, 4.88, 10.84)),
        ("D65", np.arange(400.5, 700.0), (7.90, 3.93, 8.76)),
    ]:
        np.testing.assert_allclose(ratios(light, nm), exact, rtol=0.03)
