"""Alpha of eq. (6) and the distance that noise alone makes."""

from itertools import product

import numpy as np
import pytest
from builders import BAYER_PHASES, RGBW_4X4, RGBW_PHASES, raw_image

from isp.interleaved import reconstruct
from isp.planes import fill, tent_weights
from isp.settings import DEFAULTS, PAPER, WINDOW, Settings
from isp.similarity.brightest import SIGMAS, brightest_allowed
from isp.similarity.guide import saturated_fraction
from isp.similarity.interpolation import certainty, interpolation_variance, opposite_pairs
from isp.similarity.noise_distance import noise_distances
from sensor.cfa import BAYER, MOSAICS, RGBW, channels


def exposure(electrons, tile=RGBW):
    return raw_image(np.round(electrons + 20), tile, black_dn=20.0, white_dn=1020.0, read_noise_e=2.0, dsnu_e=0.0)


def test_alpha_is_1_in_a_saturated_frame_and_0_in_a_dark_one():
    for tile, shape in ((RGBW, (2, 2)), (RGBW, (5, 9)), (RGBW_4X4, (4, 4)), (RGBW_4X4, (16, 17))):
        noise = np.random.default_rng(0).uniform(-4.0, 4.0, shape)  # the well clips before the noise comes
        assert np.array_equal(saturated_fraction(exposure(1000.0 + noise, tile)), np.ones(shape)), (tile, shape)
        assert np.array_equal(saturated_fraction(exposure(10.0 + noise, tile)), np.zeros(shape)), (tile, shape)


def test_alpha_counts_every_pixel_that_a_full_sample_fills_inside_the_frame() -> None:
    electrons = np.zeros((24, 24))
    electrons[11, 11] = 1000.0  # a W site: it and the eight around it are filled from it
    alpha = saturated_fraction(exposure(electrons))
    assert WINDOW == 9
    assert alpha[11, 11] == pytest.approx(9 / 81, rel=1e-12)
    assert alpha[11, 16] == pytest.approx(3 / 81, rel=1e-12)
    assert alpha[16, 16] == pytest.approx(1 / 81, rel=1e-12)
    assert alpha[11, 17] == 0.0
    electrons = np.zeros((24, 24))
    electrons[1, 1] = 1000.0
    assert saturated_fraction(exposure(electrons))[0, 0] == pytest.approx(9 / 25, rel=1e-12)


def test_a_filled_pixel_beside_a_full_sample_counts_though_its_value_is_under_saturation() -> None:
    electrons = np.zeros((24, 24))
    electrons[11, 11] = 1000.0
    raw = exposure(electrons)
    assert fill(raw.electrons, RGBW, "W")[11, 12] < raw.saturation_e
    assert saturated_fraction(raw)[11, 12] == pytest.approx(9 / 81, rel=1e-12)


def test_alpha_is_1_without_w():
    assert np.array_equal(saturated_fraction(exposure(np.zeros((4, 6)), BAYER)), np.ones((4, 6)))


def test_a_single_plane_of_independent_pixels_has_twice_the_patch_area():
    table = noise_distances(("W",), 5, 4)[0][0, 0]
    assert table[4, 4] == 0.0
    assert np.count_nonzero(table - 50.0) == 1  # D of n pairs of unit variance is 2n, whatever the overlap


# Up to where a sample counts: the closed form, and whose samples are near.


def raw(electrons, tile=RGBW, dark_e=0.0, prnu=0.0):
    return raw_image(np.round(electrons) + 100.0, tile, read_noise_e=dark_e, dsnu_e=0.0, prnu=prnu)


def test_a_flat_field_has_the_closed_form_everywhere():
    for (sigma_s, z), (dark_e, prnu) in product(
        [(0.1, 2.5), (3.0, 2.5), (6.0, 5.0)], [(0.0, 0.0), (3.0, 0.0), (3.0, 0.02)]
    ):
        flat = raw(np.full((7, 9), 400.0), dark_e=dark_e, prnu=prnu)
        dark_variance = flat.dark_noise_e**2
        spread = np.sqrt(400.0 + dark_variance + (400.0 * prnu) ** 2)
        got = brightest_allowed(flat.electrons, flat, Settings(sigma_s=sigma_s))
        assert got.shape == (2, 2, 7, 9), (dark_e, prnu, sigma_s, z)
        assert got == pytest.approx(400.0 + z * spread + 2.25 / (1 + dark_variance) ** 2, rel=1e-12), (
            dark_e,
            prnu,
            sigma_s,
            z,
        )


def test_without_similarity_and_by_the_papers_own_method_nothing_is_left_out():
    for settings in [Settings(sigma_s=np.inf), Settings(sigma_s=1e38), PAPER]:
        assert (brightest_allowed(np.zeros((4, 4)), raw(np.zeros((4, 4))), settings) == np.inf).all(), settings


def test_the_brightest_is_that_of_the_same_cell_as_far_on_one_side_as_on_the_other():
    for tile in [*RGBW_PHASES, BAYER_PHASES[0], RGBW_4X4, ("RW",)]:
        (down, across), shape = (len(tile), len(tile[0])), (19, 17)
        electrons = np.random.default_rng(0).uniform(0.0, 900.0, shape)
        frame = raw(electrons, tile)
        got, dark_variance = brightest_allowed(electrons, frame, DEFAULTS), frame.dark_noise_e**2
        for a, b, row, column in np.ndindex(got.shape):
            steps = product(range(1 - 2 * down, 2 * down), range(1 - 2 * across, 2 * across))
            near = [(row + i, column + j) for i, j in steps if (i - a) % down == 0 and (j - b) % across == 0]
            m = max(electrons[s] for s in near if 0 <= s[0] < shape[0] and 0 <= s[1] < shape[1])
            assert got[a, b, row, column] == pytest.approx(
                m + SIGMAS * np.sqrt(m + dark_variance) + 2.25 / (1 + dark_variance) ** 2, rel=1e-12
            )


# How far distances are trusted between samples that differ: closed forms, any tile, edges without fringes.


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
