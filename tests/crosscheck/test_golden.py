"""Numbers computed elsewhere, from ISETCam's formulas and data: `golden.json` of the reference folder.

They are rectangle sums at 400:10:700 of spectra sampled at the band centres, with a magnification of 0.00323, or 0
where a key ends in `_m0` and for moonlight.
"""

import csv
import json
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from scipy.io import loadmat

from render.illuminants import illuminant
from render.photometry import photons_per_joule
from render.radiance import SpectralRadiance
from render.spectrum import VISIBLE_NM
from sensor.config import LensConfig, PixelConfig, SensorConfig
from sensor.curves import read_csv, rgbw
from sensor.optics import camera_equation, form_image
from sensor.response import expected_electrons

REFERENCE = Path(__file__).resolve().parents[2].parent / "shared" / "reference"
CURVES = REFERENCE / "isetcam" / "sensor" / "colorfilters" / "interleavedRGBW.mat"
pytestmark = pytest.mark.skipif(
    not (REFERENCE / "golden.json").is_file(), reason="no reference data: ../shared/reference/golden.json is absent"
)

NM = np.arange(400.0, 701.0, 10.0)
MAGNIFICATION = 0.00323
TOLERANCE = 2e-3
OWN_CURVES_TOLERANCE = 0.03

SCENES = {"scene_D65_100cdm2_400-10-700": "D65", "scene_EE_100cdm2_400-10-700": "E"}
IRRADIANCES = {"irradiance_D65_100cdm2_f2.8": 2.8, "irradiance_D65_100cdm2_f4.0": 4.0}
ELECTRONS = {  # luminance [cd/m^2], f-number, pitch [um], fill factor; 10 ms each
    "electrons_RGBW_D65_100cdm2_f4_2.8um_ff.75_10ms": (100.0, 4.0, 2.8, 0.75),
    "electrons_RGBW_D65_Table1_25cdm2_f2.8_2.2um_ff.9_10ms": (25.0, 2.8, 2.2, 0.9),
}
RATIOS = {
    "D65": "interleavedRGBW_W_over_RGB_electrons_D65_380-780",
    "E": "interleavedRGBW_W_over_RGB_electrons_EE_380-780",
}


@cache
def golden():
    return json.loads((REFERENCE / "golden.json").read_text("utf-8"))


def scene(light, luminance_cd_m2, nm=NM):
    spectrum = illuminant(light)
    values = np.broadcast_to(np.interp(nm, spectrum.wavelength_nm, spectrum.values), (2, 2, nm.size))
    unit = SpectralRadiance(values, nm).luminance()[0, 0]
    return SpectralRadiance(values * (luminance_cd_m2 / unit), nm)


def camera(f_number, magnification=0.0, pitch_um=2.2, fill_factor=0.9, responses=None, window_nm=(395.0, 705.0)):
    pixel = PixelConfig(pitch_um, fill_factor, full_well_e=15_000.0, read_noise_e=0.0, dsnu_e=0.0, prnu=0.0)
    lens = LensConfig(f_number, magnification=magnification)
    return SensorConfig(pixel, lens, responses=responses or rgbw(), window_nm=window_nm)


@pytest.fixture(scope="module")
def measured(tmp_path_factory):
    """The measured R, G, B, W curves, by way of a CSV file as a user would load them."""
    data = loadmat(CURVES, squeeze_me=True)
    path = tmp_path_factory.mktemp("responses") / "interleaved_rgbw.csv"
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(["wavelength_nm", *"RGBW"])
        writer.writerows([repr(float(x)) for x in row] for row in np.column_stack([data["wavelength"], data["data"]]))
    return read_csv(path)


def test_every_entry_has_its_test():
    paper = {"moonlight_claim", "snr_30dB_photons", "snr_6um_over_2um"}  # the last two: tests/paper
    assert set(golden()) == {*SCENES, *IRRADIANCES, *ELECTRONS, *RATIOS.values(), *paper}


