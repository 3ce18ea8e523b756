"""Mosaics: which channel a pixel has."""

import numpy as np
from builders import RGBW_4X4
from loop import loop
from refusal import refusal

from sensor.cfa import BAYER, MOSAICS, RGBW, channel_map, channels, check_tile, tile_of


def test_the_paper_s_tile_is_r_g_over_b_w_with_its_first_row_on_top():
    assert channel_map(RGBW, (3, 5)).tolist() == [list("RGRGR"), list("BWBWB"), list("RGRGR")]
    assert channel_map(BAYER, (2, 3)).tolist() == [list("RGR"), list("GBG")]


@loop("tile", [RGBW, BAYER, RGBW_4X4, ("W",), ("RGB",)])
@loop("shape", [(4, 4), (7, 9), (5, 4)])
def test_each_pixel_carries_the_tile_s_letter_modulo_its_size(tile, shape):
    names = channel_map(tile, shape)
    assert names.shape == shape
    for row, column in np.ndindex(shape):
        assert names[row, column] == tile[row % len(tile)][column % len(tile[0])]


def test_channels_come_as_r_g_b_w_and_others_behind_them():
    assert channels(RGBW) == ("R", "G", "B", "W")
    assert channels(BAYER) == ("R", "G", "B")
    assert channels(("WB", "GR")) == ("R", "G", "B", "W")
    assert channels(("YW", "CR")) == ("R", "W", "Y", "C")


@loop("tile", ["RGBW", (), ("",), ("R1",), ("RG", 3), ("R G",)])
def test_what_is_no_tile_of_letters_is_refused_with_an_example(tile):
    assert repr(tile) in refusal(check_tile, tile, match=r"not a tile.*allowed")


# Mosaics by name


def test_bayer_s_four_phases_are_one_mosaic_moved_by_a_row_and_a_column():
    start = channel_map(BAYER, (4, 4))
    for name, row, column in (("rggb", 0, 0), ("grbg", 0, 1), ("gbrg", 1, 0), ("bggr", 1, 1)):
        moved = np.roll(start, (-row, -column), axis=(0, 1))[:2, :2]
        assert tuple("".join(line) for line in moved) == MOSAICS[f"bayer_{name}"]
        assert "".join(MOSAICS[f"bayer_{name}"]) == name.upper()
    assert MOSAICS["bayer"] == MOSAICS["bayer_rggb"]


def test_the_4x4_mosaic_is_a_white_checkerboard_with_a_bayer_mosaic_of_2x2_cells():
    names = channel_map(MOSAICS["rgbw_4x4"], (4, 4))
    rows, columns = np.indices((4, 4))
    np.testing.assert_array_equal(names == "W", (rows + columns) % 2 == 0)
    assert {channel: int((names == channel).sum()) for channel in "RGB"} == {"R": 2, "G": 4, "B": 2}
    cells = [["".join(names[y : y + 2, x : x + 2].ravel()) for x in (0, 2)] for y in (0, 2)]
    assert cells == [["WGGW", "WRRW"], ["WBBW", "WGGW"]]


def test_a_mosaic_is_taken_by_name_or_by_its_rows():
    assert tile_of("bayer") == BAYER
    assert tile_of(["CY", "YM"]) == tile_of("CY/YM") == ("CY", "YM")
    refusal(tile_of, "rgwb", match=r"cfa: 'rgwb' is unknown; allowed: bayer.*did you mean 'rgbw'")
    refusal(tile_of, 3, match=r"cfa: 3 is not a tile")
