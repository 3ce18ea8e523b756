"""The raw image: electrons, the dark's spread, and which pixels count as saturated."""

from dataclasses import replace

import numpy as np
import pytest
from builders import RGBW_4X4
from loop import loop
from refusal import refusal
from scipy import stats

from sensor.calibration import ChannelNoise
from sensor.cfa import BAYER, MOSAICS, RGBW, channel_map, channels, check_tile, tile_of
from sensor.raw import SATURATION_SIGMAS, RawImage, noise_at_sites


class Table:
    """As a DataFrame of pandas: an array that has lost its names would pass for a picture."""

    iloc, ndim = None, 2

    def __array__(self, *_: object, **__: object) -> np.ndarray:
        return np.ones((2, 2))


RAW = RawImage(np.full((4, 4), 120, np.uint16), RGBW, 100.0, 1100.0, 2.0, 3.0, 4.0, 0.01, 0.02)
STATED = 3.2e-5  # of a normal under -4 sigma


def test_electrons_are_dn_above_black_times_gain():
    dn = np.array([[0, 100], [350, 1100]], np.uint16)
    np.testing.assert_array_equal(replace(RAW, dn=dn).electrons, [[-200.0, 0.0], [500.0, 2000.0]])


def test_dark_spread_is_read_noise_dsnu_and_a_rounding_in_quadrature():
    assert RAW.dark_noise_e == pytest.approx(np.sqrt(3.0**2 + 4.0**2 + 2.0**2 / 12), rel=1e-15)


def test_saturation_begins_four_sigmas_of_the_dark_and_half_a_dn_under_the_well():
    assert SATURATION_SIGMAS == 4.0
    assert RAW.saturation_e == pytest.approx(2000.0 - 4 * np.sqrt(25) - 1.0, rel=1e-12)  # rounding is no more than that
    dn = np.array([[1089, 1090], [1091, 1100]], np.uint16)  # 1979 e- is DN 1089.5
    np.testing.assert_array_equal(replace(RAW, dn=dn).saturated, [[False, True], [True, True]])


def test_a_converter_of_one_bit_calls_its_upper_reading_saturated_and_not_the_dark():
    raw = replace(RAW, dn=np.array([[0, 1], [1, 0]], np.uint16), black_dn=0.0, white_dn=1.0, gain_e_per_dn=15_000.0)
    assert raw.saturation_e == pytest.approx(15_000 - 4 * 5 - 7500)
    np.testing.assert_array_equal(raw.saturated, [[False, True], [True, False]])


@loop("table", [np.ma.masked_array(np.ones((2, 2)), mask=[[True, False], [False, False]]), Table()])
def test_masked_samples_and_tables_with_names_are_refused(table):
    refusal(replace, RAW, dn=table, match="masked|a Table is not allowed; give an array")


def test_dark_current_fills_the_well_and_columns_gains_act_on_both():
    """Its own noise is clipped with the light's: columns and readout alone spread a full pixel."""
    read_e2, dark_e, spread = 3.0**2 + 4.0**2, 900.0, 0.01
    dark = {"read_noise_e": np.sqrt(3.0**2 + dark_e), "dsnu_e": np.hypot(4.0, spread * dark_e)}
    raw = replace(RAW, **dark, dark_current_e=dark_e, column_gain_spread=spread)
    expected_e = 2000 - 4 * np.sqrt(read_e2 + (spread * (2000 + dark_e)) ** 2) - 1
    assert raw.saturation_e == pytest.approx(expected_e, rel=1e-12)


