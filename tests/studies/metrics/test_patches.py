"""Patches: where the ColorChecker's lie, in closed form and in a render; noise and colour error in closed form."""

import numpy as np
import pytest
from skimage.color import deltaE_ciede2000, rgb2lab

from render.engine import render
from rodcone.colour_spaces import encode_srgb
from rodcone.errors import InputError
from scenes.catalog import load
from scenes.reflectances import color_checker
from studies.metrics.target_figures import patch_colour_errors, patch_masks, patch_means, patch_snr_db

SHAPE = (96, 128)
MASKS = patch_masks(load("color_checker"), SHAPE)


def test_patches_lie_in_rows_of_six_45_mm_apart() -> None:
    # 20 degrees over the 96 rows, from 0.72 m less the patches' 0.7 mm.
    pixels_per_m = 96 / (2 * (0.72 - 0.0007) * np.tan(np.radians(10.0)))
    assert MASKS.shape == (24, *SHAPE)
    assert MASKS.sum(axis=0).max() == 1
    for index, mask in enumerate(MASKS):
        row, column = divmod(index, 6)
        rows, columns = np.nonzero(mask)
        # A window that is cut to whole pixels is centred within half a pixel.
        assert rows.mean() + 0.5 == pytest.approx(48 + (row - 1.5) * 0.045 * pixels_per_m, abs=0.5001)
        assert columns.mean() + 0.5 == pytest.approx(64 + (column - 2.5) * 0.045 * pixels_per_m, abs=0.5001)
        for places in (rows, columns):
            assert np.ptp(places) + 1 == pytest.approx(0.6 * 0.04 * pixels_per_m, abs=1.0001)


def test_each_patch_of_a_render_has_its_own_reflectance() -> None:
    bands_nm = np.array([480.0, 580.0, 680.0])
    made = render(load("color_checker", light="E"), SHAPE, wavelength_nm=bands_nm, spp=16, seed=1)
    picture = np.moveaxis(made.radiance[0].astype(np.float64), 0, -1)
    truth = np.array([curve.band_average(bands_nm, np.full(3, 100.0)) for _, curve in color_checker()])
    error = np.sqrt(made.variance[0].astype(np.float64)).mean(axis=(1, 2)) / np.sqrt(MASKS.sum(axis=(1, 2)).min())
    assert error.max() < 0.01  # neighbours differ by far more, in some band
    # 72 comparisons; the variance comes from 8 passes, and a steep curve scatters more than the mean pixel: 8 errors.
    assert np.abs(patch_means(picture, MASKS) - truth).max() < 8 * error.max()


def test_snr_of_even_steps_is_exact() -> None:
    # 10 -+ 1 by turns: n / (n - 1) is the sample's variance.
    masks = np.ones((1, 4, 4), dtype=bool)
    picture = np.where(np.arange(16).reshape(4, 4, 1) % 2, 11.0, 9.0)
    assert patch_snr_db(picture, masks) == pytest.approx(np.array([[20 * np.log10(10 / np.sqrt(16 / 15))]]))
    assert patch_snr_db(np.ones((4, 4, 2)), masks).tolist() == [[np.inf, np.inf]]
    even = np.full((*SHAPE, 3), (0.1, 0.2, 0.7))  # whose sums are rounded, each processor's in its own way
    assert (patch_snr_db(even, MASKS) == np.inf).all()
    for dark in (picture - 10.0, picture - 20.0, np.zeros((4, 4, 1)), np.full((4, 4, 1), -0.25)):
        assert patch_snr_db(dark, masks).tolist() == [[-np.inf]]


def test_snr_of_noise_is_mean_over_deviation() -> None:
    # A deviation of n normal numbers has the relative standard error 1 / sqrt(2 n), a mean its own: 4.8 errors fail
    # once in 100 000 over 24 patches and 3 channels.
    mean = np.array([50.0, 20.0, 5.0])
    picture = mean + np.random.default_rng(2).normal(0, 1.0, (*SHAPE, 3))
    count = MASKS.sum(axis=(1, 2)).min()
    error_db = 20 / np.log(10) * np.sqrt(1 / (2 * count) + 1 / (5.0**2 * count))
    assert np.abs(patch_snr_db(picture, MASKS) - 20 * np.log10(mean)).max() < 5.5 * error_db
    assert np.abs(patch_snr_db(picture, MASKS) - 20 * np.log10(mean)).mean() < error_db


def test_colour_error_is_that_of_the_mean_colours_whatever_the_noise() -> None:
    rng = np.random.default_rng(3)
    colours = rng.uniform(0.05, 0.8, (24, 3))
    shifted = colours * (1.1, 1.0, 0.9)
    truth, picture = np.zeros((2, *SHAPE, 3))
    for mask, colour, other in zip(MASKS, colours, shifted, strict=True):
        truth[mask], noise = colour, rng.normal(0, 0.3, (mask.sum(), 3))
        picture[mask] = other + noise - noise.mean(axis=0)
    assert picture.min() < -0.3  # clipped or encoded first, this noise would change the colours
    plain = deltaE_ciede2000(rgb2lab(encode_srgb(shifted)), rgb2lab(encode_srgb(colours)))
    inside = shifted.max(axis=1) < 1
    # scikit-image's sRGB matrix has other last digits.
    assert patch_colour_errors(picture, truth, MASKS)[inside] == pytest.approx(plain[inside], rel=2e-3)
    assert patch_colour_errors(truth, truth, MASKS) == pytest.approx(np.zeros(24), abs=1e-12)


def test_what_has_no_patches_is_refused() -> None:
    with pytest.raises(InputError, match=r"^scene: 'flat_field' has no patches"):
        patch_masks(load("flat_field"), SHAPE)
    with pytest.raises(InputError, match=r"^shape: \(12, 16\) leaves \d pixels"):
        patch_masks(load("color_checker"), (12, 16))
    with pytest.raises(InputError, match=r"^inner: 1\.5"):
        patch_masks(load("color_checker"), SHAPE, 1.5)
