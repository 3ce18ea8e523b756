"""A camera's numbers: black level and gain of the design, the presets' two readings of Table 1, refusals."""

from dataclasses import replace

import numpy as np
import pytest
from loop import loop
from refusal import refusal

from render.spectrum import flat
from sensor.config import LensConfig, SensorConfig
from sensor.curves import Responses
from sensor.pixel import PixelConfig
from sensor.presets import table1_pixel
from sensor.response import check_window

PIXEL = PixelConfig(pitch_um=2.2, fill_factor=0.9, full_well_e=15_000.0, read_noise_e=3.0, dsnu_e=4.0, prnu=0.01)
LENS = LensConfig(f_number=2.8)


PARTS = [("pixel", "PixelConfig"), ("lens", "LensConfig"), ("responses", "Responses"), ("chip", "Chip")]


@loop(("name", "kind"), PARTS)
@loop("value", [None, {}])
def test_a_part_of_another_kind_is_refused_by_name(name, kind, value):
    refusal(replace, SensorConfig(PIXEL, LENS), **{name: value}, match=f"{name}: a .* is none; allowed: {kind}")


@loop(("bits", "black_dn"), [(8, 1), (14, 28), (16, 110)])  # 0.42, 27.3 and 109.04 rounded up
def test_default_black_level_is_the_whole_dn_from_five_sigmas_of_the_dark_and_the_well_ends_at_the_top(bits, black_dn):
    sensor = SensorConfig(PIXEL, LENS, bits=bits)
    assert sensor.white_dn == 2**bits - 1
    assert (type(sensor.black_dn), sensor.black_dn) == (int, black_dn)
    assert sensor.gain_e_per_dn == 15_000 / (2**bits - 1 - black_dn)
    black_e = sensor.black_dn * sensor.gain_e_per_dn
    assert 25.0 <= black_e < 25.0 + 1.01 * sensor.gain_e_per_dn  # read 3, DSNU 4: sigma 5


def test_a_black_level_that_is_whole_already_is_not_raised_by_rounding_errors():
    # five sigmas read `black_dn` where read noise is well / (white - black) * black / 5
    for black_dn in range(1, 2000, 7):
        read_noise_e = 15_000 / (16_383 - black_dn) * black_dn / 5
        sensor = SensorConfig(replace(PIXEL, read_noise_e=read_noise_e, dsnu_e=0.0), LENS)
        assert sensor.black_dn == black_dn


def test_a_converter_too_coarse_for_its_dark_keeps_a_step_for_light():
    assert SensorConfig(PIXEL, LENS, bits=1).black_dn == 0
    sensor = SensorConfig(replace(PIXEL, read_noise_e=1e6), LENS, bits=2)
    assert (sensor.black_dn, sensor.gain_e_per_dn) == (2, 15_000.0)


@loop("black_level_dn", [0, 64, 99.0])
def test_explicit_black_level_stays_where_it_is_put_and_the_well_still_ends_at_the_top(black_level_dn):
    sensor = SensorConfig(PIXEL, LENS, bits=10, black_level_dn=black_level_dn)
    assert sensor.black_dn == pytest.approx(black_level_dn, rel=1e-15)
    assert sensor.gain_e_per_dn == pytest.approx(15_000 / (1023 - black_level_dn), rel=1e-15)


def test_a_camera_without_dark_noise_has_black_at_0():
    sensor = SensorConfig(replace(PIXEL, read_noise_e=0.0, dsnu_e=0.0), LENS)
    assert sensor.black_dn == 0.0
    assert sensor.gain_e_per_dn == 15_000 / 16_383


def test_table_1_contradicts_itself_and_the_well_rules():
    sensor = table1_pixel()
    assert sensor.pixel.swing_e == pytest.approx(36_000.0, rel=1e-12)  # 1.08 V at 30 uV an electron
    full_e = (sensor.white_dn - sensor.black_dn) * sensor.gain_e_per_dn
    assert full_e == pytest.approx(15_000.0, rel=1e-12)


