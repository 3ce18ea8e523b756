"""From expected electrons to digital numbers: the order of the noise terms, each switched off, clipping, refusals.

Moments of shot noise and photon transfer: `tests/statistics`.
"""

from dataclasses import replace

import numpy as np
import pytest
from builders import even_device
from hypothesis import given, settings
from hypothesis import strategies as st
from loop import loop
from scipy import stats

from sensor.config import LensConfig, SensorConfig
from sensor.device import Device, draw_device
from sensor.pixel import PixelConfig
from sensor.readout import draw_frame, draw_mean_frame, noise_sources, noise_variance, read_out, spread_charge

QUIET = PixelConfig(2.2, 0.9, full_well_e=1000.0, read_noise_e=0.0, dsnu_e=0.0, prnu=0.0)


def camera(bits=14, black_level_dn=None, **pixel):
    return SensorConfig(replace(QUIET, **pixel), LensConfig(2.8), bits=bits, black_level_dn=black_level_dn)


def rng(seed=0):
    return np.random.default_rng(seed)


def expose(sensor, light_e, shape=(64, 64), device=None, exposure_s=0.01, seed=0):
    device = even_device(shape) if device is None else device
    return read_out(np.broadcast_to(light_e, shape), sensor, device, exposure_s, rng(seed))


# Each term alone, and zero


@loop("bits", [1, 8, 14, 16])
@loop("black_level_dn", [None, 0])
def test_no_light_and_no_noise_read_black_in_every_pixel(bits, black_level_dn):
    sensor = camera(bits, black_level_dn)
    raw = expose(sensor, 0.0)
    np.testing.assert_array_equal(raw.dn, sensor.black_dn)
    assert raw.dn.dtype == np.uint16


# The order of the terms


def test_photo_response_scales_the_mean_before_the_poisson_draw():
    columns = np.repeat([0.25, 1.0, 4.0], 200)
    device = Device(np.broadcast_to(columns, (600, 600)), np.zeros((600, 600)))
    sensor = camera(bits=16)
    electrons = expose(sensor, 30.0, (600, 600), device).electrons
    for response in (0.25, 1.0, 4.0):
        here, mean = electrons[:, columns == response], 30.0 * response
        # scaled after the draw, the variance would be 30 response^2. Six comparisons within 4 standard errors: 3.8e-4.
        assert abs(here.mean() - mean) < 4 * np.sqrt(mean / here.size)
        assert abs(here.var() - mean) < 4 * np.sqrt((2 * mean**2 + mean) / here.size)


@loop("exposure_s", [0.0, 0.1, 1.0])
def test_a_frame_without_light_has_no_mean_and_the_noise_that_its_raw_image_states(exposure_s):
    """Electrons of the dark: their mean within 4 standard errors, their variance by chi-square, 1e-4."""
    terms = {"read_noise_e": 3.0, "dsnu_e": 2.0, "column_gain_spread": 0.02, "prnu": 0.02}
    sensor = camera(bits=10, dark_current_e_per_s=305.0, **terms)
    raw = expose(sensor, 0.0, (256, 1024), draw_device(sensor, (256, 1024), rng(9)), exposure_s)
    by_columns_e = raw.column_gain_spread * 305.0 * exposure_s
    error_e = np.sqrt(raw.dark_noise_e**2 / raw.dn.size + by_columns_e**2 / 1024)
    assert abs(raw.electrons.mean()) < 4 * error_e
    spread_e2 = 4 * (raw.dark_noise_e**2 * np.sqrt(2 / raw.dn.size) + by_columns_e**2 * np.sqrt(2 / 1024))
    assert abs(raw.electrons.var() - raw.dark_noise_e**2) < spread_e2


def test_a_well_that_dark_current_fills_reads_full_and_has_a_black_under_white():
    sensor = camera(dark_current_e_per_s=1e9)
    assert expose(sensor, 0.0, (8, 8), exposure_s=1.0).saturated.all()


def test_the_well_clips_before_dark_offsets_are_added():
    sensor = camera(dsnu_e=4.0)
    device = draw_device(sensor, (64, 64), rng(6))
    raw = expose(sensor, 1e5, device=device)
    expected = np.rint((1000.0 + device.dark_offset_e) / sensor.gain_e_per_dn + sensor.black_dn)
    np.testing.assert_array_equal(raw.dn, np.clip(expected, 0, sensor.white_dn))
    assert raw.dn.min() < raw.white_dn  # clipped after them, all would read the top


