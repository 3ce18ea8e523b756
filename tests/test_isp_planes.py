"""Planes: flat fields, kept samples, tents and the noise they leave."""

from itertools import product

import numpy as np
import pytest

from isp.planes import fill, stabilise, tent_radius, tent_weights
from sensor.cfa import BAYER, RGBW, channels, mask
from sensor.raw import RawImage

RGBW_4X4 = ("RWGW", "WBWG", "GWBW", "WGWR")
SPARSE = ("RGGG", "GGGG", "GGGG", "GGGG")
PHASES = [
    ("RG", "BW"),
    ("GR", "WB"),
    ("BW", "RG"),
    ("WB", "GR"),
    ("RG", "GB"),
    ("GR", "BG"),
    ("GB", "RG"),
    ("BG", "GR"),
]


@pytest.mark.parametrize("tile", [*PHASES, RGBW_4X4, SPARSE, ("RGBW",), ("R", "W")])
@pytest.mark.parametrize("shape", [(4, 4), (5, 7), (12, 9)])
def test_flat_field_stays_flat_to_the_border(tile, shape):
    for letter in channels(tile):
        values = np.where(mask(tile, letter, shape), 700.0, 1e9)  # the other letters must not leak in
        assert np.abs(fill(values, tile, letter) / 700.0 - 1.0).max() < 1e-14


def test_impulse_spreads_as_the_tent_and_samples_are_kept():
    values = np.zeros((6, 6))
    values[3, 3] = 4.0  # W of the tile
    expected = np.zeros((6, 6))
    expected[2:5, 2:5] = [[1, 2, 1], [2, 4, 2], [1, 2, 1]]
    expected[2:5, 5] = 0.0  # each is half-way between two samples, or at one
    assert np.array_equal(fill(values, RGBW, "W"), expected)


@pytest.mark.parametrize(
    ("tile", "letter", "radius"),
    [(RGBW, "W", 1), (BAYER, "G", 1), (RGBW_4X4, "W", 1), (SPARSE, "R", 2), (("R",), "R", 0)],
)
def test_tent_has_the_smallest_radius_that_reaches_a_sample(tile, letter, radius):
    assert tent_radius(tile, letter) == radius


@pytest.mark.parametrize("tile", [RGBW, BAYER, RGBW_4X4, SPARSE])
def test_weights_are_what_fill_does_inside_a_frame(tile):
    for letter in channels(tile):
        weights = tent_weights(tile, letter)
        radius = weights.shape[2] // 2
        values = np.random.default_rng(3).normal(size=(12, 12))
        plane = fill(values, tile, letter)
        for row, column in product(range(4, 8), repeat=2):
            around = values[row - radius : row + radius + 1, column - radius : column + radius + 1]
            w = weights[row % len(tile), column % len(tile[0])]
            assert plane[row, column] == pytest.approx((w * around).sum(), abs=1e-13)


@pytest.mark.parametrize("mean_e", [20.0, 300.0, 8000.0])
def test_stabilised_noise_has_unit_variance(mean_e):
    rng = np.random.default_rng(7)
    electrons = rng.poisson(mean_e, (400, 400)) + rng.normal(0.0, 3.0, (400, 400))
    raw = RawImage(np.round(electrons + 100).astype(np.uint16), RGBW, 100.0, 16000.0, 1.0, 3.0, 0.0, 0.0, 0.01)
    # 160 000 samples: the variance's standard error is 0.35 %; 5 of them and 1 % for the transform's own error.
    assert stabilise(raw.electrons, raw.dark_noise_e).var() == pytest.approx(1.0, abs=0.028)


def test_stabilised_mosaic_is_0_far_under_black():
    raw = RawImage(np.zeros((2, 2), np.uint16), RGBW, 100.0, 16000.0, 1.0, 3.0, 0.0, 0.0, 0.01)
    assert np.array_equal(stabilise(raw.electrons, raw.dark_noise_e), np.zeros((2, 2)))
