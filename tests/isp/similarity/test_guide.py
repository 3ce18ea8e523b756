"""Alpha of eq. (6) and the distance that noise alone makes."""

import numpy as np
import pytest
from builders import RGBW_4X4, raw_image

from isp.planes import fill
from isp.settings import WINDOW
from isp.similarity.guide import saturated_fraction
from isp.similarity.noise_distance import noise_distances
from sensor.cfa import BAYER, RGBW


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
