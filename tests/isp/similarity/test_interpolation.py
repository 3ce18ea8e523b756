"""How far distances are trusted between samples that differ: closed forms, any tile, edges without fringes."""

from itertools import product

import numpy as np
import pytest
from builders import raw_image

from isp.interleaved import reconstruct
from isp.planes import fill, tent_weights
from isp.similarity.interpolation import certainty, interpolation_variance, opposite_pairs
from sensor.cfa import MOSAICS, RGBW, channels

TILES = list(MOSAICS.values())


def test_weights_of_a_pixels_pairs_add_up_to_the_share_of_interpolated_letters():
    for tile in TILES:
        total = sum(opposite_pairs(tile).values())
        letters = sorted(set("".join(tile)))
        has_pairs = np.zeros((len(letters), len(tile), len(tile[0])))
        for i, weights in enumerate(tent_weights(tile)):
            radius = weights.shape[2] // 2
            both = (weights > 0.0) & (weights[:, :, ::-1, ::-1] > 0.0)
            both[:, :, radius, radius] = False
            has_pairs[i] = both.any((2, 3))
        assert np.broadcast_to(total, has_pairs[0].shape) == pytest.approx(has_pairs.mean(axis=0))


def test_a_step_in_closed_form():
    """One column on either side: of the four kinds of pairs all but those along a column differ by the step."""
    for column, step in product([8, 9], [3.0, 40.0]):
        mosaic = np.where(np.arange(18) < column, 20.0, 20.0 + step) * np.ones((16, 18))
        share = 1 / 4 + 1 / 8 + 1 / 8  # along the row, and both diagonals
        expected = np.zeros(18)
        expected[[column - 1, column]] = max(share * step**2 / 4 - 3 / 8, 0.0)
        variance = interpolation_variance(mosaic, RGBW, 1)
        assert variance[1:-1] == pytest.approx(np.tile(expected, (14, 1)), abs=1e-12), (step, column)
        assert certainty(mosaic, RGBW, 1)[5, column] == pytest.approx(1 / (1 + expected[column] / 9)), (step, column)
        # A patch adds up what its pixels have: rows alike, columns under it.
        five = interpolation_variance(mosaic, RGBW, 5)
        before_noise_is_cut = np.full(18, -3 / 8)
        before_noise_is_cut[[column - 1, column]] += share * step**2 / 4
        sums = np.convolve(before_noise_is_cut, np.ones(5), "same") * 5
        assert five[5:-5, 4:-4] == pytest.approx(np.tile(np.maximum(sums, 0.0), (6, 1))[:, 4:-4], abs=1e-9), (
            step,
            column,
        )


def test_pairs_tell_what_all_samples_of_the_planes_would():
    """Variance of all samples that fill each pixel, mean over the letters, on smooth light: an independent way."""
    for tile in (tile for name, tile in MOSAICS.items() if name != "quad_rgbw"):
        y, x = np.indices((60, 64))
        mosaic = 100.0 + 40.0 * np.sin(x / 5.0) * np.cos(y / 4.0)
        letters = channels(tile)
        full = sum(fill(mosaic**2, tile, i) - fill(mosaic, tile, i) ** 2 for i in letters) / len(letters)
        ours = interpolation_variance(mosaic, tile, 1)
        inside = slice(6, -6)
        assert ours[inside, inside].mean() == pytest.approx(full[inside, inside].mean(), rel=0.35)


def test_a_neutral_edge_between_samples_gets_no_coloured_fringe():
    """All letters see the same step. Trusting the distances, each colour chooses a side: half the step between them."""
    for start in [(0, 0), (0, 1), (1, 0), (1, 1)]:
        tile = tuple(row[start[1] :] + row[: start[1]] for row in RGBW[start[0] :] + RGBW[: start[0]])
        electrons = np.where(np.arange(32) < 15, 400.0, 4000.0) * np.ones((24, 32))
        raw = raw_image(electrons, tile, black_dn=0.0, white_dn=60000.0, read_noise_e=2.0, dsnu_e=0.0)
        spread = np.ptp(reconstruct(raw), axis=2)[8:-8]
        assert spread.max() < 0.2 * 3600.0, start
