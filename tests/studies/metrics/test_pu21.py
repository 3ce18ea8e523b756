"""PU21: the values at its ends and at 100 cd/m^2, its inverse worked out on paper, PSNR in closed form."""

import numpy as np
import pytest
from refusal import refusal

from studies.metrics.quality import pu21_encode, pu21_psnr_db


def decode(value: np.ndarray) -> np.ndarray:
    """The paper's inverse with its constants typed again: luminance [cd/m^2] of an encoded value."""
    root = (value / 596.3148142 + 0.9099517204) ** (1 / 0.09150303166)
    return ((root - 0.353487901) / (0.3734658629 - 8.277049286e-05 * root)) ** (1 / 0.9062562627)


def test_the_ends_and_100_cd_m2_have_the_published_values() -> None:
    # Ends as published beside the constants: 5.4705e-10 and 595.3939. At 100 cd/m^2 the fit comes near 8 bits' 256.
    assert pu21_encode([0.005, 10_000.0]) == pytest.approx([5.4705e-10, 595.3939], rel=1e-6, abs=1e-12)
    assert pu21_encode(100.0) == pytest.approx(256.0, abs=0.5)


def test_a_hundredth_of_the_peak_of_256_is_40_db_at_any_luminance() -> None:
    for level in [20.0, 256.0, 500.0]:
        truth = decode(np.full((8, 8), level))
        picture = decode(np.where(np.indices((8, 8)).sum(axis=0) % 2, level + 2.56, level - 2.56))
        assert pu21_psnr_db(picture, truth) == pytest.approx(40.0, abs=1e-6), level


def test_the_same_error_in_cd_m2_counts_for_less_in_daylight() -> None:
    dusk, day = np.full((4, 4), 1.0), np.full((4, 4), 1000.0)
    assert pu21_psnr_db(day + 0.5, day) > 30 + pu21_psnr_db(dusk + 0.5, dusk)
    assert pu21_psnr_db(day, day) == np.inf
    refusal(pu21_psnr_db, day, day[:2], match=r"^picture_cd_m2: shape \(4, 4\)")
