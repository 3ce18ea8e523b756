"""White balance: the default neutral, a given response, W in a group of its own, and what is refused."""

import numpy as np
import pytest
from builders import raw_image

from isp.colour.white_balance import WhiteBalance, gray_world, neutral_response
from rodcone.errors import InputError


def test_neutral_response_has_the_published_electron_ratios() -> None:
    red, green, blue, white = neutral_response(("R", "G", "B", "W"))
    assert [white / red, white / green, white / blue] == pytest.approx([9.80, 4.88, 10.84], rel=0.03)


def test_pixels_near_a_full_colour_do_not_count_and_none_left_means_calibrated_gains() -> None:
    dn, planes = np.tile([[600, 1100], [500, 5100]], (8, 8)), np.empty((16, 16, 4))
    planes[:] = [500.0, 1000.0, 400.0, 5000.0]
    dn[0, 0] = dn[15, 0] = 15_100  # red sites and blue ones: the tile's reach is one pixel
    planes[:2, :2] = planes[14:, :2] = 1e6
    balance = WhiteBalance(neutral=np.array([1.0, 2.0, 1.0, 8.0]))
    assert balance.gains(raw_image(dn), planes)[0] == pytest.approx([2.0, 1.0, 2.5, 0.2], rel=1e-12)
    factors, sources = balance.gains(raw_image(np.full((16, 16), 15_100)), planes)
    assert factors == pytest.approx([2.0, 1.0, 2.0, 0.25], rel=1e-12)
    assert sources == dict.fromkeys("RGBW", "calibrated")


def test_w_that_is_full_everywhere_takes_the_calibrated_gain_and_leaves_the_colours_alone() -> None:
    dn = np.tile([[600, 1100], [500, 15_100]], (8, 8))
    planes = np.broadcast_to([500.0, 1000.0, 400.0, 15_000.0], (16, 16, 4))
    factors, sources = WhiteBalance(neutral=np.array([1.0, 2.0, 1.0, 8.0])).gains(raw_image(dn), planes)
    assert factors == pytest.approx([2.0, 1.0, 2.5, 0.25], rel=1e-12)
    assert sources == {**dict.fromkeys("RGB", "gray world"), "W": "calibrated"}


def test_a_dark_channel_is_certain_by_the_scatter_of_its_mean_dark_noise_included() -> None:
    """Means of 64 samples drawn with shot noise and 10 e- of the dark: 5 of their deviations are 6.5 e-."""
    for mean_e, source in [(6.2, "calibrated"), (7.2, "gray world")]:
        rng = np.random.default_rng(0)
        samples = rng.poisson(mean_e, (20_000, 64)) + rng.normal(0, 10.0, (20_000, 64))
        deviation_e = samples.mean(axis=1).std()  # known to 0.5 %; the two means are 4.6 % and more off the bound
        assert (mean_e > 5 * deviation_e) == (source == "gray world"), (mean_e, source)
        planes = np.broadcast_to([mean_e, 1000.0, 1000.0, 4000.0], (16, 16, 4))
        image = raw_image(np.full((16, 16), 1100), read_noise_e=8.0, dsnu_e=6.0)
        assert WhiteBalance(neutral=np.ones(4)).gains(image, planes)[1]["R"] == source, (mean_e, source)


def test_a_given_response_decides_alone() -> None:
    image = raw_image(np.full((8, 8), 1100))
    factors, sources = WhiteBalance.of(image, [7, 7, 7, 7], [1, 2, 1, 4]).gains(image, np.ones((8, 8, 4)))
    assert factors.tolist() == [2.0, 1.0, 2.0, 0.5]
    assert sources == dict.fromkeys("RGBW", "given")


def test_a_value_is_taken_as_it_is_and_a_wrong_response_refused() -> None:
    image, value = raw_image(np.full((8, 8), 1100)), WhiteBalance()
    assert WhiteBalance.of(image, None, value) is value
    for name, pair in (("neutral", ([1, 2, 3], None)), ("balance", (None, [1, 2, 3, -1]))):
        with pytest.raises(InputError, match=rf"^{name}: .* is not allowed; give a positive response for each of"):
            WhiteBalance.of(image, *pair)


# Gray World in closed form: means made alike, and the calibrated neutral where a mean is uncertain.


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
