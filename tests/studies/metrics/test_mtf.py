"""Sharpness from a slanted edge: edges whose response is known in closed form, clean, noisy and rendered."""

from collections.abc import Callable
from itertools import product

import numpy as np
import pytest
from refusal import refusal
from scipy.optimize import brentq
from scipy.special import erf

from studies.metrics.mtf import edge_response

SIDE = 80
Profile = Callable[[np.ndarray], np.ndarray]


def edge(degrees: float, profile: Profile, side: int = SIDE) -> np.ndarray:
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
        found = edge_response(edge(degrees, gaussian(sigma_px)))
        truth = np.sqrt(np.log(2) / 2) / (np.pi * sigma_px)
        low, high = bounds(truth, 2 * np.log(2), sigma_px, degrees)
        assert low <= found.mtf50_cycles_per_px / truth - 1 <= high, (degrees, sigma_px)
        assert found.angle_deg == pytest.approx(degrees, abs=1e-3), (degrees, sigma_px)


def test_an_edge_on_square_pixels_has_their_response() -> None:
    for degrees in [3.0, 4.5, 5.0, 6.0, 7.3, 10.0, -5.0]:
        found = edge_response(edge(degrees, pixel_box(degrees)))
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
    picture = edge(5.0, gaussian(0.8))
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
        (edge(0.0, gaussian(1.0)), r"the edge moves 0\.00 pixels"),
        (edge(0.5, gaussian(1.0)), r"the edge moves 0\.70 pixels"),
        (edge(5.0, gaussian(1.0))[:, 30:], "pixels from a side"),
        (np.ones((40, 8)), r"shape \(40, 8\)"),
        (np.full((40, 40), np.nan), r"shape \(40, 40\)"),
        (np.ones((40, 40, 3)), r"shape \(40, 40, 3\)"),
    ]:
        refusal(edge_response, picture, match=f"^luminance: .*{told}")
