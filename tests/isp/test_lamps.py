"""Lamps in the dark: what every processor makes of small bright places.

Each frame holds four lamps, one on every site of the tile, of 10 standard deviations of the field's noise or more,
clipped at the well. The same frame without them, with the same noise, tells what they add.
"""

from itertools import product

import numpy as np
import pytest
from builders import raw_image
from scipy.ndimage import distance_transform_cdt

from isp.processors.catalogue import PROCESSORS, libraries
from sensor.cfa import BAYER, RGBW

TILES = {"rgbw": RGBW, "rgbw_nd": RGBW, "bayer": BAYER, "cmyw": ("CM", "YW")}
WELL_E, DARK_E, BLACK, APART = 15_000.0, 1.5, 100.0, 56
SEEDS = 12  # of processors that look far; the others are 0 beyond their reach in every frame
FAR = ("interleaved", "bayer_nlm", "bayer_menon")
# Pixels up to which a lamp may show: what the processor interpolates from. `bayer_bm3d`, whose transform spreads a lamp
# over its blocks, and the paper's own method, which has no bound, are told of in docs/decisions/0037.
REACH = {
    "interleaved": 3,
    "bayer": 1,
    "bayer_malvar": 2,
    "bayer_menon": 5,
    "bayer_nlm": 4,
    "rgbw_sato": 1,
    "rgbw_kijima": 4,
    "rgbw_yamagami": 3,
    "cmyw_yamagami": 3,
    "rgbw_gindele": 4,
}


def mosaic(electrons, tile=RGBW, dark_e=DARK_E, prnu=0.0):
    dn = np.minimum(electrons, WELL_E) + BLACK
    return raw_image(dn, tile, black_dn=BLACK, white_dn=BLACK + WELL_E, read_noise_e=dark_e, dsnu_e=0.0, prnu=prnu)


def lamps(field_e, lamp_e, size, seed, tile=RGBW):
    """The same frame without lamps and with one on each site of the tile, and the distance to the next one [pixels]."""
    rng, shape = np.random.default_rng(seed), (2 * APART, 2 * APART)
    read = rng.normal(0.0, DARK_E, shape)
    without = rng.poisson(field_e, shape) + read
    lit, dark = without.copy(), np.ones(shape, bool)
    for i, j in product((0, 1), repeat=2):
        row, column = (APART * (2 * k + 1) // 2 // 2 * 2 + k for k in (i, j))
        at = slice(row, row + size), slice(column, column + size)
        lit[at] = rng.poisson(field_e + lamp_e, (size, size)) + read[at]
        dark[at] = False
    return mosaic(without, tile), mosaic(lit, tile), distance_transform_cdt(dark, "chessboard")


def planes(name, raw):
    """What the matrix takes."""
    options = {"substitution_snr": 0.0} if name == "interleaved" else {}
    ones = np.ones(len(set("".join(raw.cfa))))
    return PROCESSORS[name].develop(raw, np.eye(3), balance=ones, **options).rgb


@pytest.mark.thorough
@pytest.mark.parametrize("field_e", [0.01, 0.3, 10.0])
@pytest.mark.parametrize("name", REACH)
def test_a_lamp_stays_where_it_is(name, field_e):
    if libraries(name):
        pytest.importorskip("colour_demosaicing", reason="rodcone[opponents] isn't installed")
    tile, noise_e = TILES[PROCESSORS[name].mosaic], np.sqrt(field_e + DARK_E**2)
    found, dark, seeds = {}, [], SEEDS if name in FAR else 2
    for seed, size, times in product(range(seeds), range(1, 9), (10.0, 2 * WELL_E)):
        without, lit, distance = lamps(field_e, times * noise_e, size, seed, tile)
        if size == 1 and times == 10.0:
            dark.append(planes(name, without))
        excess = planes(name, lit) - dark[seed]
        found[size, times] = found.get((size, times), 0.0) + excess[distance > REACH[name]] / seeds
    deviation = np.std(dark, axis=(0, 1, 2))
    for case, excess in found.items():
        assert (excess / deviation).max() < 1.0, case
        assert (excess / deviation).min() > -3.0, case