def test_half_of_the_saturated_pixels_read_under_the_top_with_the_moments_of_a_half_normal():
    sensor = camera(bits=16, read_noise_e=12.0)
    raw = expose(sensor, 1e4, (512, 512))
    n, sigma_dn = raw.dn.size, 12.0 / sensor.gain_e_per_dn
    under = stats.norm.cdf(-0.5 / sigma_dn)  # rounding lifts half a DN to the top
    # share and mean within 4 standard errors: false-alarm rate 1.3e-4
    assert abs(np.mean(raw.dn < raw.white_dn) - under) < 4 * np.sqrt(0.25 / n)
    mean = -12.0 / np.sqrt(2 * np.pi)  # of min(0, noise)
    spread = 12.0 * np.sqrt(0.5 - 1 / (2 * np.pi))
    assert abs(raw.electrons.mean() - (1000.0 + mean)) < 4 * spread / np.sqrt(n) + 0.01 * sensor.gain_e_per_dn
    assert np.median(raw.electrons) == pytest.approx(1000.0, abs=sensor.gain_e_per_dn)  # the well, not more


# The converter


def test_with_and_without_shot_noise_a_key_draws_one_read_noise_of_each_reading():
    """In the dark nothing else is drawn; where no reading is named it is the first."""
    sensor, dark, chip = camera(read_noise_e=30.0), np.zeros((32, 32)), even_device((32, 32))
    first, second = (draw_frame(dark, sensor, chip, 0.01, 7, reading) for reading in (0, 1))
    for draw in (draw_frame, draw_mean_frame):
        np.testing.assert_array_equal(draw(dark, sensor, chip, 0.01, 7), first)
    assert not np.array_equal(first, second)


def test_dn_are_electrons_over_gain_plus_black_rounded():
    sensor = camera(bits=10, black_level_dn=100)
    offsets = np.linspace(-150.0, 1200.1, 64 * 64).reshape(64, 64)
    raw = expose(sensor, 0.0, device=Device(np.ones((64, 64)), offsets))
    expected = np.floor(offsets * (1023 - 100) / 1000.0 + 100 + 0.5)
    np.testing.assert_array_equal(raw.dn, np.clip(expected, 0, 1023))
    assert (raw.black_dn, raw.white_dn) == (100, 1023)


def test_the_raw_image_carries_the_calibration_of_the_camera():
    sensor = camera(bits=12, read_noise_e=3.0, dsnu_e=2.0, prnu=0.015)
    raw = expose(sensor, 10.0, exposure_s=0.066)
    assert raw.cfa == sensor.cfa
    assert (raw.read_noise_e, raw.dsnu_e, raw.prnu, raw.exposure_s) == (3.0, 2.0, 0.015, 0.066)
    assert (raw.black_dn, raw.white_dn) == (sensor.black_dn, sensor.white_dn)
    assert raw.gain_e_per_dn == sensor.gain_e_per_dn


# Terms of real chips


def test_a_column_s_amplifier_multiplies_counts_and_not_their_mean():
    gains = np.repeat([0.5, 1.0, 2.0], 200)
    device = Device(np.ones((600, 600)), np.zeros((600, 600)), column_gain=gains)
    electrons = expose(camera(bits=16), 30.0, (600, 600), device).electrons
    for gain in (0.5, 1.0, 2.0):
        here, mean, variance = electrons[:, gains == gain], 30.0 * gain, 30.0 * gain**2  # a mean scaled by it: 30 gain
        # six comparisons within 4 standard errors: 3.8e-4
        assert abs(here.mean() - mean) < 4 * np.sqrt(variance / here.size)
        assert abs(here.var() - variance) < 4 * gain**2 * np.sqrt((2 * 30.0**2 + 30.0) / here.size)


def test_the_well_clips_before_the_column_s_amplifier_and_offsets_come_behind_it():
    gains = np.tile([0.5, 0.8], 32)
    device = Device(np.ones((64, 64)), np.full((64, 64), 20.0), column_gain=gains)
    sensor = camera(bits=16)
    raw = expose(sensor, 1e5, device=device)
    expected = np.rint((1000.0 * gains + 20.0) / sensor.gain_e_per_dn + sensor.black_dn)
    np.testing.assert_array_equal(raw.dn, np.broadcast_to(expected, (64, 64)))


