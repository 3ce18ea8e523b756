"""Rims of highlights: one share for all colours, and no colour for lamps smaller than 2 x 2."""

from itertools import product

import numpy as np
import pytest
from builders import raw_image

from isp.colour import rims
from isp.pipeline import picture_interleaved
from sensor.cfa import RGBW, channels, mask

DARK_E, LIGHT_E = np.array([10.0, 30.0, 8.0, 100.0]), np.array([1500.0, 3000.0, 1400.0, 15_000.0])
MIXED = np.full((12, 12), 0.5)


def frame(planes=None):
    return raw_image(np.full((12, 12), 100) if planes is None else planes)


def even_rims(raw, planes, gains, alpha):
    result = planes.copy()
    rims.even_rims(raw, result, gains, alpha)
    return result


def edge(shares):
    """Dark on the left, light on the right, and in column 6 each channel's own share of both."""
    planes = np.broadcast_to(DARK_E, (12, 12, 4)).copy()
    planes[:, 7:] = LIGHT_E
    planes[:, 6] = DARK_E + np.asarray(shares) * (LIGHT_E - DARK_E)
    return planes


def test_all_channels_get_one_share():
    shares = np.array([0.0, 0.9, 0.3, 1.0])
    even = even_rims(frame(), edge(shares), np.ones(4), MIXED)
    contrast = ((LIGHT_E - DARK_E) / (LIGHT_E + DARK_E))[:3] ** 2
    share = contrast @ shares[:3] / contrast.sum()
    assert even[3:9, 6] == pytest.approx(np.broadcast_to(DARK_E + share * (LIGHT_E - DARK_E), (6, 4)), rel=1e-9)
    # beyond the edge nothing changes
    assert even[:, [2, 10]] == pytest.approx(edge(shares)[:, [2, 10]], rel=1e-9)


@pytest.mark.parametrize("alpha", [0.0, 1.0])
def test_without_a_rim_planes_stay_the_same(alpha):
    planes = edge([0.0, 0.9, 0.3, 1.0])
    assert even_rims(frame(), planes, np.ones(4), np.full((12, 12), alpha)).tolist() == planes.tolist()


def test_only_rims_change():
    planes, alpha = edge([0.0, 0.9, 0.3, 1.0]), np.zeros((12, 12))
    alpha[4:6, 5:8] = 0.5
    even = even_rims(frame(), planes, np.ones(4), alpha)
    whole = even_rims(frame(), planes, np.ones(4), MIXED)
    assert np.array_equal(even[alpha > 0], whole[alpha > 0])
    assert np.array_equal(even[alpha == 0], planes[alpha == 0])


def test_contrast_within_the_noise_changes_nothing():
    noise = np.random.default_rng(0).normal(0.0, 1.5 * np.sqrt(1000.0), (12, 12, 4))  # 10 sigmas: once in 10^9
    planes = 1000.0 + noise
    assert np.array_equal(even_rims(frame(), planes, np.ones(4), MIXED), planes)


def test_a_colour_that_is_full_nearby_is_not_lowered():
    planes = edge([0.2, 1.0, 0.2, 1.0])
    planes[..., 1] *= 5.0  # green's light is 15 000 e-
    even = even_rims(frame(), planes, np.ones(4), MIXED)
    assert np.array_equal(even[:, 6, 1], planes[:, 6, 1])
    assert (even[:, 6, [0, 2]] > planes[:, 6, [0, 2]]).all()


def test_colours_that_do_not_rise_together_keep_their_own_edges():
    """Orange beside green: red rises by 1400 e- where green and blue fall by 600, so the light does by 200 of 2600."""
    planes = np.broadcast_to([500.0, 1500.0, 1000.0, 14_000.0], (12, 12, 4)).copy()
    planes[:, 6:] = [1900.0, 900.0, 400.0, 15_000.0]
    assert np.array_equal(even_rims(frame(), planes, np.ones(4), MIXED), planes)


@pytest.mark.parametrize(("width", "grey"), [(1, True), (2, False)])
def test_a_lamp_smaller_than_2_x_2_has_no_colour(width, grey):
    """Its colours, balanced, are their mean; over the dark by c^2, here 1."""
    gains = np.array([2.0, 1.0, 3.0, 0.2])
    planes = np.zeros((12, 12, 4))
    planes[5 : 5 + width, 5 : 5 + width] = [4000.0, 2000.0, 1000.0, 15_000.0]
    even = even_rims(frame(), planes, gains, MIXED)
    balanced = even[5, 5] * gains
    expected = np.full(4, (8000.0 + 2000.0 + 3000.0) / 3) if grey else [8000.0, 2000.0, 3000.0, 3000.0]
    assert balanced == pytest.approx(expected, rel=1e-9)


def test_blocks_of_rows_make_no_difference():
    rng = np.random.default_rng(1)
    planes = rng.uniform(0.0, 5000.0, (300, 9, 4))
    alpha = np.full((300, 9), 0.5)
    raw = raw_image(np.full((300, 9), 100))
    whole = even_rims(raw, planes, np.ones(4), alpha)
    part = even_rims(raw_image(np.full((40, 9), 100)), planes[110:150], np.ones(4), alpha[110:150])
    assert np.array_equal(part[2:-2], whole[112:148])


@pytest.mark.parametrize(("size", "row", "column"), list(product((3, 4, 5), (0, 1), (0, 1))))
def test_a_small_full_patch_shows_no_tile(size, row, column):
    """The smallest case: a neutral patch, full in W, in a field of a hundredth of it.

    Green, red and blue agree within a tenth of the patch at every pixel; before, they differed by up to 0.8 of it.
    """
    levels, shape = dict(zip(channels(RGBW), (0.1, 0.2, 0.1, 1.0), strict=True)), (32, 32)
    light = np.full(shape, 400.0)
    light[14 + row : 14 + row + size, 14 + column : 14 + column + size] = 40_000.0
    electrons = np.zeros(shape)
    for name, level in levels.items():
        electrons[mask(RGBW, name, shape)] = level * light[mask(RGBW, name, shape)]
    raw = raw_image(np.minimum(np.rint(electrons), 15_000) + 100)
    rgb = picture_interleaved(raw, np.eye(3), balance=np.array(list(levels.values()))).rgb
    assert np.ptp(rgb, axis=2).max() < 0.1 * 8000.0
