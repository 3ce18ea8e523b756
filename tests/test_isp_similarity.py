"""Alpha of eq. (6) and the distance that noise alone makes."""

import numpy as np
import pytest

from isp.planes import fill
from isp.similarity import noise_distance, saturated_fraction
from sensor.cfa import BAYER, RGBW, channels
from sensor.raw import RawImage

RGBW_4X4 = ("RWGW", "WBWG", "GWBW", "WGWR")


def raw_image(electrons, tile=RGBW):
    return RawImage(np.round(electrons + 20).astype(np.uint16), tile, 20.0, 1020.0, 1.0, 2.0, 0.0, 0.0, 0.01)


@pytest.mark.parametrize("shape", [(2, 2), (5, 9), (16, 16)])
@pytest.mark.parametrize("tile", [RGBW, RGBW_4X4])
def test_alpha_is_1_in_a_saturated_frame_and_0_in_a_dark_one(shape, tile):
    shape = tuple(max(size, len(tile)) for size in shape)
    noise = np.random.default_rng(0).uniform(-4.0, 4.0, shape)  # the well clips before the noise comes
    assert np.array_equal(saturated_fraction(raw_image(1000.0 + noise, tile), 5), np.ones(shape))
    assert np.array_equal(saturated_fraction(raw_image(10.0 + noise, tile), 5), np.zeros(shape))


def test_alpha_counts_the_pixels_of_the_patch_that_lie_in_the_frame():
    electrons = np.zeros((8, 8))
    electrons[3, 3] = electrons[3, 5] = 1000.0  # two W sites: the plane is saturated there and between them
    alpha = saturated_fraction(raw_image(electrons), 3)
    assert alpha[3, 4] == pytest.approx(3 / 9)
    assert alpha[3, 2] == pytest.approx(1 / 9)
    assert alpha[5, 4] == 0.0
    electrons = np.zeros((8, 8))
    electrons[1, 1] = 1000.0  # row and column 0 have no sample but this one in reach
    alpha = saturated_fraction(raw_image(electrons), 3)
    assert alpha[0, 0] == 1.0
    assert alpha[0, 1] == pytest.approx(4 / 6)


def test_alpha_is_1_without_w():
    assert np.array_equal(saturated_fraction(raw_image(np.zeros((4, 6)), BAYER), 5), np.ones((4, 6)))


def test_a_single_plane_of_independent_pixels_has_twice_the_patch_area():
    table = noise_distance(("W",), "W", 5, 4)[0, 0]
    assert table[4, 4] == 0.0
    assert np.count_nonzero(table - 50.0) == 1  # D of n pairs of unit variance is 2n, whatever the overlap


@pytest.mark.parametrize("tile", [RGBW, BAYER, RGBW_4X4])
@pytest.mark.parametrize("patch", [1, 5])
def test_noise_distance_is_the_mean_over_random_mosaics(tile, patch):
    """Monte Carlo over 40 white mosaics; each entry may be 6.5 of its standard errors off.

    Student's t with 39 degrees of freedom is that far off with probability 1.0e-7; at most 4 x 16 x 49 entries a case
    give a false alarm under 4e-4, and the seed is fixed.
    """
    size, reach, half = 128, 3, patch // 2
    rng = np.random.default_rng(11)
    for letter in channels(tile):
        means = []
        for _ in range(40):
            plane = fill(rng.normal(size=(size, size)), tile, letter)
            means.append(_mean_distances(plane, (len(tile), len(tile[0])), reach, half))
        error = np.std(means, axis=0, ddof=1) / np.sqrt(len(means))
        table = noise_distance(tile, letter, patch, reach)
        assert (np.abs(np.mean(means, axis=0) - table) <= 6.5 * error + 1e-12).all()


def _mean_distances(plane, tile_shape, reach, half):
    """Mean over the frame of the squared patch distance by phase and offset, far from the border."""
    margin = 16
    inner = slice(margin, plane.shape[0] - margin)  # 96: a multiple of every tile
    result = np.empty((*tile_shape, 2 * reach + 1, 2 * reach + 1))
    for row in range(-reach, reach + 1):
        for column in range(-reach, reach + 1):
            squares = (plane - np.roll(plane, (-row, -column), (0, 1))) ** 2
            for axis in (0, 1):
                squares = sum(np.roll(squares, step, axis) for step in range(-half, half + 1))
            distance = squares[inner, inner]
            blocks = distance.reshape(96 // tile_shape[0], tile_shape[0], 96 // tile_shape[1], tile_shape[1])
            result[:, :, row + reach, column + reach] = blocks.mean((0, 2))
    return result
