"""Gindele & Gallagher: through W where it isn't full, without it where it is; Adams' directions."""

from itertools import product

import numpy as np
import pytest
from builders import RGBW_PHASES, raw_image

from isp.planes import fill
from isp.processors.catalogue import PROCESSORS
from isp.processors.gindele import REACH, adams_planes, luminance_plane
from sensor.cfa import RGBW, Tile, mask
from sensor.raw import RawImage

ONES = [1.0, 1.0, 1.0, 1.0]


def raw(values: np.ndarray, cfa: Tile = RGBW) -> RawImage:
    return raw_image(np.rint(values), cfa, black_dn=0.0, white_dn=15_000.0, dsnu_e=0.0)


def test_where_nothing_saturates_it_is_the_first_interpolation() -> None:
    for cfa in RGBW_PHASES:
        values = np.rint(np.random.default_rng(0).uniform(100, 10_000, (21, 24)))
        picture = PROCESSORS["rgbw_gindele"].develop(raw(values, cfa), np.eye(3), balance=ONES)
        np.testing.assert_allclose(picture.rgb, adams_planes(values, cfa), rtol=1e-12)


def test_where_w_is_full_the_colours_stand_alone() -> None:
    for cfa in RGBW_PHASES:
        values = np.rint(np.random.default_rng(1).uniform(100, 10_000, (24, 40)))
        values[:, :20][mask(cfa, "W", (24, 40))[:, :20]] = 15_000
        rgb = PROCESSORS["rgbw_gindele"].develop(raw(values, cfa), np.eye(3), balance=ONES).rgb
        alone = np.stack([fill(values, cfa, channel) for channel in "RGB"], axis=-1)
        np.testing.assert_allclose(rgb[:, : 19 + REACH - 1], alone[:, : 19 + REACH - 1], rtol=1e-12)
        np.testing.assert_allclose(rgb[:, 21 + REACH :], adams_planes(values, cfa)[:, 21 + REACH :], rtol=1e-12)


def test_a_sites_own_detail_is_added_as_a_quarter_of_its_laplacian() -> None:
    # one red sample of 4: 2 * 4 / 4 in W there, on both diagonals alike; two sites away the other diagonal is smoother
    mosaic = np.zeros((20, 20))
    mosaic[8, 8] = 4.0
    white = luminance_plane(mosaic, RGBW)
    assert white[8, 8] == 2.0
    assert white[[6, 6, 10, 10], [6, 10, 6, 10]] == pytest.approx(np.zeros(4))


def test_a_grey_ramp_is_reproduced_in_any_direction() -> None:
    for cfa in RGBW_PHASES:
        rows, columns = np.indices((22, 25))
        ramp = 1000.0 + 7.0 * rows - 11.0 * columns
        white = luminance_plane(ramp, cfa)
        inside = (slice(5, -5), slice(5, -5))  # reflection bends the ramp at the border
        assert white[inside] == pytest.approx(ramp[inside], abs=1e-9), cfa
        assert adams_planes(ramp, cfa)[inside] == pytest.approx(np.repeat(ramp[inside][..., None], 3, 2), abs=1e-9), cfa


def test_w_beside_its_sites_is_taken_along_a_straight_edge_not_across() -> None:
    for cfa, axis in product(RGBW_PHASES, (0, 1)):
        # A grey edge along an axis, once its diagonal sites know W: those beside W's own have two neighbours on their
        # side of the edge and, across it, one on each; the Laplacian is as large across. So nothing is blurred there.
        edge = np.where(np.indices((20, 20))[axis] < 10, 100.0, 900.0)
        white = luminance_plane(edge, cfa)
        row, column = divmod("".join(cfa).index("W"), 2)
        opposite = mask(cfa, cfa[1 - row][1 - column], (20, 20))
        known = opposite & (white != edge)  # diagonal sites at the edge: both diagonals cross it
        beside = ~opposite & ~mask(cfa, "W", (20, 20))
        reached = np.zeros((20, 20), dtype=bool)
        for shift, one in product((1, -1), (0, 1)):
            reached |= np.roll(known, shift, one)
        np.testing.assert_array_equal(white[beside & ~reached], edge[beside & ~reached])
        assert known.any(), (cfa, axis)


def test_the_smaller_gradient_wins_on_a_diagonal() -> None:
    # a grey edge along the falling diagonal: W at the sites diagonal to W's own comes from their own side
    rows, columns = np.indices((20, 20))
    edge = np.where(rows - columns < 0, 100.0, 900.0)
    opposite = mask(RGBW, "R", (20, 20))
    opposite[:4], opposite[-4:], opposite[:, :4], opposite[:, -4:] = False, False, False, False  # reflection bends it
    np.testing.assert_array_equal(luminance_plane(edge, RGBW)[opposite], edge[opposite])
