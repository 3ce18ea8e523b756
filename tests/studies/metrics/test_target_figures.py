"""Figures of targets: each on its own scene, None on others and where the picture doesn't let them be measured."""

import numpy as np
import pytest
from refusal import refusal
from skimage.color import deltaE_ciede2000, rgb2lab

from render.engine import render
from rodcone.colour_spaces import encode_srgb, luminance_of_srgb
from scenes.catalog import load
from scenes.reflectances import color_checker
from studies.metrics.mtf import edge_response
from studies.metrics.target_figures import (
    TargetFigures,
    patch_colour_errors,
    patch_masks,
    patch_means,
    patch_snr_db,
    target_figures,
)

SHAPE = (96, 96)


def edge(noise: float) -> np.ndarray:
    """A straight edge through the middle, 5 degrees off the vertical, blurred over 3 pixels."""
    row, column = np.indices((64, 64)) - 31.5
    distance = column * np.cos(np.radians(5)) - row * np.sin(np.radians(5))
    plane = 0.1 + 0.4 * np.clip(0.5 + distance / 3, 0, 1)
    return np.repeat(plane[..., None], 3, axis=2) + np.random.default_rng(1).normal(0, noise, (64, 64, 3))


def test_the_edge_has_the_response_of_its_luminance_and_no_other_figure() -> None:
    picture = edge(0.001)
    found = target_figures("slanted_edge", picture, picture)
    assert found.mtf50_cy_per_px == edge_response(luminance_of_srgb(picture)).mtf50_cycles_per_px
    # A box of 3 pixels across the edge: sinc(3 f) is half at f = 0.2012; no sampling blur, as pixels are points here.
    assert found.mtf50_cy_per_px == pytest.approx(0.6034 / 3, rel=0.02)
    assert (found.chart_delta_e_mean, found.patch_snr_db) == (None, None)
    assert target_figures("slanted_edge", edge(2.0), picture) == TargetFigures(), "no edge in so much noise"
    assert target_figures("still_life", picture, picture) == TargetFigures()


def test_the_chart_s_figures_are_means_over_its_patches() -> None:
    masks = patch_masks(load("color_checker"), SHAPE)
    truth = np.full((*SHAPE, 3), 0.2)
    for place, mask in enumerate(masks):
        truth[mask] = 0.1 + 0.03 * place
    # Luminance 10 -+ 1 by turns along each row has 20 dB; the mean colour stays the truth's where a patch's turns do.
    stripes = np.where(np.indices(SHAPE).sum(axis=0) % 2, 1.1, 0.9)[..., None]
    found = target_figures("color_checker", truth * stripes, truth)
    assert found.patch_snr_db == pytest.approx(20.0, abs=0.1)
    assert found.chart_delta_e_mean == pytest.approx(0.0, abs=0.1)
    assert found.mtf50_cy_per_px is None
    # Twice the blue moves every grey by much.
    blue = target_figures("color_checker", truth * (1, 1, 2), truth).chart_delta_e_mean
    assert blue is not None
    assert blue > 10


def test_a_chart_in_the_dark_has_no_snr_and_patches_too_small_no_figure() -> None:
    even = np.full((*SHAPE, 3), 0.2)
    assert target_figures("color_checker", -even, even).patch_snr_db is None  # means below 0 have no decibels
    small = np.full((12, 16, 3), 0.2)
    assert target_figures("color_checker", small, small) == TargetFigures()


# Patches: where the ColorChecker's lie, in closed form and in a render; noise and colour error in closed form.

CHART_SHAPE = (96, 128)
MASKS = patch_masks(load("color_checker"), CHART_SHAPE)


def test_patches_lie_in_rows_of_six_45_mm_apart() -> None:
    # 20 degrees over the 96 rows, from 0.72 m less the patches' 0.7 mm.
    pixels_per_m = 96 / (2 * (0.72 - 0.0007) * np.tan(np.radians(10.0)))
    assert MASKS.shape == (24, *CHART_SHAPE)
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
    made = render(load("color_checker", light="E"), CHART_SHAPE, wavelength_nm=bands_nm, spp=16, seed=1)
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
    even = np.full((*CHART_SHAPE, 3), (0.1, 0.2, 0.7))  # whose sums are rounded, each processor's in its own way
    assert (patch_snr_db(even, MASKS) == np.inf).all()
    for dark in (picture - 10.0, picture - 20.0, np.zeros((4, 4, 1)), np.full((4, 4, 1), -0.25)):
        assert patch_snr_db(dark, masks).tolist() == [[-np.inf]]


def test_colour_error_is_that_of_the_mean_colours_whatever_the_noise() -> None:
    rng = np.random.default_rng(3)
    colours = rng.uniform(0.05, 0.8, (24, 3))
    shifted = colours * (1.1, 1.0, 0.9)
    truth, picture = np.zeros((2, *CHART_SHAPE, 3))
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
    refusal(patch_masks, load("flat_field"), CHART_SHAPE, match=r"^scene: 'flat_field' has no patches")
    refusal(patch_masks, load("color_checker"), (12, 16), match=r"^shape: \(12, 16\) leaves \d pixels")