def test_a_hot_pixel_collects_its_own_dark_current_on_top_of_the_others_and_no_light_scales_it():
    hot = np.zeros((300, 300), dtype=bool)
    hot[:, ::3] = True
    device = Device(np.full((300, 300), 2.0), np.zeros((300, 300)), hot=hot)
    sensor = camera(bits=16, dark_current_e_per_s=50.0, hot_pixel_dark_current_e_per_s=400.0)
    raw = expose(sensor, 25.0, (300, 300), device, exposure_s=0.2)
    collected_e = (raw.dn - float(sensor.black_dn)) * sensor.gain_e_per_dn
    for where, mean in ((~hot, 60.0), (hot, 140.0)):
        here = collected_e[where]
        # Poisson: mean and variance within 4 standard errors, four comparisons: 2.5e-4
        assert abs(here.mean() - mean) < 4 * np.sqrt(mean / here.size)
        assert abs(here.var() - mean) < 4 * np.sqrt((2 * mean**2 + mean) / here.size)


def test_hot_pixels_are_cold_in_an_exposure_of_0_s():
    device = Device(np.ones((8, 8)), np.zeros((8, 8)), hot=np.ones((8, 8), dtype=bool))
    np.testing.assert_array_equal(expose(camera(hot_pixel_dark_current_e_per_s=1e12), 0.0, (8, 8), device, 0.0).dn, 0)


def test_crosstalk_moves_means_before_photo_response_and_leaves_counts_poisson_and_independent():
    light_e, response = np.zeros((512, 512)), np.ones((512, 512))
    light_e[::4, ::4] = 800.0
    response[1::4, ::4] = 0.5  # the pixels under the bright ones
    device = Device(response, np.zeros((512, 512)))
    electrons = expose(camera(bits=16, crosstalk=0.1), light_e, (512, 512), device).electrons
    for rows, columns, mean in ((0, 0, 480.0), (0, 1, 80.0), (3, 0, 80.0), (1, 0, 40.0)):
        here = electrons[rows::4, columns::4][1:-1, 1:-1]
        # eight comparisons within 4 standard errors: 5e-4
        assert abs(here.mean() - mean) < 4 * np.sqrt(mean / here.size)
        assert abs(here.var() - mean) < 4 * np.sqrt((2 * mean**2 + mean) / here.size)
    np.testing.assert_array_equal(electrons[2::4, 2::4], 0.0)
    giver, taker = electrons[::4, ::4].ravel(), electrons[::4, 1::4].ravel()
    assert abs(np.corrcoef(giver, taker)[0, 1]) < 4.5 / np.sqrt(giver.size)  # 7e-6


def test_fixed_patterns_are_read_exactly_and_stay_with_the_chip_over_exposures():
    terms = {"dsnu_e": 4.0, "column_gain_spread": 0.05, "column_offset_e": 4.0, "hot_pixel_share": 0.1}
    sensor = camera(bits=16, hot_pixel_dark_current_e_per_s=1e6, **terms)
    device = draw_device(sensor, (64, 64), rng(1))
    # hot pixels full, all others dark: no noise is left
    first, second = (expose(sensor, 0.0, device=device, seed=seed, exposure_s=1.0).dn for seed in (2, 3))
    np.testing.assert_array_equal(first, second)
    black = np.rint(device.dark_offset_e / sensor.gain_e_per_dn + sensor.black_dn)
    np.testing.assert_array_equal(first[~device.hot], np.clip(black, 0, None)[~device.hot])


def test_the_raw_image_s_calibration_holds_column_noise_too():
    raw = expose(camera(dsnu_e=3.0, column_offset_e=4.0, prnu=0.03, column_gain_spread=0.04), 10.0)
    assert (raw.dsnu_e, raw.prnu) == (pytest.approx(5.0), pytest.approx(0.05))


def test_full_pixels_of_weak_columns_count_as_saturated_too():
    sensor = camera(bits=16, read_noise_e=2.0, column_gain_spread=0.02)
    device = draw_device(sensor, (32, 512), rng(8))
    full = expose(sensor, 1e5, (32, 512), device)
    assert full.column_gain_spread == 0.02
    assert full.electrons.min() < 1000.0 - 40.0
    # a column under 4 standard deviations: 3.2e-5 of 512
    assert full.saturated.all()
    assert not expose(sensor, 700.0, (32, 512), device).saturated.any()


