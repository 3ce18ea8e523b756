"""Light, irradiance and electrons against numbers computed elsewhere, from ISETCam's formulas and data."""

import numpy as np
import pytest
from loop import loop
from outside_truth import ELECTRONS, IRRADIANCE, MAGNIFICATION, MOONLIGHT_CD_M2, MOONLIGHT_PHOTONS_PER_UM2_S_CD_M2

from render.illuminants import illuminant
from render.radiance import SpectralRadiance
from sensor.config import LensConfig, SensorConfig
from sensor.curves import rgbw
from sensor.optics import camera_equation, form_image
from sensor.pixel import PixelConfig
from sensor.response import expected_electrons

NM = np.arange(400.0, 701.0, 10.0)
TOLERANCE = 2e-3


def scene(light, luminance_cd_m2, nm=NM):
    spectrum = illuminant(light)
    values = np.broadcast_to(np.interp(nm, spectrum.wavelength_nm, spectrum.values), (2, 2, nm.size))
    unit = SpectralRadiance(values, nm).luminance()[0, 0]
    return SpectralRadiance(values * (luminance_cd_m2 / unit), nm)


def camera(f_number, magnification=0.0, pitch_um=2.2, fill_factor=0.9):
    pixel = PixelConfig(pitch_um, fill_factor, full_well_e=15_000.0, read_noise_e=0.0, dsnu_e=0.0, prnu=0.0)
    lens = LensConfig(f_number, magnification=magnification)
    return SensorConfig(pixel, lens, responses=rgbw(), window_nm=(395.0, 705.0))


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
@loop("case", ELECTRONS)
def test_electrons(case, channel):
    luminance_cd_m2, f_number, pitch_um, fill_factor = case
    sensor = camera(f_number, MAGNIFICATION, pitch_um, fill_factor)
    mosaic = expected_electrons(form_image(scene("D65", luminance_cd_m2), sensor), sensor, 0.01)
    electrons = dict(zip("RGBW", mosaic.ravel(), strict=True))  # one tile: R G over B W
    assert electrons[channel] == pytest.approx(ELECTRONS[case][channel], rel=0.03)  # our own curves


def test_moonlight():
    photons = [form_image(scene("D65", cd_m2), camera(5.6)).photons()[0, 0] for cd_m2 in (1.0, MOONLIGHT_CD_M2)]
    assert photons == pytest.approx([MOONLIGHT_PHOTONS_PER_UM2_S_CD_M2, 10.0], rel=TOLERANCE)
