"""Colours by the light around a pixel: each light's own matrix, what counts as light, and a frame of two lights."""

import numpy as np
import pytest
from builders import raw_image
from scipy.ndimage import convolve1d

from isp.colour.colour_fit import ColourFit, fit_colours, relative_noise
from isp.colour.light_around import SIGMA, apply_by_light, light_around
from isp.colour.white_balance import WhiteBalance
from isp.interleaved import pipeline
from render.illuminants import illuminant
from render.spectrum import DEFAULT_WAVELENGTH_NM, band_widths, photons_per_joule
from scenes.reflectances import color_checker_reflectances
from sensor.cfa import mask
from sensor.curves import rgbw

NM = DEFAULT_WAVELENGTH_NM
WIDTH = band_widths(NM)
LIGHT = illuminant("D65").band_average(NM, WIDTH)
RESPONSES = rgbw().band_average(tuple("RGBW"), NM, WIDTH)
SURFACES = {name: curve.band_average(NM, WIDTH) for name, curve in color_checker_reflectances()}


@pytest.fixture(scope="module")
def fit() -> ColourFit:
    return fit_colours("RGBW", RESPONSES, NM, LIGHT, np.array(list(SURFACES.values())))


def test_each_pixel_has_the_matrix_of_its_light() -> None:
    """At the mean, at four times the mean, and at 1.6 times the mean, where 1/s is halfway between."""
    rng = np.random.default_rng(1)
    matrices = rng.normal(size=(2, 3, 4))
    pixels = rng.normal(size=(5, 3, 4))
    found = apply_by_light(pixels, np.broadcast_to([1.0, 1.6, 4.0], (5, 3)), matrices)
    for column, matrix in enumerate((matrices[0], matrices.mean(axis=0), matrices[1])):
        assert found[:, column] == pytest.approx(pixels[:, column] @ matrix.T, rel=1e-9, abs=1e-9), column


def test_light_is_a_gaussian_mean_over_the_mean_of_what_is_not_full() -> None:
    dn = np.full((60, 60), 1000)
    dn[:, 40:] = 4000
    raw = raw_image(dn, white_dn=3000.0)
    plane = np.where(np.arange(60) < 20, 10.0, 30.0) + np.zeros((60, 1))
    reach = np.arange(-8, 9)
    weights = np.exp(-(reach**2) / 2 / SIGMA**2)
    expected = convolve1d(plane, weights / weights.sum(), axis=1, mode="reflect") / 20.0
    assert raw.saturated.mean() == pytest.approx(1 / 3)
    assert light_around(raw, plane) == pytest.approx(np.maximum(expected, 1.0), rel=1e-3)
    assert light_around(raw, np.where(raw.saturated, 300.0, 10.0)).max() == 4.0
    assert np.all(light_around(raw, np.zeros(plane.shape)) == 1.0)
    full = raw_image(np.full((60, 60), 4000), white_dn=3000.0)
    assert light_around(full, plane).max() == pytest.approx(30.0 / (70.0 / 3.0), rel=1e-3)


def test_noise_at_a_light_is_that_of_a_frame_of_this_light(fit: ColourFit) -> None:
    raw = raw_image(np.full((16, 16), 150), white_dn=10_100.0, read_noise_e=3.0)
    estimate, gain = np.broadcast_to([20.0, 50.0, 25.0, 300.0], (16, 16, 4)), np.full((16, 16, 4), 0.02)
    gains = np.array([2.5, 1.0, 2.0, 1 / 6])
    several = relative_noise(raw, estimate, gain, gains, fit, (1.0, 2.0, 8.0))
    for times, found in zip((1.0, 2.0, 8.0), several, strict=True):
        assert found == pytest.approx(relative_noise(raw, times * estimate, gain, gains, fit), rel=1e-12)


def test_the_bright_half_of_a_frame_keeps_the_colour_it_has_alone(fit: ColourFit, monkeypatch) -> None:
    """Four times as bright as the other half; by the matrix of the frame's mean its colour is paler than alone."""
    photons = LIGHT * photons_per_joule(NM) * WIDTH
    white_e = 40.0 * (RESPONSES @ photons) / (RESPONSES[3] @ photons)
    surface_e = 40.0 * (RESPONSES @ (photons * SURFACES["red"])) / (RESPONSES[3] @ photons)
    rng = np.random.default_rng(2)
    share = np.where(np.arange(160) < 80, 1.0, 0.25)
    expected = np.zeros((80, 160))
    for name, electrons in zip("RGBW", surface_e, strict=True):
        expected += mask(("RG", "BW"), name, expected.shape) * electrons * share
    read = np.rint(rng.poisson(expected) + rng.normal(0.0, 2.0, expected.shape)) + 100

    def developed(dn):
        raw = raw_image(dn, ("RG", "BW"), read_noise_e=2.0)
        given = WhiteBalance.of(raw, white_e, white_e)
        rgb = pipeline.picture_interleaved(raw, fit, balance=given, substitution_snr=0.0).rgb
        return rgb[8:-8, 8:64].mean(axis=(0, 1))

    def redness(rgb):
        return (rgb[0] - rgb[1]) / rgb.sum()

    beside, alone = redness(developed(read)), redness(developed(read[:, :80]))
    monkeypatch.setattr(pipeline, "light_around", lambda raw, plane: np.ones(plane.shape))
    by_the_mean = redness(developed(read))
    assert by_the_mean < 0.9 * alone < beside, (by_the_mean, alone, beside)
