"""Colour at a known noise: least squares without it, Wiener's matrix with it, neutrals kept throughout."""

import numpy as np
import pytest

from isp.colour.camera_colour import fit_matrix, training
from isp.colour.colour_fit import LEAST_SIGNAL, ColourFit, fit_colours, relative_noise
from render.illuminants import illuminant
from render.spectrum import DEFAULT_WAVELENGTH_NM, band_widths
from rodcone.errors import InputError
from scenes.reflectances import color_checker
from sensor.curves import rgbw
from sensor.raw import RawImage

NM = DEFAULT_WAVELENGTH_NM
WIDTH = band_widths(NM)
LIGHT = illuminant("D65").band_average(NM, WIDTH)
SURFACES = np.array([reflectance.band_average(NM, WIDTH) for _, reflectance in color_checker()])
LETTERS = ("R", "G", "B", "W")
RESPONSES = rgbw().band_average(LETTERS, NM, WIDTH)


@pytest.fixture(scope="module")
def fit() -> ColourFit:
    return fit_colours(LETTERS, RESPONSES, NM, LIGHT, SURFACES)


@pytest.mark.parametrize("letters", [("R", "G", "B"), LETTERS])
def test_without_noise_it_is_the_least_squares_matrix(fit: ColourFit, letters: tuple[str, ...]) -> None:
    expected = fit_matrix(RESPONSES[: len(letters)], NM, LIGHT, SURFACES)
    assert fit.matrix(letters) == pytest.approx(expected, abs=1e-8)
    assert np.asarray(fit) == pytest.approx(fit_matrix(RESPONSES[:3], NM, LIGHT, SURFACES), abs=1e-8)


@pytest.mark.parametrize("noise", [[1e-6, 1e-6, 1e-6, 1e-8], [1e-2, 4e-3, 2e-2, 1e-4], [3.0, 1.0, 2.0, 0.5]])
def test_no_matrix_with_rows_of_1_has_a_smaller_expected_error(fit: ColourFit, noise: list[float]) -> None:
    signals, target = training(RESPONSES, NM, LIGHT, SURFACES)

    def error(matrix: np.ndarray) -> float:  # of surface and white noise together, summed over sRGB
        return float(np.mean((signals @ matrix.T - target) ** 2) * 3 + (matrix**2 @ noise).sum())

    best = fit.matrix(LETTERS, noise)
    assert best.sum(axis=1) == pytest.approx(1.0, abs=1e-9)
    rng = np.random.default_rng(0)
    for size in (1e-4, 1e-2, 1.0):
        for _ in range(50):
            change = rng.normal(size=(3, 4)) * size
            assert error(best + change - change.mean(axis=1, keepdims=True)) > error(best)


def test_the_expected_error_is_what_noise_drawn_at_random_makes(fit: ColourFit) -> None:
    signals, target = training(RESPONSES, NM, LIGHT, SURFACES)
    noise = np.array([1e-2, 4e-3, 2e-2, 1e-3])
    matrix, draws = fit.matrix(LETTERS, noise), 4000
    noisy = signals + np.sqrt(noise) * np.random.default_rng(0).normal(size=(draws, *signals.shape))
    errors = ((noisy @ matrix.T - target) ** 2).sum(axis=(1, 2))
    expected = ((signals @ matrix.T - target) ** 2).sum() + len(signals) * (matrix**2 @ noise).sum()
    # false alarm 1e-6 at 4.9 standard errors of the mean
    assert errors.mean() == pytest.approx(expected, abs=4.9 * errors.std() / np.sqrt(draws))


def test_the_noisier_the_colours_the_more_w_decides(fit: ColourFit) -> None:
    shares = [
        fit.matrix(LETTERS, np.array([1.0, 0.5, 1.1, 0.02]) * scale)[:, 3].mean() for scale in (1e-6, 1e-3, 1, 1e6)
    ]
    assert shares == sorted(shares)
    assert shares[-1] == pytest.approx(1.0, abs=0.1)


def frame(level_e: float, read_noise_e: float = 3.0) -> RawImage:
    dn = np.full((16, 16), level_e + 100).astype(np.uint16)
    return RawImage(dn, ("RG", "BW"), 100.0, 10_100.0, 1.0, read_noise_e, 4.0, 0.0, 0.01)


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
    matrix = fit.matrix(LETTERS, noise)
    assert matrix.sum(axis=1) == pytest.approx(1.0, abs=1e-6)
    assert np.all(matrix[:, 3] > 0.9)


def test_letters_that_do_not_fit_are_refused(fit: ColourFit) -> None:
    with pytest.raises(InputError, match=r"^letters: \('C',\) are not allowed; fitted were"):
        fit.matrix(("C",))
    with pytest.raises(InputError, match=r"^responses: 4 channels don't fit the letters \('R', 'G', 'B'\)"):
        fit_colours("RGB", RESPONSES, NM, LIGHT, SURFACES)


def test_under_one_wavelength_all_channels_count_alike_and_neutrals_stay_neutral() -> None:
    light = np.where(np.arange(NM.size) == 20, 1.0, 0.0)
    alone = fit_colours(LETTERS, RESPONSES, NM, light, SURFACES)
    # the sums cancel to some 1e-17 beside a least noise of 1e-13
    assert np.asarray(alone) == pytest.approx(np.full((3, 3), 1 / 3), abs=1e-3)
    assert np.asarray(alone).sum(axis=1) == pytest.approx(np.ones(3), abs=1e-12)
