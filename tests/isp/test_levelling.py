"""A channel's sites that have other neighbours: a flat field becomes flat, and full samples stay full."""

from dataclasses import replace

import numpy as np
import pytest
from builders import raw_image

from isp.levelling import levelled, site_gains
from sensor.cfa import MOSAICS, mask

RCCC = MOSAICS["rccc"]
NEUTRAL_BEHIND = np.array([100.0, 1000.0])  # electrons behind R and C


def flat(crosstalk: float, scale: float = 1.0):
    """Raw image of an even neutral field, worked out by hand: R has four C around it, two C have two R, one none."""
    kept = 1 - 4 * crosstalk
    red, clear = scale * NEUTRAL_BEHIND
    beside_red = kept * clear + crosstalk * (2 * red + 2 * clear)
    tile = [[kept * red + 4 * crosstalk * clear, beside_red], [beside_red, clear]]
    neutral = np.array([tile[0][0], np.mean([beside_red, beside_red, clear])])
    dn = np.rint(np.tile(tile, (8, 8)))
    raw = raw_image(dn, RCCC, black_dn=0.0, white_dn=1e6, gain_e_per_dn=1.0, read_noise_e=2.0, dsnu_e=0.0)
    return replace(raw, crosstalk=crosstalk, dn=np.tile(tile, (8, 8))), neutral / scale


def test_a_flat_field_becomes_flat_at_the_channels_mean() -> None:
    raw, neutral = flat(0.05)
    clear = mask(RCCC, "C", raw.shape)
    assert np.ptp(raw.dn[clear]) / raw.dn[clear].mean() > 0.08
    level = levelled(raw, neutral)
    assert level.dn[clear] == pytest.approx(neutral[1], rel=1e-9)
    assert level.dn[~clear] == pytest.approx(neutral[0], rel=1e-9)
    # rounded samples keep their quantisation in the dark noise, though they are floats from here on
    whole = replace(raw, dn=np.rint(raw.dn).astype(np.uint16))
    assert levelled(whole, neutral).dark_noise_e == pytest.approx(whole.dark_noise_e, rel=1e-12)


def test_full_samples_stay_full_and_no_other_becomes_full() -> None:
    """C beside R is raised by 4 % and the other lowered by 6 %: both would cross a level of saturation between them."""
    raw, neutral = flat(0.05, scale=50.0)
    for white_dn in (46_000.0, 49_000.0, 50_000.0, 52_000.0):
        near = replace(raw, white_dn=white_dn, dn=np.minimum(raw.dn, white_dn))
        level = levelled(near, neutral)
        assert np.array_equal(level.saturated, near.saturated), white_dn


def test_sites_with_the_same_neighbours_are_left_alone() -> None:
    for name in ("rgbw", "bayer", "quad_bayer", "rccb"):
        raw = raw_image(np.full((16, 16), 900), MOSAICS[name])
        raw = replace(raw, crosstalk=0.05)
        neutral = np.arange(1.0, 1 + len(raw.channels))
        assert site_gains(raw, neutral) == pytest.approx(1.0, abs=1e-9), name
        assert levelled(raw, neutral) is raw, name
    plain = raw_image(np.full((16, 16), 900), RCCC)
    assert levelled(plain, NEUTRAL_BEHIND) is plain
