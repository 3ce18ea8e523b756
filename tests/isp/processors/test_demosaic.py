"""Malvar and Menon: the library's own result inside, no border effect, and what carries detail between colours."""

from importlib.util import find_spec
from itertools import product

import numpy as np
import pytest
from builders import BAYER_PHASES, raw_image

from isp.colour.highlights import highlight_level
from isp.colour.white_balance import WhiteBalance
from isp.processors.demosaic import malvar, menon
from isp.processors.mosaic import balance_mosaic
from rodcone.optional import optional_library
from sensor.calibration import ChannelNoise
from sensor.cfa import BAYER

pytestmark = pytest.mark.skipif(find_spec("colour_demosaicing") is None, reason="rodcone[opponents] is not installed")

NAMES = {malvar: "demosaicing_CFA_Bayer_Malvar2004", menon: "demosaicing_CFA_Bayer_Menon2007"}


def test_the_interior_is_the_librarys() -> None:
    for demosaic, cfa in product(NAMES, BAYER_PHASES):
        mosaic = np.random.default_rng(3).uniform(0, 1000, (41, 44))
        theirs = getattr(optional_library("colour_demosaicing", ""), NAMES[demosaic])(mosaic, "".join(cfa))
        ours = demosaic(mosaic, cfa)
        np.testing.assert_allclose(ours[12:-12, 12:-12], theirs[12:-12, 12:-12], rtol=0, atol=1e-9)
        assert np.abs(ours - theirs).max() > 1.0, (cfa, demosaic)  # the border is not


def test_malvars_filters_on_an_impulse() -> None:
    for cfa in BAYER_PHASES:
        # Malvar, He & Cutler 2004, Figure 2: green at the impulse's own red site is 4/8 of it, at the next red or blue
        # site of its row -1/8; green at the green sites beside it is their own sample.
        rows, columns = np.array([list(row) for row in cfa]), np.indices((16, 16))
        names = np.tile(rows, (8, 8))
        y, x = next(
            (y, x) for y, x in zip(*map(np.ravel, columns), strict=True) if names[y, x] == "R" and y > 5 and x > 5
        )
        mosaic = np.zeros((16, 16))
        mosaic[y, x] = 8.0
        green, blue = (malvar(mosaic, cfa)[..., index] for index in (1, 2))
        assert green[y, x - 2 : x + 3] == pytest.approx([-1.0, 0.0, 4.0, 0.0, -1.0]), cfa
        # blue at red sites, down and up
        assert blue[y - 2 : y + 3, x] == pytest.approx([-1.5, 0.0, 6.0, 0.0, -1.5]), cfa


def test_a_mosaic_is_balanced_to_greens_unit_and_held_beside_a_full_colour() -> None:
    dn = np.tile(np.array([[600, 1100], [1100, 500]], np.uint16), (4, 4))
    dn[4, 5] = 15_100  # a green; beside it a red that reads 1.5 full wells when balanced
    dn[4, 4] = 100 + 11_250
    raw = raw_image(dn, BAYER)
    mosaic, _, sources = balance_mosaic(raw, raw.electrons, WhiteBalance(given=np.array([0.5, 1.0, 0.4])))
    assert sources == dict.fromkeys("RGB", "given")
    expected = np.full((8, 8), 1000.0)
    expected[4, 4:6] = 15_000.0
    assert mosaic == pytest.approx(expected)
    far = raw.dn.copy()
    far[4, 4], far[0, 0] = 600, 11_350  # as bright a red, with no full sample beside it, is a red lamp and stays one
    lamp = raw_image(far, BAYER)
    mosaic, _, _ = balance_mosaic(lamp, lamp.electrons, WhiteBalance(given=np.array([0.5, 1.0, 0.4])))
    assert mosaic[0, 0] == pytest.approx(22_500.0)


def test_colours_are_held_where_the_first_channel_is_full_though_green_is_read_apart() -> None:
    """Green behind a density is full at 45 000 e-, red at 15 000, balanced 30 000."""
    noise = ChannelNoise("G", full_well_e=45_000.0, shot=3.0, read_noise_e=1.0, dsnu_e=0.0, prnu=0.0)
    raw = raw_image(np.full((8, 8), 40_100), BAYER, channel_noise=(noise,))
    mosaic, gains, _ = balance_mosaic(raw, raw.electrons, WhiteBalance(given=np.array([0.5, 1.0, 0.4])))
    assert highlight_level(raw, gains) == pytest.approx(30_000.0)
    assert mosaic == pytest.approx(np.full((8, 8), 30_000.0))
