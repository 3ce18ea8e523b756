"""Highlights: small full lamps are white unless a sample of theirs says a colour."""

from itertools import product

import numpy as np
import pytest
from builders import BAYER_PHASES, RGBW_PHASES, mosaic_of, raw_image

from isp.colour.highlights import Highlights, clip_highlights, white_lamps
from isp.processors.catalogue import PROCESSORS

WELL_E, FIELD_E = 15_000.0, 20.0
WHITE = {"R": 0.5, "G": 1.0, "B": 0.5, "W": 4.8}
SODIUM = {"R": 0.55, "G": 0.8, "B": 0.02, "W": 3.0}
SIZES = [(1, 1), (1, 2), (1, 3), (2, 2), (1, 5), (3, 3), (4, 4)]


def lamp(colour, lamp_e, size, tile):
    """Frame without noise, and where its lamp is."""
    inside = np.zeros((16, 16), bool)
    inside[7 : 7 + size[0], 7 : 7 + size[1]] = True
    electrons = FIELD_E * mosaic_of(WHITE, tile, inside.shape)
    electrons += inside * lamp_e * mosaic_of(colour, tile, inside.shape)
    return raw_image(np.rint(np.minimum(electrons, WELL_E)) + 100, tile), inside


def gains_of(raw):
    return 1.0 / np.array([WHITE[name] for name in raw.channels])


@pytest.mark.parametrize("tile", [*BAYER_PHASES, *RGBW_PHASES])
def test_each_pixel_of_a_full_white_lamp_is_white_near_a_full_colour(tile):
    for size, lamp_e in product([*SIZES, (5, 1), (3, 1)], (1e5, 1e7)):
        raw, inside = lamp(WHITE, lamp_e, size, tile)
        white = white_lamps(raw, gains_of(raw))
        if size == (1, 1) and tile[1][1] == "W":  # full W says no more than a fifth of the level
            assert not white.any()
        else:
            assert np.array_equal(white, inside), (size, lamp_e)


@pytest.mark.parametrize("tile", [*BAYER_PHASES, *RGBW_PHASES])
def test_a_dark_sample_within_a_lamp_says_its_colour(tile):
    """Red, green and W of a sodium lamp are full at 6e4 e-; blue reads a sixth of the level (lit: a quarter)."""
    for size in [(2, 2), (2, 3), (3, 3), (4, 4), (6, 5)]:
        raw, _ = lamp(SODIUM, 6e4, size, tile)
        assert not white_lamps(raw, gains_of(raw)).any(), size


@pytest.mark.thorough
def test_white_lamps_come_out_grey_and_sodium_lamps_orange():
    """A lamp of 1x3 pixels was cyan where its red site was the dark one beside it."""
    tiles = {"ple_rgbw": RGBW_PHASES, "ple_bayer": BAYER_PHASES, "bayer": BAYER_PHASES}
    for (name, phases), size in product(tiles.items(), [(1, 3), (2, 2)]):
        for tile in phases:
            raw, inside = lamp(WHITE, 1e5, size, tile)
            balance = [WHITE[channel] for channel in raw.channels]
            rgb = PROCESSORS[name].develop(raw, np.eye(3), balance=balance).rgb[inside]
            assert np.ptp(rgb, axis=-1) == pytest.approx(0.0, abs=1e-6 * WELL_E), (name, tile, size)
            assert rgb.max() == pytest.approx(WELL_E), (name, tile, size)
            raw, inside = lamp(SODIUM, 1e5, (4, 4), tile)
            red, green, blue = PROCESSORS[name].develop(raw, np.eye(3), balance=balance).rgb[inside].mean(axis=0)
            assert min(red, green) > 0.6 * WELL_E, (name, tile)  # planes take in the dark at the lamp's edges
            assert blue < 0.6 * green, (name, tile)


@pytest.mark.parametrize("height", [1, 7])
def test_highlights_held_in_strips_of_rows_are_those_of_the_frame(height):
    raw, inside = lamp(WHITE, 1e5, (5, 6), RGBW_PHASES[0])
    balanced = np.random.default_rng(1).uniform(0.0, 3 * WELL_E, (*raw.shape, 4))
    held, highlights = clip_highlights(raw, balanced, gains_of(raw)), Highlights.of(raw, gains_of(raw))
    strips = [slice(first, first + height) for first in range(0, 16, height)]
    assert np.array_equal(np.concatenate([highlights.held(balanced[rows], rows) for rows in strips]), held)
    assert not np.array_equal(held[inside], balanced[inside])