def test_a_channel_read_apart_has_its_own_noise_and_saturation():
    """Four times the shot noise, read noise 6, DSNU 8 and a well of 6000: 3000 DN over black."""
    white = ChannelNoise("W", full_well_e=6000.0, shot=4.0, read_noise_e=6.0, dsnu_e=8.0, prnu=0.01)
    raw = replace(RAW, dn=np.full((4, 4), 1100, np.float32), channel_noise=(white,))
    got = noise_at_sites(raw, np.full((4, 4), 500.0))
    assert got[0, 0] == got[0, 1] == pytest.approx(500 + 3**2 + 4**2 + 5**2, rel=1e-12)
    assert got[1, 1] == got[3, 3] == pytest.approx(4 * 500 + 6**2 + 8**2 + 5**2, rel=1e-12)
    np.testing.assert_array_equal(raw.saturated[:2, :2], [[True, True], [True, False]])
    full_dn = 100 + (6000 - 4 * 10 - 4) / 2
    for dn, full in ((full_dn - 0.01, False), (full_dn + 0.01, True)):
        assert replace(raw, dn=np.full((4, 4), dn)).saturated[1, 1] == full, dn


@loop("sigma_dn", np.geomspace(0.05, 200, 60))
def test_a_saturated_pixel_is_missed_with_at_most_the_stated_probability(sigma_dn):
    raw = replace(RAW, gain_e_per_dn=1.0, read_noise_e=sigma_dn, dsnu_e=0.0)
    first_flagged = np.ceil(raw.saturation_e - 1000.0)  # DN under the top
    missed = stats.norm.cdf((first_flagged - 0.5) / sigma_dn)
    assert missed <= STATED


@loop("shape", [(1, 4), (4, 1), (4,), (4, 4, 1), (0, 0)])
def test_a_frame_that_does_not_hold_a_tile_is_refused(shape):
    assert str(shape) in refusal(
        replace, RAW, dn=np.zeros(shape, np.uint16), match=r"mosaic: shape .* doesn't fit the tile .*at least 2x2"
    )


@loop("dtype", [np.uint8, np.int16, np.uint16, np.int64, np.float32, np.float64, list])
def test_whole_numbers_and_finite_floats_are_taken_as_they_are(dtype):
    dn = np.array([[101, 102], [103, 104]], np.int64)
    given = dn.tolist() if dtype is list else dn.astype(dtype)
    np.testing.assert_array_equal(replace(RAW, dn=given).electrons, [[2.0, 4.0], [6.0, 8.0]])


@loop(
    ("changes", "message"),
    [
        ({"black_dn": 1100.0}, r"black_dn: 1100\.0 is not under white_dn 1100\.0; swap or correct"),
        ({"black_dn": np.nan}, r"black_dn: nan is outside"),
        ({"gain_e_per_dn": 0.0}, r"gain_e_per_dn: 0\.0 is outside .*give electrons per digital number"),
        ({"read_noise_e": -1.0}, r"read_noise_e: -1\.0 is outside .*give electrons, 0 for none"),
        ({"dsnu_e": np.inf}, r"dsnu_e: inf is outside .*give electrons, 0 for none"),
        ({"prnu": 1.7}, r"prnu: 1\.7 is outside 0 to 1; give a fraction"),
        ({"exposure_s": -1e-9}, r"exposure_s: -1e-09 is outside .*give seconds, 0 or more"),
        ({"f_number": 0.0}, r"f_number: 0\.0 is outside"),
        ({"iso": -100.0}, r"iso: -100\.0 is outside"),
        ({"white_dn": 2.0**24 + 2}, r"white_dn: 16777218\.0 is outside .*give digital numbers of 24 bits"),
        ({"dn": np.full((2, 2), np.nan)}, r"dn: nan at \(0, 0\) is not allowed; give finite numbers"),
        ({"dn": np.ones((2, 2), complex)}, r"dn: samples of type complex128 are not allowed; give whole numbers or"),
        ({"dn": [[1, 2], [3]]}, r"dn: samples of type object"),
        ({"camera": "Käfer"}, r"camera: 'Käfer' is not allowed"),
        *(
            (
                {"channel_noise": tuple(ChannelNoise(x, 1e3, 1.0, 1.0, 1.0, 0.0) for x in names)},
                r"channel_noise: .* each once",
            )
            for names in ("X", "WW")
        ),
        ({"cfa": ("RG", "B")}, r"cfa: rows of .* differ in length"),
    ],
)
def test_calibration_that_cannot_be_is_refused(changes, message):
    refusal(replace, RAW, match=message, **changes)


# Mosaics: which channel a pixel has.


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
