"""Colour at a known noise: least squares without it, Wiener's matrix with it, neutrals kept throughout."""

import numpy as np
import pytest
from builders import raw_image
from refusal import refusal

from isp.colour.calibrated_colours import MEAN_SRGB, MOMENTS_SRGB, UNEXPLAINED, fit_of_calibration, neutral_under
from isp.colour.colour_fit import LEAST_SIGNAL, ColourFit, fit_colours, fit_matrix, relative_noise, training
from isp.colour.white_balance import neutral_response
from isp.processors.catalogue import PROCESSORS
from render.illuminants import illuminant
from render.spectrum import DEFAULT_WAVELENGTH_NM, band_widths, colour_matching_functions, even_bands, photons_per_joule
from rodcone.colour_spaces import adapt_to_d65, xyz_to_srgb
from rodcone.errors import InputError
from scenes.reflectances import color_checker_reflectances
from sensor.curves import matched_transmittance, rgbw
from sensor.presets import preset
from sensor.raw import RawImage
from studies.metrics.truth import light_in_bands
from studies.photograph.camera import calibrate, colour_fit

NM = DEFAULT_WAVELENGTH_NM
WIDTH = band_widths(NM)
LIGHT = illuminant("D65").band_average(NM, WIDTH)
SURFACES = np.array([reflectance.band_average(NM, WIDTH) for _, reflectance in color_checker_reflectances()])
CHANNELS = ("R", "G", "B", "W")
RESPONSES = rgbw().band_average(CHANNELS, NM, WIDTH)


@pytest.fixture(scope="module")
def fit() -> ColourFit:
    return fit_colours(CHANNELS, RESPONSES, NM, LIGHT, SURFACES)


def test_without_noise_it_is_the_least_squares_matrix(fit: ColourFit) -> None:
    assert fit.matrix() == pytest.approx(fit_matrix(RESPONSES[:3], NM, LIGHT, SURFACES), abs=1e-8)
    curves = RESPONSES * np.linspace(1.0, 2.0, NM.size)
    fourth = fit_colours(("R", "G", "B", "E"), curves, NM, LIGHT, SURFACES)
    assert fourth.matrix("RGBE") == pytest.approx(fit_matrix(curves, NM, LIGHT, SURFACES), abs=1e-8)


@pytest.mark.parametrize("light", ["D65", "A", "F11", "sodium_high"])
def test_without_noise_w_takes_no_part(light: str) -> None:
    """So RGBW is where RGB is on any scene; W's column of the least-squares matrix had up to 0.34."""
    spd = illuminant(light).band_average(NM, WIDTH)
    without_noise = fit_colours(CHANNELS, RESPONSES, NM, spd, SURFACES).matrix(CHANNELS)
    expected = np.hstack([fit_matrix(RESPONSES[:3], NM, spd, SURFACES), np.zeros((3, 1))])
    assert without_noise == pytest.approx(expected, abs=1e-7)


def test_w_is_the_colours_and_an_independent_rest(fit: ColourFit) -> None:
    """Surfaces drawn anew: W from the colours by weights of sum 1, and of three times the variance besides."""
    signals, target = training(RESPONSES, NM, LIGHT, SURFACES)
    colours, white = signals[:, :3], signals[:, 3]
    share, *_ = np.linalg.lstsq(colours[:, :2] - colours[:, 2:], white - colours[:, 2], rcond=None)
    explained = colours @ [*share, 1.0 - share.sum()]
    rest = np.sqrt(3.0 * np.mean((white - explained) ** 2))
    both = [np.column_stack([colours, explained + sign * rest]) for sign in (1.0, -1.0)]
    assert fit.moments == pytest.approx(np.mean([part.T @ part for part in both], axis=0) / len(signals), rel=1e-9)
    assert fit.cross == pytest.approx(np.mean([part.T @ target for part in both], axis=0) / len(signals), rel=1e-9)


