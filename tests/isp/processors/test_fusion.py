"""RGBW prior art: what W's luminance is, how colours are combined, and the density and complementary colours."""

from itertools import product

import numpy as np
import pytest
from builders import RGBW_PHASES, mosaic_of, raw_image

from isp.colour.white_balance import neutral_response
from isp.planes import fill
from isp.processors.catalogue import PROCESSORS
from isp.processors.fusion import MATCHED_RADIUS, tent_means, with_luminance
from isp.processors.gindele import REACH, adams_planes, luminance_plane
from rodcone.colour_spaces import luminance_of_srgb
from sensor.cfa import RGBW, Tile, channel_map, mask
from sensor.curves import complementary, matched_transmittance, rgbw
from sensor.raw import RawImage

MATRIX = np.array([[1.6, -0.5, -0.1], [-0.2, 1.4, -0.2], [0.0, -0.5, 1.5]])
BALANCE = [0.5, 1.0, 0.4, 5.0]


def exposure(planes_e: dict[str, np.ndarray], cfa: Tile = RGBW, dark_e: float = 1.0) -> RawImage:
    """Noise-free raw image in which each channel's sites read that channel's plane."""
    shape = next(iter(planes_e.values())).shape
    dn = np.clip(np.rint(4 * mosaic_of(planes_e, cfa, shape)) + 100, 0, 60_100)
    return raw_image(dn, cfa, white_dn=60_100.0, gain_e_per_dn=0.25, read_noise_e=dark_e, dsnu_e=0.0)


def grey(level_e: np.ndarray, cfa: Tile = RGBW, white: float = 5.0) -> RawImage:
    return exposure({"R": 0.5 * level_e, "G": level_e, "B": 0.4 * level_e, "W": white * level_e}, cfa)


def test_another_luminance_keeps_the_colour_differences() -> None:
    rgb = np.random.default_rng(0).uniform(0, 100, (5, 6, 3))
    luminance = np.random.default_rng(1).uniform(0, 100, (5, 6))
    changed = with_luminance(rgb, luminance)
    assert luminance_of_srgb(changed) == pytest.approx(luminance)
    assert changed[..., 0] - changed[..., 2] == pytest.approx(rgb[..., 0] - rgb[..., 2])


def test_the_luminance_is_ws_in_full_bandwidth() -> None:
    for name, white in [("rgbw_sato", 5.0), ("rgbw_yamagami", 1.0)]:
        level = np.random.default_rng(2).uniform(100, 900, (20, 22))
        raw = grey(level, white=white)
        balance = [*BALANCE[:3], white]
        picture = PROCESSORS[name].develop(raw, MATRIX, balance=balance)
        plane = fill(raw.electrons, raw.cfa, "W") / white
        assert luminance_of_srgb(picture.rgb) == pytest.approx(plane, rel=1e-12), (name, white)


def test_combining_weighs_samples_by_a_tent() -> None:
    mosaic = np.zeros((24, 24))
    mosaic[12, 12] = 1.0  # a red site
    spread = tent_means(mosaic, RGBW, "R")
    # samples at distances 0 and 2 of a red site: (4 and twice 2) along each axis, 64 in all; next to it twice (3, 1)
    assert spread[12, 12] == pytest.approx(16 / 64)
    assert spread[12, 14] == pytest.approx(8 / 64)
    assert spread[12, 13] == pytest.approx(12 / 64)
    assert spread[12, 12 + MATCHED_RADIUS + 1] == 0.0


def test_kijima_gives_a_grey_scene_all_of_ws_detail() -> None:
    # W's detail at W's sites, and no colour where the differences of the colours from W are nothing
    level = np.random.default_rng(4).uniform(200, 800, (24, 24))
    flat = np.full((24, 24), 500.0)
    white = exposure({"R": 0.5 * flat, "G": flat, "B": 0.4 * flat, "W": 5 * level})
    rgb = PROCESSORS["rgbw_kijima"].develop(white, np.eye(3), balance=BALANCE).rgb
    plane = fill(white.electrons / 5, RGBW, "W")
    for index, channel in enumerate("RGB"):
        expected = plane + tent_means(
            np.where(channel_map(RGBW, (24, 24)) == channel, 500.0 - plane, 0.0), RGBW, channel
        )
        assert rgb[..., index] == pytest.approx(expected, rel=1e-9)


