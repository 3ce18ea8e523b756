"""What an eye sees first: spots of another hue, holes in lights, dots on even surfaces; each counted where it is."""

import numpy as np
import pytest
from scipy.optimize import brentq
from skimage.color import deltaE_ciede2000, lab2rgb

from rodcone.colour_spaces import encode_srgb
from rodcone.errors import InputError
from studies.metrics.blemishes import Blemishes, count_blemishes

GREY, RED, LIGHT = [0.5, 0.5, 0.5], [0.8, 0.2, 0.2], [1.0, 1.0, 1.0]


@pytest.fixture
def truth():
    """Grey, its right half red, with a light of 4 x 4 pixels."""
    picture = np.full((32, 40, 3), GREY)
    picture[:, 20:] = RED
    picture[6:10, 4:8] = LIGHT
    return picture


def test_the_truth_has_no_blemish(truth):
    assert count_blemishes(truth, truth) == Blemishes(0, 0, 0, count_blemishes(truth, truth).even)


def test_even_are_pixels_two_away_from_every_edge(truth):
    # 1280, less four columns of the edge between grey and red, less the light with two pixels around it.
    assert count_blemishes(truth, truth).even == 32 * 40 - 32 * 4 - 8 * 8


def test_a_spot_has_a_hue_that_nothing_beside_it_has(truth):
    picture = truth.copy()
    picture[20, 5] = picture[20, 12] = [0.2, 0.7, 0.2]
    assert count_blemishes(picture, truth).spots == 2
    picture = truth.copy()
    picture[20, 19], picture[12, 20] = RED, GREY  # an edge that moved by a pixel has the hues beside it
    assert count_blemishes(picture, truth).spots == 0


def test_light_of_the_same_hue_and_a_wrong_cast_are_no_spots(truth):
    assert count_blemishes(np.random.default_rng(0).uniform(0.6, 1.4, (32, 40, 1)) * 0.7 * truth, truth).spots == 0
    cast = truth.copy()
    cast[12:] = [0.3, 0.6, 0.3]  # no corner, whose median is that of its surroundings
    assert count_blemishes(cast, truth).spots == 0


def test_a_hole_is_dark_where_the_truth_is_a_light(truth):
    picture = truth.copy()
    picture[7, 5] = picture[8, 6] = 0.4  # 13 % of the light
    picture[7, 6] = 0.6  # 32 %
    picture[25, 5] = 0.0  # no light
    assert count_blemishes(picture, truth).holes == 2


def test_dots_are_counted_on_even_surfaces_alone(truth):
    picture = truth.copy()
    picture[14:30:4, 3:16:4] = 0.58  # CIEDE2000 of 8
    picture[:, 19] *= 1.2  # beside an edge
    counts = count_blemishes(picture, truth)
    assert counts.dots == 4 * 4
    picture[14:30:4, 3:16:4] = 0.53  # CIEDE2000 of 3
    assert count_blemishes(picture, truth).dots == 0


def beside(lab, distance, axis):
    """The colour that lies a CIEDE2000 from another along an axis of CIELAB."""

    def moved(step):
        return np.array(lab) + step * np.eye(3)[axis]

    return moved(brentq(lambda step: deltaE_ciede2000(moved(step), np.array(lab)) - distance, 0.0, 80.0))


@pytest.mark.parametrize("part", [0.97, 1.03])
def test_each_limit_is_kept_within_three_per_cent(part):
    """CIEDE2000 of 20 to the truth and of 10 to the median, an even surface's 1 and a dot's 5; light 0.5, hole 0.2."""
    grey, over = (50.0, 0.0, 0.0), part > 1
    cast = beside(grey, 22.0, 1)
    flat = np.full((16, 16, 3), lab2rgb(np.array(grey)))

    def counts(lab, surface=grey):
        picture = np.full((16, 16, 3), lab2rgb(np.array(surface)))
        picture[8, 8] = lab2rgb(lab)
        return count_blemishes(picture, flat)

    assert counts(beside(grey, 20.0 * part, 1)).spots == over
    assert counts(beside(cast, 10.0 * part, 1), cast).spots == over
    assert counts(beside(grey, 5.0 * part, 0)).dots == over
    halves = flat.copy()
    halves[:, 8:] = lab2rgb(beside(grey, 1.0 * part, 1))
    assert count_blemishes(halves, halves).even == 16 * 16 - 4 * 16 * over
    lights, dark = (np.full((16, 16, 3), encode_srgb(np.array(value))) for value in (0.5 * part, 0.0))
    assert count_blemishes(dark, lights).holes == 256 * over
    lights, dark = (np.full((16, 16, 3), encode_srgb(np.array(value))) for value in (0.8, 0.8 * 0.2 * part))
    assert count_blemishes(dark, lights).holes == 256 * (not over)


def test_a_picture_with_nan_is_refused(truth):
    with pytest.raises(InputError, match="picture: nan"):
        count_blemishes(np.where(truth == 1.0, np.nan, truth), truth)