@pytest.mark.parametrize("key", SCENES)
def test_photon_radiance_of_a_scene(key):
    expected = golden()[key]
    radiance = scene(SCENES[key], 100.0)
    photons = radiance.values[0, 0] * photons_per_joule(NM)
    assert radiance.luminance()[0, 0] == pytest.approx(100.0, rel=1e-9)
    assert photons.sum() * 10 == pytest.approx(expected["total_photons_per_s_sr_m2"], rel=TOLERANCE)
    assert photons[NM == 550.0][0] == pytest.approx(expected["q550"], rel=TOLERANCE)
    assert photons.mean() == pytest.approx(expected["mean_per_nm"], rel=TOLERANCE)


@pytest.mark.parametrize(("suffix", "magnification"), [("", MAGNIFICATION), ("_m0", 0.0)])
@pytest.mark.parametrize("key", IRRADIANCES)
def test_irradiance_on_the_sensor(key, suffix, magnification):
    expected, sensor = golden()[key], camera(IRRADIANCES[key], magnification)
    image = form_image(scene("D65", 100.0), sensor)
    # lux per cd/m^2 is the camera equation
    assert camera_equation(sensor.lens) == pytest.approx(expected["E_over_L" + suffix], rel=1e-12 if suffix else 1e-5)
    assert image.illuminance()[0, 0] == pytest.approx(expected["lux" + suffix], rel=TOLERANCE)
    assert image.photons()[0, 0] == pytest.approx(expected["photons_per_um2_s" + suffix], rel=TOLERANCE)


def electrons(key, responses):
    luminance_cd_m2, f_number, pitch_um, fill_factor = ELECTRONS[key]
    sensor = camera(f_number, MAGNIFICATION, pitch_um, fill_factor, responses)
    mosaic = expected_electrons(form_image(scene("D65", luminance_cd_m2), sensor), sensor, 0.01)
    return dict(zip("RGBW", mosaic.ravel(), strict=True))  # one tile: R G over B W


@pytest.mark.parametrize("letter", "RGBW")
@pytest.mark.parametrize("key", ELECTRONS)
def test_electrons_with_the_measured_curves(key, letter, measured):
    assert electrons(key, measured)[letter] == pytest.approx(golden()[key][letter], rel=TOLERANCE)


@pytest.mark.parametrize("letter", "RGBW")
@pytest.mark.parametrize("key", ELECTRONS)
def test_electrons_with_the_project_s_own_curves(key, letter):
    assert electrons(key, rgbw())[letter] == pytest.approx(golden()[key][letter], rel=OWN_CURVES_TOLERANCE)


@pytest.mark.parametrize("light", RATIOS)
@pytest.mark.parametrize(("own", "tolerance"), [(False, TOLERANCE), (True, OWN_CURVES_TOLERANCE)])
def test_w_s_electron_ratios_over_380_to_780_nm(light, own, tolerance, measured):
    # rectangle sums at 1 nm from 380 to 780 nm: bands of 1 nm, the outermost half a nanometre wider than the window
    sensor = camera(4.0, responses=rgbw() if own else measured, window_nm=VISIBLE_NM)
    image = form_image(scene(light, 1.0, np.arange(380.0, 781.0)), sensor)
    red, green, blue, white = expected_electrons(image, sensor, 1.0).ravel()
    for value, expected in zip((white / red, white / green, white / blue), golden()[RATIOS[light]], strict=True):
        assert value == pytest.approx(expected, rel=tolerance)


def test_the_measured_curves_peak_where_the_project_s_do(measured):
    for letter, curve in measured.curves.items():
        own = rgbw().curves[letter]
        assert curve.values.max() == pytest.approx(own.values.max(), abs=5e-4)
        assert curve.wavelength_nm[curve.values.argmax()] == own.wavelength_nm[own.values.argmax()]


def test_moonlight():
    expected = golden()["moonlight_claim"]
    sensor = camera(5.6)
    photons = form_image(scene("D65", 1.0), sensor).photons()[0, 0]
    assert photons == pytest.approx(expected["D65_photons_per_um2_s_per_cdm2_at_f5p6"], rel=TOLERANCE)
    luminance_cd_m2 = expected["implied_scene_luminance_cdm2"]
    dim = form_image(scene("D65", luminance_cd_m2), sensor).photons()[0, 0]
    assert dim == pytest.approx(10.0, rel=TOLERANCE)
    assert dim * 2.0**2 * 0.025 == pytest.approx(expected["photons_2um_25ms"], rel=TOLERANCE)