def test_early_fusion_gives_away_what_is_over_ws_full_well() -> None:
    # Green at 0.4 of its well, W at twice its own: luminance stays at W's full well for Sato, colours stay for Kijima
    raw = grey(np.full((16, 16), 6000.0))
    assert PROCESSORS["rgbw_sato"].develop(raw, MATRIX, balance=BALANCE).rgb == pytest.approx(
        np.full((16, 16, 3), 3000.0), rel=1e-4
    )
    assert PROCESSORS["rgbw_kijima"].develop(raw, MATRIX, balance=BALANCE).rgb == pytest.approx(
        np.full((16, 16, 3), 6000.0), rel=1e-4
    )


def test_a_density_of_its_own_is_what_the_default_neutral_of_yamagami_holds() -> None:
    # too dark for Gray World: the calibrated response decides, and knows that W is behind its density
    shares = neutral_response(("R", "G", "B", "W")) / neutral_response(("G",))
    shares[3] *= matched_transmittance(rgbw())
    assert shares[3] == pytest.approx(1.0, rel=1e-12)
    level = {channel: np.full((16, 16), 80.0 * share) for channel, share in zip("RGBW", shares, strict=True)}
    picture = PROCESSORS["rgbw_yamagami"].develop(exposure(level, dark_e=1000.0), MATRIX)
    assert picture.balance == dict.fromkeys("RGBW", "calibrated")
    # half a DN is 0.125 e-, in B 0.4 when balanced, and 1.5 times that in the matrix
    assert picture.rgb == pytest.approx(np.full((16, 16, 3), 80.0), abs=0.8)


def test_complementary_colours_come_in_the_matrix_order_c_y_m() -> None:
    # Yellow is the unit, W (balanced to 1000) the luminance; with the identity each output shows its own column.
    level = {"C": np.full((16, 16), 900.0), "M": np.full((16, 16), 350.0), "Y": np.full((16, 16), 1000.0)}
    raw = exposure({**level, "W": np.full((16, 16), 5000.0)}, ("CM", "YW"))
    names = raw.channels
    assert names == ("W", "C", "M", "Y")
    picture = PROCESSORS["cmyw_yamagami"].develop(raw, np.eye(3), balance=[5.0, 0.9, 0.7, 1.0])
    balanced = np.array([1000.0, 1000.0, 500.0])  # C, Y, M
    expected = balanced + (1000.0 - luminance_of_srgb(balanced))
    assert picture.rgb == pytest.approx(np.broadcast_to(expected, (16, 16, 3)), rel=1e-9)
    assert set(picture.balance) == set("CMYW")


def test_complementary_colours_in_the_dark_take_their_own_neutral() -> None:
    response = neutral_response(("W", "C", "M", "Y"), complementary(rgbw()))
    shares = zip("WCMY", response / response[3], strict=True)
    level = {channel: np.full((16, 16), 80.0 * share) for channel, share in shares}
    picture = PROCESSORS["cmyw_yamagami"].develop(exposure(level, ("CM", "YW"), dark_e=1000.0), np.eye(3))
    assert picture.balance == dict.fromkeys("CMYW", "calibrated")
    assert picture.rgb == pytest.approx(np.full((16, 16, 3), 80.0), abs=0.3)


def test_where_w_is_full_the_colours_keep_their_ratios_at_its_luminance() -> None:
    # W reads 15 000 e- at most: 3000 balanced. An orange of that and more luminance keeps its chromaticity.
    level = {"R": 5000.0, "G": 6000.0, "B": 800.0, "W": 40_000.0}
    raw = exposure({channel: np.full((16, 16), one) for channel, one in level.items()})
    orange = np.array([10_000.0, 6000.0, 2000.0])
    for name in ("rgbw_sato", "rgbw_yamagami"):
        rgb = PROCESSORS[name].develop(raw, np.eye(3), balance=BALANCE).rgb
        expected = orange * 3000.0 / luminance_of_srgb(orange)
        assert rgb == pytest.approx(np.broadcast_to(expected, (16, 16, 3)), rel=1e-4)


# Gindele & Gallagher: through W where it isn't full, without it where it is; Adams' directions.


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
