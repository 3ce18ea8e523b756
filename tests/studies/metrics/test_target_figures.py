"""Figures of targets: each on its own scene, None on others and where the picture doesn't let them be measured."""

from collections.abc import Callable
from itertools import product

import numpy as np
import pytest
from refusal import refusal
from scipy.optimize import brentq
from scipy.special import erf
from skimage.color import deltaE_ciede2000, rgb2lab

from render.engine import render
from rodcone.colour_spaces import encode_srgb, luminance_of_srgb
from scenes.catalogue import load
from scenes.reflectances import color_checker_reflectances
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
    truth = np.array([curve.band_average(bands_nm, np.full(3, 100.0)) for _, curve in color_checker_reflectances()])
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


# Sharpness from a slanted edge: edges whose response is known in closed form, clean, noisy and rendered.


SIDE = 80
Profile = Callable[[np.ndarray], np.ndarray]


def tilted_edge(degrees: float, profile: Profile, side: int = SIDE) -> np.ndarray:
    """Dark to the left, bright to the right: `profile` of the distance [px] to an edge through the middle."""
    row, column = np.indices((side, side)) - (side - 1) / 2
    angle = np.radians(degrees)
    return profile(column * np.cos(angle) - row * np.sin(angle))


def gaussian(sigma_px: float) -> Profile:
    return lambda distance: 0.5 * (1 + erf(distance / (sigma_px * np.sqrt(2))))


def pixel_box(degrees: float) -> Profile:
    """Share of a square pixel that lies on the bright side: a step blurred by boxes of the cosine and the sine."""
    c, s = np.cos(np.radians(degrees)), abs(np.sin(np.radians(degrees)))
    ends = (((c + s) / 2, 1), ((c - s) / 2, -1), (-(c - s) / 2, -1), (-(c + s) / 2, 1))
    return lambda distance: sum(sign * np.maximum(distance + end, 0) ** 2 / 2 for end, sign in ends) / (c * s)


def box_mtf(degrees: float, frequency: np.ndarray | float) -> np.ndarray:
    angle = np.radians(degrees)
    return np.sinc(frequency * np.cos(angle)) * np.sinc(frequency * np.sin(angle))


def bounds(mtf50: float, steepness: float, sigma_px: float, degrees: float, side: int = SIDE) -> tuple[float, float]:
    """Range of the relative error of MTF50 that the method allows itself.

    The samples of a bin don't lie quite evenly in it: at most the bin's own response is wrong, 1 - sinc(f / 4), which
    moves MTF50 by that over the steepness d ln MTF / d ln f. The window takes 0.46 pi^2 sigma^2 / (2 reach^2) off the
    blur; its next order is under a fifth of that.
    """
    uneven = (1 - np.sinc(mtf50 / 4)) / steepness
    reach = side / 2 - side / 2 * np.tan(np.radians(abs(degrees)))
    window = 0.46 * np.pi**2 * sigma_px**2 / (2 * reach**2)
    return -uneven, uneven + 1.2 * window


def test_an_edge_with_a_gaussian_blur_has_its_closed_form() -> None:
    for sigma_px, degrees in product([0.5, 1.0, 2.0], [3.0, 4.5, 5.0, 6.0, 7.3, 10.0, -5.0]):
        found = edge_response(tilted_edge(degrees, gaussian(sigma_px)))
        truth = np.sqrt(np.log(2) / 2) / (np.pi * sigma_px)
        low, high = bounds(truth, 2 * np.log(2), sigma_px, degrees)
        assert low <= found.mtf50_cycles_per_px / truth - 1 <= high, (degrees, sigma_px)
        assert found.angle_deg == pytest.approx(degrees, abs=1e-3), (degrees, sigma_px)


def test_an_edge_on_square_pixels_has_their_response() -> None:
    for degrees in [3.0, 4.5, 5.0, 6.0, 7.3, 10.0, -5.0]:
        found = edge_response(tilted_edge(degrees, pixel_box(degrees)))
        truth = brentq(lambda f, at=degrees: box_mtf(at, f) - 0.5, 0.1, 0.9)
        low, high = bounds(truth, 1.638, np.sqrt(1 / 12), degrees)  # 1 - x cot x at x = 0.6034 pi, a box of a pixel
        assert low <= found.mtf50_cycles_per_px / truth - 1 <= high, degrees
        below = found.frequency_cycles_per_px <= 0.5
        frequency = found.frequency_cycles_per_px[below]
        error = found.mtf[below] / box_mtf(degrees, frequency) - 1
        # 0.002: the window's, 1 - MTF near 0
        assert (np.abs(error) <= 1 - np.sinc(frequency / 4) + 0.002).all(), degrees
        assert found.mtf[0] == 1.0, degrees


def test_scale_offset_sides_and_orientation_do_not_count() -> None:
    picture = tilted_edge(5.0, gaussian(0.8))
    found = edge_response(picture)
    for same in (30 * picture + 7, 1 - picture, picture[::-1, ::-1], picture.T, -picture.T):
        other = edge_response(same)
        assert other.mtf50_cycles_per_px == pytest.approx(found.mtf50_cycles_per_px, rel=5e-3)  # other rows may go
        assert other.angle_deg == pytest.approx(5.0, abs=1e-3)
    assert edge_response(picture[:, ::-1]).angle_deg == pytest.approx(-5.0, abs=1e-3)


def test_what_is_no_slanted_edge_is_refused() -> None:
    for picture, told in [
        (np.ones((40, 40)), "no edge crosses all its rows"),
        (np.random.default_rng(0).normal(0, 1, (40, 40)), "no edge crosses all its rows"),
        (tilted_edge(0.0, gaussian(1.0)), r"the edge moves 0\.00 pixels"),
        (tilted_edge(0.5, gaussian(1.0)), r"the edge moves 0\.70 pixels"),
        (tilted_edge(5.0, gaussian(1.0))[:, 30:], "pixels from a side"),
        (np.ones((40, 8)), r"shape \(40, 8\)"),
        (np.full((40, 40), np.nan), r"shape \(40, 40\)"),
        (np.ones((40, 40, 3)), r"shape \(40, 40, 3\)"),
    ]:
        refusal(edge_response, picture, match=f"^luminance: .*{told}")


def test_an_edges_frequencies_are_those_of_quarter_pixels() -> None:
    """Bins of a quarter of a pixel as far as the edge keeps from the sides, eight times as long, up to 1 cycle."""
    found = edge_response(edge(0.0)[..., 0])
    centre = 31.5 + np.tan(found.angle_deg * np.pi / 180) * (np.array([0.0, 57.0]) - 31.5)
    step = found.frequency_cycles_per_px[1]
    bins = 4 / (8 * step) + 2
    assert bins == pytest.approx(round(bins), abs=1e-9)
    assert bins == pytest.approx(8 * min(centre.min(), 63 - centre.max()) * np.cos(np.radians(5)), abs=4)
    assert found.frequency_cycles_per_px == pytest.approx(step * np.arange(len(found.mtf)))
    assert 1 - step < found.frequency_cycles_per_px[-1] <= 1.0
    assert found.angle_deg == pytest.approx(5.0, abs=0.05)
    turned = edge_response(edge(0.0)[..., 0].T)
    assert turned.mtf == pytest.approx(found.mtf)
