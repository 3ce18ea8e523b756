"""Light, irradiance and electrons against numbers computed elsewhere, from ISETCam's formulas and data."""

from itertools import product

import numpy as np
import pytest
from loop import loop
from outside_truth import (
    ELECTRONS,
    IRRADIANCE,
    MAGNIFICATION,
    MOONLIGHT_CD_M2,
    MOONLIGHT_PHOTONS_PER_UM2_S_CD_M2,
    PHOTON_RADIANCE,
    RGBW,
    RGBW_NM,
    W_RATIOS,
)

from render.illuminants import illuminant
from render.photometry import photons_per_joule
from render.radiance import SpectralRadiance
from render.spectrum import VISIBLE_NM, Spectrum
from sensor.chip import PixelConfig
from sensor.config import LensConfig, SensorConfig
from sensor.curves import Responses, rgbw
from sensor.optics import camera_equation, form_image
from sensor.response import expected_electrons

NM = np.arange(400.0, 701.0, 10.0)
MEASURED = Responses({channel: Spectrum(RGBW_NM, values) for channel, values in RGBW.items()})
# Curves, and how well they must do.
CURVES = {"measured": (MEASURED, 2e-3), "own": (rgbw(), 0.03)}
TOLERANCE = 2e-3


def scene(light, luminance_cd_m2, nm=NM):
    spectrum = illuminant(light)
    values = np.broadcast_to(np.interp(nm, spectrum.wavelength_nm, spectrum.values), (2, 2, nm.size))
    unit = SpectralRadiance(values, nm).luminance()[0, 0]
    return SpectralRadiance(values * (luminance_cd_m2 / unit), nm)


def camera(f_number, magnification=0.0, pitch_um=2.2, fill_factor=0.9, responses=None, window_nm=(395.0, 705.0)):
    pixel = PixelConfig(pitch_um, fill_factor, full_well_e=15_000.0, read_noise_e=0.0, dsnu_e=0.0, prnu=0.0)
    lens = LensConfig(f_number, magnification=magnification)
    return SensorConfig(pixel, lens, responses=responses or rgbw(), window_nm=window_nm)


@loop("light", PHOTON_RADIANCE)
def test_photon_radiance_of_a_scene(light):
    expected, radiance = PHOTON_RADIANCE[light], scene(light, 100.0)
    photons = radiance.values[0, 0] * photons_per_joule(NM)
    assert radiance.luminance()[0, 0] == pytest.approx(100.0, rel=1e-9)
    assert photons.sum() * 10 == pytest.approx(expected["total"], rel=TOLERANCE)
    assert photons[NM == 550.0][0] == pytest.approx(expected["at_550_nm"], rel=TOLERANCE)
    assert photons.mean() == pytest.approx(expected["mean"], rel=TOLERANCE)


@loop(("f_number", "magnification"), IRRADIANCE)
def test_irradiance_on_the_sensor(f_number, magnification):
    lux_per_cd_m2, photons_per_um2_s = IRRADIANCE[f_number, magnification]
    sensor = camera(f_number, magnification)
    image = form_image(scene("D65", 100.0), sensor)
    # The magnification is stated to three digits.
    assert camera_equation(sensor.lens) == pytest.approx(lux_per_cd_m2, rel=1e-5 if magnification else 1e-12)
    assert image.illuminance()[0, 0] == pytest.approx(100 * lux_per_cd_m2, rel=TOLERANCE)
    assert image.photons()[0, 0] == pytest.approx(photons_per_um2_s, rel=TOLERANCE)


@loop("channel", "RGBW")
@loop(("curves", "case"), list(product(CURVES, ELECTRONS)))
def test_electrons(curves, case, channel):
    responses, tolerance = CURVES[curves]
    luminance_cd_m2, f_number, pitch_um, fill_factor = case
    sensor = camera(f_number, MAGNIFICATION, pitch_um, fill_factor, responses)
    mosaic = expected_electrons(form_image(scene("D65", luminance_cd_m2), sensor), sensor, 0.01)
    electrons = dict(zip("RGBW", mosaic.ravel(), strict=True))  # one tile: R G over B W
    assert electrons[channel] == pytest.approx(ELECTRONS[case][channel], rel=tolerance)


@loop(("curves", "light"), list(product(CURVES, W_RATIOS)))
def test_w_s_electron_ratios_over_380_to_780_nm(curves, light):
    # rectangle sums at 1 nm from 380 to 780 nm: bands of 1 nm, the outermost half a nanometre wider than the window
    responses, tolerance = CURVES[curves]
    sensor = camera(4.0, responses=responses, window_nm=VISIBLE_NM)
    image = form_image(scene(light, 1.0, np.arange(380.0, 781.0)), sensor)
    red, green, blue, white = expected_electrons(image, sensor, 1.0).ravel()
    assert (white / red, white / green, white / blue) == pytest.approx(W_RATIOS[light], rel=tolerance)


def test_the_measured_curves_peak_where_the_project_s_do():
    for channel, values in RGBW.items():
        own = rgbw().curves[channel]
        assert values.max() == pytest.approx(own.values.max(), abs=5e-4)
        assert RGBW_NM[values.argmax()] == own.wavelength_nm[own.values.argmax()]


def test_moonlight():
    photons = [form_image(scene("D65", cd_m2), camera(5.6)).photons()[0, 0] for cd_m2 in (1.0, MOONLIGHT_CD_M2)]
    assert photons == pytest.approx([MOONLIGHT_PHOTONS_PER_UM2_S_CD_M2, 10.0], rel=TOLERANCE)