# Crosstalk: charge goes to the four neighbours, and none is lost.


def test_an_impulse_keeps_its_rest_and_gives_its_share_to_each_of_four_neighbours():
    light = np.zeros((5, 6))
    light[2, 3] = 100.0
    expected = np.zeros((5, 6))
    expected[2, 3] = 60.0
    expected[1, 3] = expected[3, 3] = expected[2, 2] = expected[2, 4] = 10.0
    np.testing.assert_allclose(spread_charge(light, 0.1), expected, rtol=1e-15)


def test_at_the_border_the_charge_that_has_no_neighbour_stays():
    light = np.zeros((3, 4))
    light[0, 0] = 100.0
    expected = np.zeros((3, 4))
    expected[0, 0] = 80.0
    expected[0, 1] = expected[1, 0] = 10.0
    np.testing.assert_allclose(spread_charge(light, 0.1), expected, rtol=1e-15)


@settings(deadline=None)
@given(st.integers(1, 9), st.integers(1, 9), st.floats(0.0, 0.25), st.integers(0, 2**32))
def test_the_total_is_kept_and_nothing_becomes_negative(height, width, crosstalk, seed):
    light = np.random.default_rng(seed).exponential(1e3, (height, width))
    spread = spread_charge(light, crosstalk)
    assert spread.shape == light.shape
    assert spread.min() >= 0
    assert spread.sum() == pytest.approx(light.sum(), rel=1e-13)


def test_zero_returns_the_frame_as_it_is_and_the_frame_is_not_written_to():
    light = np.random.default_rng(1).uniform(0, 9, (4, 4))
    before = light.copy()
    np.testing.assert_array_equal(spread_charge(light, 0.0), light)
    spread_charge(light, 0.2)
    np.testing.assert_array_equal(light, before)


# The noise variance against closed forms and against chips drawn and read out.


def deep_camera(**pixel):
    return camera(16, full_well_e=60_000.0, **pixel)


def variance(light_e, exposure_s=0.1, **pixel):
    sensor = deep_camera(**pixel)
    total = noise_variance(np.full((2, 2), light_e), sensor, exposure_s)[0, 0]
    assert sum(sigma**2 for sigma in noise_sources(light_e, sensor, exposure_s).values()) == pytest.approx(total, 1e-12)
    return total - sensor.gain_e_per_dn**2 / 12


@loop(
    ("pixel", "expected"),
    [
        ({}, 100.0),
        ({"read_noise_e": 3.0}, 109.0),
        ({"dsnu_e": 4.0}, 116.0),
        ({"column_offset_e": 5.0}, 125.0),
        ({"prnu": 0.02}, 100.0 + 4.0),
        ({"dark_current_e_per_s": 70.0}, 107.0),
        # 7 e- in a tenth of the pixels: Poisson of the mean, and the spread of the means
        ({"hot_pixel_share": 0.1, "hot_pixel_dark_current_e_per_s": 70.0}, 100.0 + 0.7 + 0.09 * 49),
        ({"column_gain_spread": 0.03}, 100.0 + 0.0009 * (100.0 + 100.0**2)),
        ({"crosstalk": 0.1}, 100.0),
        ({"hot_pixel_share": 0.1}, 100.0),
        ({"hot_pixel_dark_current_e_per_s": 70.0}, 100.0),
        (
            {"dark_current_e_per_s": 70.0, "column_gain_spread": 0.03}
            | {"hot_pixel_share": 0.1, "hot_pixel_dark_current_e_per_s": 50.0},
            107.5 + 0.09 * 25 + 0.0009 * (107.5 + 0.09 * 25 + 107.5**2),
        ),
    ],
)
def test_each_term_alone_in_closed_form(pixel, expected):
    assert variance(100.0, **pixel) == pytest.approx(expected, rel=1e-12)


def test_crosstalk_spreads_the_shot_noise_as_it_spreads_the_charge():
    light = np.zeros((5, 5))
    light[2, 2] = 100.0
    sensor = deep_camera(crosstalk=0.1)
    expected = spread_charge(light, 0.1) + sensor.gain_e_per_dn**2 / 12
    np.testing.assert_allclose(noise_variance(light, sensor, 0.1), expected, rtol=1e-14)
