"""Colours from a calibration's matrices: R, G, B as the file says, W as its curve would, to what three numbers tell."""

import numpy as np
import pytest

from isp.colour.calibrated_colours import MEAN_SRGB, MOMENTS_SRGB, UNEXPLAINED, fit_of_calibration, neutral_under
from isp.colour.colour_fit import fit_colours, training
from render.illuminants import illuminant
from render.spectrum import DEFAULT_WAVELENGTH_NM, band_widths
from scenes.reflectances import color_checker
from sensor.presets import preset
from studies.photograph.camera import calibrate

NM = DEFAULT_WAVELENGTH_NM
WIDTH = band_widths(NM)
SURFACES = np.array([reflectance.band_average(NM, WIDTH) for _, reflectance in color_checker()])
LETTERS = ("R", "G", "B", "W")


def test_the_training_moments_are_the_color_checkers() -> None:
    responses = preset("low_noise", "rgbw").responses.band_average(LETTERS, NM, WIDTH)
    _, srgb = training(responses, NM, illuminant("D65").band_average(NM, WIDTH), SURFACES)
    assert srgb.mean(axis=0) == pytest.approx(MEAN_SRGB, abs=6e-5)
    assert srgb.T @ srgb / 24 == pytest.approx(MOMENTS_SRGB, abs=6e-5)


def test_without_noise_r_g_b_become_colour_as_the_file_says() -> None:
    for light in ["D65", "A", "D50", "F11"]:
        colour = calibrate(preset("low_noise", "rgbw"), illuminant(light))
        assert fit_of_calibration(colour, LETTERS).matrix() == pytest.approx(colour.to_srgb, abs=1e-9), light


@pytest.mark.parametrize("light", ["D65", "A"])
def test_with_noise_it_is_nearly_the_fit_of_the_curves(light: str) -> None:
    sensor = preset("low_noise", "rgbw")
    colour = calibrate(sensor, illuminant(light))
    responses = sensor.responses.band_average(LETTERS, NM, WIDTH)
    spectrum = illuminant(light).band_average(NM, WIDTH)
    known, signals = (
        fit_colours(LETTERS, responses, NM, spectrum, SURFACES),
        training(responses, NM, spectrum, SURFACES),
    )
    noise = np.array([1e-2, 4e-3, 1.2e-2, 3e-4])

    def error(matrix: np.ndarray) -> float:
        return float(((signals[0] @ matrix.T - signals[1]) ** 2).mean() * 3 + (matrix**2 @ noise).sum())

    best, ours = error(known.matrix(LETTERS, noise)), error(fit_of_calibration(colour, LETTERS).matrix(LETTERS, noise))
    assert ours == pytest.approx(best, rel=0.1)
    # what a matrix that doesn't know the noise costs here
    assert error(np.hstack([known.matrix(), np.zeros((3, 1))])) > 2 * ours


def test_without_noise_w_stays_out_of_the_colours() -> None:
    fit = fit_of_calibration(calibrate(preset("low_noise", "rgbw"), illuminant("D65")), LETTERS)
    assert fit.matrix(LETTERS)[:, 3] == pytest.approx(0.0, abs=1e-9)  # R, G, B tell all that the matrices know
    responses = preset("low_noise", "rgbw").responses.band_average(LETTERS, NM, WIDTH)
    signals, srgb = training(responses, NM, illuminant("D65").band_average(NM, WIDTH), SURFACES)
    row = np.linalg.solve(MOMENTS_SRGB, fit.cross[3])
    assert np.sqrt(((signals[:, 3] - srgb @ row) ** 2).mean()) == pytest.approx(UNEXPLAINED, rel=0.2)


def test_three_channels_need_no_more_than_their_matrix() -> None:
    colour = calibrate(preset("low_noise", "bayer"), illuminant("D65"))
    fit = fit_of_calibration(colour, LETTERS[:3])
    assert fit.matrix() == pytest.approx(colour.to_srgb, abs=1e-9)


def test_the_neutral_under_another_light_is_the_cameras_own() -> None:
    for cfa in ["bayer", "rgbw"]:
        sensor = preset("low_noise", cfa)
        colour = calibrate(sensor, illuminant("F11"))  # the light of the exposure plays no part
        for light, most in (
            ("A", 1e-3),
            ("D65", 1e-3),
            ("D50", 0.05),
            ("3000K", 0.05),
            ("D7000K", 0.05),
            ("sunlight", 0.06),
        ):
            known = calibrate(sensor, illuminant(light)).neutral
            assert neutral_under(colour, illuminant(light) * 7.0) == pytest.approx(known, rel=most), light
