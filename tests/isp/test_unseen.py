"""Light on the colours' sites alone: which samples count as unseen by W, and where they are drawn."""

from itertools import product

import numpy as np
import pytest
from builders import RGBW_4X4, RGBW_PHASES, raw_image

from isp.processors.catalogue import NAMED
from isp.unseen import draw_unseen, without_unseen
from sensor.cfa import RGBW, mask, quad

NEUTRAL = np.array([0.1, 0.2, 0.1, 1.0])
TILES = [*RGBW_PHASES, RGBW_4X4, quad(RGBW)]
DARK_E = np.sqrt(2.0 + 1.0 / 12.0)  # of `raw_image`


def exposure(electrons, tile=RGBW, **changes):
    return raw_image(np.rint(np.asarray(electrons) + 100), tile, **changes)


def test_a_colour_is_unseen_from_the_closed_form_on():
    """At S = a W + 4 sqrt(S + s^2) and W = 200 e-, a = 1: 268.74 e-; S = 4 sqrt(S + s^2) where W is dark: 17.9 e-."""
    for tile in TILES:
        for white_e, name in product((0.0, 200.0), "RGB"):
            size = 4 * len(tile), 4 * len(tile[0])
            sites = np.argwhere(mask(tile, name, size))
            row, column = sites[len(sites) // 2]
            root = 2.0 * white_e + 16.0
            bound_e = (root + np.sqrt(root**2 - 4.0 * (white_e**2 - 16.0 * DARK_E**2))) / 2.0
            for light_e, found in ((np.floor(bound_e), False), (np.ceil(bound_e), True)):
                electrons = np.where(mask(tile, "W", size), white_e, 0.0)
                electrons[row, column] = light_e
                _, unseen = without_unseen(exposure(electrons, tile), NEUTRAL)
                assert unseen[row, column] == found, (name, white_e)
                assert unseen.sum() == found, tile


def test_at_the_border_what_is_even_is_seen():
    for tile, shape in product(TILES, ((16, 16), (17, 19), (18, 18), (4, 4))):
        electrons = np.where(mask(tile, "W", shape), 1000.0, np.where(mask(tile, "B", shape), 0.0, 300.0))
        assert not without_unseen(exposure(electrons, tile), NEUTRAL)[1].any()


def test_what_w_explains_stands_in_place_and_the_rest_stays():
    electrons = np.where(mask(RGBW, "W", (12, 14)), 50.0, 3.0)
    electrons[4, 6] = 9000.0
    raw = exposure(electrons)
    kept, unseen = without_unseen(raw, NEUTRAL)
    assert np.argwhere(unseen).tolist() == [[4, 6]]
    electrons[4, 6] = 5.0  # 0.1 of W's 50
    assert np.array_equal(kept.electrons, electrons)
    assert raw.electrons[4, 6] == 9000.0


def test_what_reads_under_black_explains_nothing():
    raw = exposure(np.where(mask(RGBW, "R", (12, 14)), 0.0, -5.0), black_dn=100)  # integers, as a camera writes them
    raw.dn[4, 6] = 9000
    assert np.argwhere(without_unseen(raw, NEUTRAL)[1]).tolist() == [[4, 6]]


def test_a_lamp_that_w_sees_and_one_beside_full_w_are_seen():
    electrons = np.zeros((12, 14))
    electrons[4:6, 6:8] = 15_000.0  # full, W as well
    raw = exposure(electrons)
    kept, unseen = without_unseen(raw, NEUTRAL)
    assert not unseen.any()
    assert kept is raw


def test_what_is_even_is_seen_whatever_w_tells_and_a_line_isnt():
    """A field in the colours alone, as where charge leaves its pixel, up to the border; a line has two of the eight."""
    for tile in TILES:
        shape = 4 * len(tile), 4 * len(tile[0])
        field = np.where(mask(tile, "W", shape), 0.0, 1000.0)
        assert not without_unseen(exposure(field, tile), NEUTRAL)[1].any(), tile
        for row in range(shape[0]):
            line = np.where(np.arange(shape[0])[:, None] == row, field, 0.0)
            assert np.array_equal(without_unseen(exposure(line, tile), NEUTRAL)[1], line > 0), tile


def test_a_w_of_less_light_explains_as_much_as_a_neutral_asks():
    """Neutral density on W: at n = 2 n_W five times as much is a lamp's, at four times none is."""
    electrons = np.where(mask(RGBW, "W", (12, 14)), 1000.0, 0.0)
    for light_e, found in ((8000.0, 0), (12_000.0, 1)):
        electrons[4, 6] = light_e
        _, unseen = without_unseen(exposure(electrons), np.array([2.0, 4.0, 2.0, 1.0]))
        assert unseen.sum() == found


def test_in_flat_fields_nothing_is_unseen_that_counts():
    """Colours as bright as W, the least favourable: beyond 4 standard deviations lie 3.2e-5 of 196 608 normal samples.

    These are 6, and 50 with a chance under 1e-20.
    """
    for level_e, dark_e in [(0.01, 0.3), (0.3, 1.5), (10.0, 1.5), (1000.0, 31.0)]:
        rng = np.random.default_rng(5)
        electrons = rng.poisson(level_e, (512, 512)) + rng.normal(0.0, dark_e, (512, 512))
        raw = exposure(electrons + 300, black_dn=400.0, read_noise_e=dark_e, dsnu_e=0.0)
        _, unseen = without_unseen(raw, np.ones(4) / 10)
        assert unseen.sum() < 50, (level_e, dark_e)


def test_a_lamp_of_one_pixel_is_drawn_there_alone_and_neutral():
    """The smallest case, one sample of a colour in the dark, was a coloured block of 7 x 7 pixels."""
    for at in [(0, 0), (0, 1), (1, 0)]:
        electrons = np.random.default_rng(3).normal(0.0, 1.5, (32, 32))
        place = 16 + at[0], 16 + at[1]
        electrons[place] = 15_000.0
        rgb = NAMED["interleaved"].develop(exposure(electrons), np.eye(3), balance=np.ones(4)).rgb
        assert rgb[place] == pytest.approx(15_000.0, rel=1e-3), at
        rgb[place] = 0.0
        assert np.abs(rgb).max() < 3.0, at


def test_a_line_goes_on_through_a_colour_that_it_has_little_of():
    """Sodium light on a column of R and B: B is within what W allows, and was dark between white dots."""
    electrons = np.zeros((40, 20))
    electrons[10:31:2, 10] = 4000.0
    rgb = NAMED["interleaved"].develop(exposure(electrons), np.eye(3), balance=np.ones(4)).rgb
    assert rgb[10:31, 10] == pytest.approx(np.full((21, 3), 4000.0), rel=1e-6)
    assert np.abs(rgb[10:31, [9, 11]]).max() < 3.0


def test_light_is_drawn_up_to_the_full_well():
    raw = exposure(np.full((4, 4), 14_000.0))
    unseen = np.zeros((4, 4), bool)
    unseen[0, 0] = True
    balanced = np.zeros((4, 4, 4))
    draw_unseen(raw, unseen, np.full(4, 3.0), balanced)
    assert np.array_equal(balanced[0, 0], np.full(4, 15_000.0))
    assert not balanced.reshape(-1, 4)[1:].any()
    assert raw.channels == tuple("RGBW")
