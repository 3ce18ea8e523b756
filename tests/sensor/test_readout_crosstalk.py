"""Crosstalk: charge goes to the four neighbours, and none is lost."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from loop import loop

from sensor.readout import spread_charge


def test_an_impulse_keeps_its_rest_and_gives_its_share_to_each_of_four_neighbours():
    light = np.zeros((5, 6))
    light[2, 3] = 100.0
    expected = np.zeros((5, 6))
    expected[2, 3] = 60.0
    expected[1, 3] = expected[3, 3] = expected[2, 2] = expected[2, 4] = 10.0
    np.testing.assert_allclose(spread_charge(light, 0.1), expected, rtol=1e-15)


def test_at_the_border_the_charge_that_has_no_neighbour_stays():
    light = np.zeros((3, 4))
    light[0, 0] = 100.0
    expected = np.zeros((3, 4))
    expected[0, 0] = 80.0
    expected[0, 1] = expected[1, 0] = 10.0
    np.testing.assert_allclose(spread_charge(light, 0.1), expected, rtol=1e-15)


@settings(deadline=None)
@given(st.integers(1, 9), st.integers(1, 9), st.floats(0.0, 0.25), st.integers(0, 2**32))
def test_the_total_is_kept_and_nothing_becomes_negative(height, width, crosstalk, seed):
    light = np.random.default_rng(seed).exponential(1e3, (height, width))
    spread = spread_charge(light, crosstalk)
    assert spread.shape == light.shape
    assert spread.min() >= 0
    assert spread.sum() == pytest.approx(light.sum(), rel=1e-13)


@loop("crosstalk", [0.0, 0.05, 0.25])
def test_a_flat_field_stays_flat(crosstalk):
    np.testing.assert_allclose(spread_charge(np.full((4, 5), 7.0), crosstalk), 7.0, rtol=1e-15)


def test_zero_returns_the_frame_as_it_is_and_the_frame_is_not_written_to():
    light = np.random.default_rng(1).uniform(0, 9, (4, 4))
    before = light.copy()
    np.testing.assert_array_equal(spread_charge(light, 0.0), light)
    spread_charge(light, 0.2)
    np.testing.assert_array_equal(light, before)