@loop(
    ("field", "value"),
    [
        ("pitch_um", 0.0),
        ("fill_factor", 1.01),
        ("full_well_e", 0.0),
        ("read_noise_e", -0.1),
        ("dsnu_e", np.nan),
        ("prnu", 1.7),
        ("dark_current_e_per_s", np.inf),
        ("conversion_gain_uv_per_e", 0.0),
        ("column_gain_spread", -0.01),
        ("column_offset_e", np.nan),
        ("hot_pixel_share", 1.5),
        ("hot_pixel_dark_current_e_per_s", -1.0),
        ("crosstalk", 0.26),
    ],
)
def test_a_pixel_out_of_range_is_refused_by_name_and_value(field, value):
    refusal(replace, PIXEL, words=(f"{field}: {value!r}", "outside", "give "), **{field: value})


@loop(("field", "value"), [("f_number", 0.0), ("transmittance", 1.5), ("magnification", -0.5), ("f_number", np.nan)])
def test_a_lens_out_of_range_is_refused_by_name_and_value(field, value):
    refusal(replace, LENS, words=(f"{field}: {value!r}", "outside", "give "), **{field: value})


@loop(
    ("changes", "parts"),
    [
        ({"bits": 17}, ("bits: 17", "1 to 16")),
        ({"bits": 10.5}, ("bits: 10.5", "1 to 16", "round it")),
        ({"black_level_dn": -1.0}, ("black_level_dn: -1.0", "give DN under the white level")),
        ({"black_level_dn": 255.0, "bits": 8}, ("black_level_dn: 255.0", "0 to 254")),
        ({"black_level_dn": 9.84}, ("black_level_dn: 9.84 is not a whole number", "round it")),
        ({"window_nm": (780.0, 380.0)}, ("window_nm: (780.0, 380.0)", "shortest")),
        ({"window_nm": (0.38, 0.78)}, ("window_nm: (0.38, 0.78)", "in 100-20000 nm")),
        ({"cfa": "RGBW"}, ("cfa: 'RGBW'", "tuple of rows")),
        ({"cfa": ("RG", "XW")}, ("responses: channel: 'X'", "allowed: B, G, R, W")),
        ({"responses": Responses({"R": flat(0.5), "G": flat(0.5), "B": flat(0.5)})}, ("'W'", "allowed: B, G, R")),
    ],
)
def test_a_sensor_that_cannot_be_is_refused_in_one_line(changes, parts):
    refusal(SensorConfig, PIXEL, LENS, words=parts, **changes)


# The window


def bands(first_nm, last_nm, width_nm=10.0):
    """Centres and widths of bands that fill a range."""
    centres = np.arange(first_nm + width_nm / 2, last_nm, width_nm)
    return centres, np.full(centres.size, width_nm)


@loop("window_nm", [(380.0, 780.0), (400.0, 700.0), (300.0, 780.0), (380.0, 1068.0), (800.0, 900.0)])
def test_bands_that_reach_the_window_s_ends_are_accepted(window_nm):
    check_window(window_nm, *bands(300.0, 1070.0))
    check_window(window_nm, *bands(300.0, 1060.0))  # 8 nm less: no further band of 10 nm would fit


@loop("window_nm", [(380.0, 780.0), (400.0, 700.0), (500.0, 600.0)])
def test_inside_380_to_780_nm_absent_bands_are_the_scene_s_choice(window_nm):
    check_window(window_nm, *bands(450.0, 650.0))
    check_window(window_nm, np.array([589.0]), np.array([1.0]))


@loop(
    ("window_nm", "parts"),
    [
        ((380.0, 1068.0), ("(380.0, 1068.0)", "780 to 1068 nm", "380 to 780 nm, hold 0 nm", "narrow the window")),
        ((380.0, 790.0), ("780 to 790 nm", "render those bands")),
        ((360.0, 780.0), ("360 to 380 nm",)),
        ((800.0, 1000.0), ("800 to 1000 nm",)),
    ],
)
def test_a_window_beyond_the_scene_s_bands_is_refused_in_one_line(window_nm, parts):
    refusal(check_window, window_nm, *bands(380.0, 780.0), words=parts)


def test_a_gap_in_the_infrared_bands_is_seen_too():
    nm, width = bands(380.0, 1070.0)
    inside = (nm < 800) | (nm > 840)
    refusal(check_window, (380.0, 1068.0), nm[inside], width[inside], match=r"780 to 1068 nm.*hold 248 nm")
