"""Up to where a sample counts: the closed form, and whose samples are near."""

from itertools import product

import numpy as np
import pytest
from builders import BAYER_PHASES, RGBW_4X4, RGBW_PHASES, raw_image

from isp.settings import DEFAULTS, PAPER, Settings
from isp.similarity.brightest import SIGMAS, brightest_allowed
from sensor.cfa import RGBW


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
