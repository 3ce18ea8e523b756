"""Alpha of eq. (6), and how bright a sample may be to count."""

from itertools import product

import numpy as np
import pytest
from builders import BAYER_PHASES, RGBW_4X4, RGBW_PHASES, raw_image

from isp.interleaved.brightest import SIGMAS, brightest_allowed
from isp.interleaved.saturation import WINDOW, saturated_fraction
from isp.planes import fill
from isp.settings import DEFAULTS, PAPER, Settings
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