@pytest.mark.parametrize("noise", [[1e-6, 1e-6, 1e-6, 1e-8], [1e-2, 4e-3, 2e-2, 1e-4], [3.0, 1.0, 2.0, 0.5]])
def test_no_matrix_with_rows_of_1_has_a_smaller_expected_error(fit: ColourFit, noise: list[float]) -> None:
    _, target = training(RESPONSES, NM, LIGHT, SURFACES)

    def error(matrix: np.ndarray) -> float:  # of surface and white noise together, summed over sRGB
        squares = matrix @ fit.moments @ matrix.T - 2 * matrix @ fit.cross
        return float(np.trace(squares) + np.mean(target**2) * 3 + (matrix**2 @ noise).sum())

    best = fit.matrix(CHANNELS, noise)
    assert best.sum(axis=1) == pytest.approx(1.0, abs=1e-9)
    rng = np.random.default_rng(0)
    for size in (1e-4, 1e-2, 1.0):
        for _ in range(50):
            change = rng.normal(size=(3, 4)) * size
            assert error(best + change - change.mean(axis=1, keepdims=True)) > error(best)


def frame(level_e: float, read_noise_e: float = 3.0) -> RawImage:
    return raw_image(np.full((16, 16), level_e + 100), white_dn=10_100.0, read_noise_e=read_noise_e, dsnu_e=4.0)


def test_relative_noise_in_closed_form(fit: ColourFit) -> None:
    estimate, gain = np.broadcast_to([20.0, 50.0, 25.0, 300.0], (16, 16, 4)), np.full((16, 16, 4), 0.02)
    gains = np.array([2.5, 1.0, 2.0, 1 / 6])
    dark = 9 + 16 + 1 / 12
    white_e = 50.0 / fit.mean[1]
    expected = np.array([(20 + dark) * 6.25, 50 + dark, (25 + dark) * 4, (300 + dark) / 36]) * 0.02 / white_e**2
    assert relative_noise(frame(50), estimate, gain, gains, fit) == pytest.approx(expected, rel=1e-12)


def test_a_frame_of_noise_alone_stays_finite_and_leaves_colour_to_w(fit: ColourFit) -> None:
    estimate, gain = np.full((16, 16, 4), -0.5), np.full((16, 16, 4), 0.02)
    noise = relative_noise(frame(0), estimate, gain, np.array([2.5, 1.0, 2.0, 1 / 6]), fit)
    assert noise.max() == pytest.approx(LEAST_SIGNAL**-2, rel=1e-9)
    matrix = fit.matrix(CHANNELS, noise)
    assert matrix.sum(axis=1) == pytest.approx(1.0, abs=1e-6)
    assert np.all(matrix[:, 3] > 0.9)


def test_channels_that_do_not_fit_are_refused(fit: ColourFit) -> None:
    refusal(fit.matrix, ("C",), match=r"^channels: \('C',\) are not allowed; fitted were")
    with pytest.raises(InputError, match=r"^responses: 4 channels don't fit the names \('R', 'G', 'B'\)"):
        fit_colours("RGB", RESPONSES, NM, LIGHT, SURFACES)


def test_under_one_wavelength_all_channels_count_alike_and_neutrals_stay_neutral() -> None:
    light = np.where(np.arange(NM.size) == 20, 1.0, 0.0)
    alone = fit_colours(CHANNELS, RESPONSES, NM, light, SURFACES)
    # the sums cancel to some 1e-17 beside a least noise of 1e-13
    assert alone.matrix() == pytest.approx(np.full((3, 3), 1 / 3), abs=1e-3)
    assert alone.matrix().sum(axis=1) == pytest.approx(np.ones(3), abs=1e-12)


def test_a_plain_matrix_stands_at_any_noise() -> None:
    matrix = np.array([[1.6, -0.5, -0.1], [-0.2, 1.4, -0.2], [0.0, -0.5, 1.5]])
    plain = ColourFit.of(matrix.tolist())
    assert ColourFit.of(plain) is plain
    for noise in (0.0, 1e-3, 10.0):
        np.testing.assert_array_equal(plain.matrix(noise=noise), matrix)
        np.testing.assert_array_equal(plain.matrix("RGBW", noise), np.hstack([matrix, np.zeros((3, 1))]))


