"""Mosaics without R, G and B: what a fit of their channels can tell, and what guides them."""

from dataclasses import replace

import numpy as np
import pytest
from builders import mosaic_of, raw_image

from isp.colour.calibrated_colours import fit_of_calibration
from isp.colour.white_balance import WhiteBalance
from isp.processors.any_mosaic import picture_any_mosaic
from isp.processors.catalogue import PROCESSORS
from render.illuminants import illuminant
from render.spectrum import DEFAULT_WAVELENGTH_NM, band_widths
from rodcone.colour_spaces import luminance_of_srgb
from scenes.reflectances import color_checker
from sensor.presets import preset
from sensor.raw import RawImage
from studies.metrics.truth import light_in_bands, neutral_electrons
from studies.photograph.camera import calibrate, colour_fit

D65 = light_in_bands(illuminant("D65"), DEFAULT_WAVELENGTH_NM, band_widths(DEFAULT_WAVELENGTH_NM))
MOSAICS = ("rccb", "rccc", "ryyb", "mono")


def patch(mosaic: str, number: int) -> tuple[RawImage, np.ndarray, np.ndarray]:
    """Noise-free exposure of an even patch of the ColorChecker under D65, its neutral, and the fit's own prediction."""
    sensor = preset("low_noise", mosaic)
    light = replace(D65, spectrum=D65.spectrum * color_checker()[number][1].band_average(*vars_of(D65)))
    neutral, seen = neutral_electrons(sensor, D65, 1.0), neutral_electrons(sensor, light, 1.0)
    unit = sensor.channels.index(sensor.unit_channel)
    level_e = 1e6 / neutral[unit]
    fit = colour_fit(sensor, PROCESSORS[mosaic], D65)
    expected = fit.matrix(sensor.channels) @ (seen / neutral) * 1e6
    e = mosaic_of(dict(zip(sensor.channels, seen * level_e, strict=True)), sensor.cfa, (12, 12))
    quiet = {"white_dn": 60_000.0, "black_dn": 0.0, "gain_e_per_dn": 100.0, "read_noise_e": 0.0, "dsnu_e": 0.0}
    return replace(raw_image(np.zeros((12, 12)), sensor.cfa, **quiet), dn=e / 100.0), neutral, expected


def vars_of(light):
    return light.wavelength_nm, light.width_nm


@pytest.mark.sample(6)
@pytest.mark.parametrize("number", [0, 8, 12, 13, 14, 15, 20])
@pytest.mark.parametrize("mosaic", MOSAICS)
def test_an_even_colour_is_what_the_fit_of_its_channels_says(mosaic: str, number: int) -> None:
    raw, neutral, expected = patch(mosaic, number)
    fit = colour_fit(preset("low_noise", mosaic), PROCESSORS[mosaic], D65)
    rgb = PROCESSORS[mosaic].develop(raw, fit, neutral=neutral, balance=neutral).rgb
    # 1e6 e- of shot noise, ten times as much in the fit, still move the matrix a little
    assert rgb == pytest.approx(np.broadcast_to(expected, rgb.shape), abs=0.01 * 1e6)


def test_three_channels_give_colour_and_fewer_give_grey_of_the_same_luminance() -> None:
    for mosaic in MOSAICS:
        sensor = preset("low_noise", mosaic)
        names = sensor.channels
        fit = colour_fit(sensor, PROCESSORS[mosaic], D65)
        matrix = fit.matrix(names)
        assert matrix.sum(axis=1) == pytest.approx(np.ones(3), abs=1e-12), mosaic
        assert (np.ptp(matrix, axis=0).max() < 1e-12) == (len(names) < 3), mosaic
        of_file = fit_of_calibration(calibrate(sensor, illuminant("D65")), names)
        assert (np.ptp(of_file.matrix(names), axis=0).max() < 1e-12) == (len(names) < 3), mosaic
        assert luminance_of_srgb(of_file.matrix(names).T) == pytest.approx(luminance_of_srgb(matrix.T), abs=0.15), (
            mosaic
        )


def test_the_clear_pixel_guides_as_w_does() -> None:
    """The same samples with the channel named C or W, G and W apart: the same picture of the three channels."""
    rng = np.random.default_rng(2)
    raw = raw_image(rng.poisson(300.0, (24, 26)) + 100, ("RC", "CB"))
    white = replace(raw, cfa=("RW", "WB"))
    balance = WhiteBalance(None, np.ones(3))
    fit = colour_fit(preset("low_noise", "rccb"), PROCESSORS["rccb"], D65)
    as_c = picture_any_mosaic(raw, fit, balance=balance)
    as_w = picture_any_mosaic(white, replace(fit, channels=("R", "B", "W")), balance=balance)
    assert fit.channels == ("R", "B", "C")
    assert np.array_equal(as_c.rgb, as_w.rgb)
