"""Gray World in closed form: means made alike, and the calibrated neutral where a mean is uncertain."""

import numpy as np
import pytest

from isp.colour.gray_world import gray_world

ERRORS = np.array([0.1, 0.1, 0.1])
NEUTRAL = np.array([1.0, 2.0, 0.8])


def planes(means: tuple[float, ...]) -> np.ndarray:
    return np.broadcast_to(means, (8, 8, len(means))).copy()


def test_gray_world_equalises_means() -> None:
    gains, certain = gray_world(planes((3.0, 6.0, 2.0)), np.ones((8, 8), bool), ERRORS, NEUTRAL, green=1)
    assert gains == pytest.approx([2.0, 1.0, 3.0])
    assert certain.tolist() == [True] * 3


def test_gray_world_leaves_unusable_pixels_out() -> None:
    values, usable = planes((3.0, 6.0, 2.0)), np.ones((8, 8), bool)
    values[:4], usable[:4] = 1000.0, False
    assert gray_world(values, usable, ERRORS, NEUTRAL, green=1)[0] == pytest.approx([2.0, 1.0, 3.0])


def test_uncertain_channel_falls_back_to_calibrated_gain_and_says_so() -> None:
    errors = np.array([1.0, 0.1, 0.1])  # red's mean of 3 is 3 standard errors
    gains, certain = gray_world(planes((3.0, 6.0, 2.0)), np.ones((8, 8), bool), errors, NEUTRAL, green=1)
    assert certain.tolist() == [False, True, True]
    assert gains == pytest.approx([2.0 / 1.0, 1.0, 3.0])


def test_uncertain_green_or_no_pixel_makes_all_gains_calibrated() -> None:
    errors = np.array([0.1, 5.0, 0.1])
    for usable in (np.ones((8, 8), bool), np.zeros((8, 8), bool)):
        gains, certain = gray_world(planes((3.0, 6.0, 2.0)), usable, errors, NEUTRAL, green=1)
        assert not certain.any()
        assert gains == pytest.approx([2.0, 1.0, 2.5])