def test_what_is_no_matrix_is_refused() -> None:
    for matrix in [np.ones((2, 3)), np.full((3, 3), np.nan), np.ones(9)]:
        refusal(ColourFit.of, matrix, match=r"^matrix: shape .* is not allowed; give 3x3 finite numbers")


def test_matrix_is_exact_for_a_camera_that_sees_as_the_observer_does() -> None:
    # Luther: with responses proportional to x, y, z per photon, a matrix maps every surface to its true colour.
    curves = np.array([curve.band_average(NM, WIDTH) for curve in colour_matching_functions()])
    spd = illuminant("D65").band_average(NM, WIDTH)
    responses = curves / photons_per_joule(NM) * 1e17
    matrix = fit_matrix(responses, NM, spd, SURFACES)
    xyz = (SURFACES * spd) @ curves.T
    white = curves @ spd
    target = xyz_to_srgb(adapt_to_d65(xyz / white[1], white))
    assert (xyz / white) @ matrix.T == pytest.approx(target, abs=1e-9)


def test_shapes_that_do_not_fit_are_refused() -> None:
    for responses, surfaces, name in [
        (np.ones((3, 7)), SURFACES, "responses"),
        (np.ones((3, 40)), np.ones((2, 40)), "reflectances"),
    ]:
        refusal(fit_matrix, responses, NM, np.ones(40), surfaces, match=f"^{name}: .*; give")


def test_matrix_takes_bands_of_uneven_widths() -> None:
    # every band as two, the first of them 2 and 8 nm wide
    spd = illuminant("D65").band_average(NM, WIDTH)
    curves = rgbw().band_average(("R", "G", "B"), NM, WIDTH)
    split = [np.repeat(values, 2, axis=-1) for values in (curves, SURFACES, spd)]
    halves = np.ravel(np.stack([NM - 2.5, NM + 2.5], axis=1))
    widths = np.full(halves.shape, 5.0)
    widths[:2], halves[:2] = (2.0, 8.0), (NM[0] - 4.0, NM[0] + 1.0)
    uneven = fit_matrix(split[0], halves, split[2], split[1], widths)
    assert uneven == pytest.approx(fit_matrix(curves, NM, spd, SURFACES), abs=2e-3)
    refusal(fit_matrix, split[0], halves, split[2], split[1], match="width_nm")


def test_fit_takes_transposed_tables_alike() -> None:
    table = RESPONSES[:3]
    same = fit_matrix(table, NM, LIGHT, SURFACES)  # but for the order in which BLAS adds in another layout
    assert fit_matrix(table.T, NM, LIGHT, SURFACES.T) == pytest.approx(same, rel=1e-9)


# Colours from a calibration's matrices: R, G, B as the file says, W as its curve would, to what three numbers tell.


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


def test_a_fit_in_wide_bands_is_that_of_bands_of_1_nm() -> None:
    """Camera and eye follow the lamp within bands of 20 nm; by averages they were 0.009 to 0.036 off."""
    sensor, processor = preset("low_noise"), PROCESSORS["bayer"]
    for name, most in {"D65": 5e-4, "A": 5e-4, "LED-B3": 1e-3, "F2": 4e-3, "F11": 4e-3, "LED-RGB1": 1e-3}.items():
        wide, fine = (
            colour_fit(sensor, processor, light_in_bands(illuminant(name), *even_bands((380.0, 780.0), count)))
            for count in (20, 400)
        )
        assert wide.matrix() == pytest.approx(fine.matrix(), abs=most), name


def test_a_neutral_is_the_integral_over_the_lines_and_corners_of_light_and_curves() -> None:
    nm = np.arange(380.005, 780.0, 0.01)
    light = np.interp(nm, illuminant("D65").wavelength_nm, illuminant("D65").values) * nm
    fine = np.array([np.interp(nm, x.wavelength_nm, x.values) for x in rgbw().curves.values()]) @ light
    found = neutral_response(tuple(rgbw().curves))
    assert found / found[1] == pytest.approx(fine / fine[1], rel=1e-6)
    assert matched_transmittance(rgbw()) == pytest.approx(fine[1] / fine[3], rel=1e-6)
