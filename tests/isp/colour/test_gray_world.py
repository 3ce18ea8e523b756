"""Gray World in closed form: means made alike, and the calibrated neutral where a mean is uncertain."""

import numpy as np
import pytest

from isp.colour.white_balance import gray_world

MEANS = np.array([3.0, 6.0, 2.0])
ERRORS = np.array([0.1, 0.1, 0.1])
NEUTRAL = np.array([1.0, 2.0, 0.8])


def test_gray_world_equalises_means() -> None:
    gains, certain = gray_world(MEANS, ERRORS, NEUTRAL, green=1)
    assert gains == pytest.approx([2.0, 1.0, 3.0])
    assert certain.tolist() == [True] * 3


def test_uncertain_channel_falls_back_to_calibrated_gain_and_says_so() -> None:
    errors = np.array([1.0, 0.1, 0.1])  # red's mean of 3 is 3 standard errors
    gains, certain = gray_world(MEANS, errors, NEUTRAL, green=1)
    assert certain.tolist() == [False, True, True]
    assert gains == pytest.approx([2.0 / 1.0, 1.0, 3.0])


def test_uncertain_green_or_no_light_makes_all_gains_calibrated() -> None:
    for means, errors in [(MEANS, np.array([0.1, 5.0, 0.1])), (np.zeros(3), np.zeros(3))]:
        gains, certain = gray_world(means, errors, NEUTRAL, green=1)
        assert not certain.any(), (means, errors)
        assert gains == pytest.approx([2.0, 1.0, 2.5]), (means, errors)
