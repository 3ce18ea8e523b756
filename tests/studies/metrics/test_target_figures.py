"""Figures of targets: each on its own scene, None on others and where the picture doesn't let them be measured."""

import numpy as np
import pytest

from rodcone.colour_spaces import luminance_of_srgb
from scenes.catalog import load
from studies.metrics.mtf import edge_response
from studies.metrics.target_figures import TargetFigures, patch_masks, target_figures

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
