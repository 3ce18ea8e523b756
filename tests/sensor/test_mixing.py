"""What a tile's sites read of each channel's light: by hand, and as the readout spreads charge."""

import numpy as np
import pytest

from sensor.cfa import MOSAICS, channel_map, channel_mixing, channels, mask, site_mixing, unmixed
from sensor.readout import spread_charge


def test_the_papers_tile_mixes_as_worked_out_by_hand() -> None:
    """R G over B W: R has two G beside it and two B above and below, W the same, G and B have two R and two W each."""
    c = 0.02
    own, two = 1 - 4 * c, 2 * c
    by_hand = [[own, two, two, 0], [two, own, 0, two], [two, 0, own, two], [0, two, two, own]]
    assert channel_mixing(("RG", "BW"), c) == pytest.approx(np.array(by_hand))
    # Bayer: R has four G, G two R and two B, whichever row it is in.
    bayer = [[own, 4 * c, 0], [two, own, two], [0, 4 * c, own]]
    assert channel_mixing(("RG", "GB"), c) == pytest.approx(np.array(bayer))


def test_a_density_dims_what_neighbours_get_and_sites_are_told_in_undimmed_light() -> None:
    """W behind a quarter hands over a quarter; what its neighbours hand it counts four times in its own unit."""
    mixing = channel_mixing(("RG", "BW"), 0.05, {"W": 0.25})
    assert mixing[1] == pytest.approx([0.1, 0.8, 0.0, 0.025])
    assert mixing[3] == pytest.approx([0.0, 0.4, 0.4, 0.8])


def test_mixing_is_what_the_readout_does_to_an_even_field() -> None:
    for name, tile in MOSAICS.items():
        names, side = channels(tile), 6 * len(tile)
        light = np.arange(1.0, 1 + len(names))
        behind = sum(e * mask(tile, channel, (side, side)) for channel, e in zip(names, light, strict=True))
        down, across = len(tile), len(tile[0])
        read = spread_charge(behind, 0.03)[2 * down : 4 * down, 2 * across : 4 * across]
        tiles = site_mixing(tile, 0.03) @ light
        assert read == pytest.approx(np.tile(tiles, (2, 2)), rel=1e-12), name
        sites = channel_map(tile, read.shape)
        means = [read[sites == channel].mean() for channel in names]
        assert channel_mixing(tile, 0.03) @ light == pytest.approx(means, rel=1e-12), name
        assert unmixed(channel_mixing(tile, 0.03), means) == pytest.approx(light, rel=1e-9), name


def test_where_all_charge_goes_to_neighbours_some_field_that_fits_is_found() -> None:
    """At a quarter R and W of the paper's tile read the same: infinitely many fields fit, and none is refused."""
    mixing = channel_mixing(("RG", "BW"), 0.25)
    found = unmixed(mixing, mixing @ [1.0, 2.0, 1.0, 6.0])
    assert mixing @ found == pytest.approx(mixing @ [1.0, 2.0, 1.0, 6.0], rel=1e-6)
    assert np.all(found > 0)
