"""Channels that are read apart: mean, variance, well and metering of each in closed form, and what is refused."""

from dataclasses import replace

import numpy as np
import pytest
from loop import loop
from refusal import refusal
from scipy import stats

from render.illuminants import illuminant
from sensor.burst import merged_raw, merged_sensor
from sensor.cfa import RGBW, mask
from sensor.chip import ChannelReading, Reading
from sensor.config import SensorConfig, with_channel_readings, with_readings
from sensor.config_file import read_sensor
from sensor.device import draw_device
from sensor.exposure import AUTO, AUTO_INFORMATION, AUTO_W, exposure_of_electrons_s
from sensor.photodiodes import binned
from sensor.presets import low_noise, preset, preset_file, vary
from sensor.raw import RawImage, noise_at_sites
from sensor.raw_files.raw_file import read_raw, write_raw
from sensor.readings.merge import as_metered, of_channel, under_well
from sensor.readout import noise_sources, noise_variance, read_out
from studies.photograph.camera import calibrate
from studies.photograph.snr import electrons_at_snr

SHAPE, TIME_S, GREEN_E = (64, 64), 0.02, 3000.0
WHITE_E = 3 * GREEN_E
BUSY = replace(low_noise().pixel, dark_current_e_per_s=2000.0, column_gain_spread=0.01, column_offset_e=2.0)
WAYS = (
    ChannelReading("W", time_share=0.25),
    ChannelReading("W", light_share=0.25, read_noise_e=20.0, dsnu_e=12.0),
    ChannelReading("W", full_well_e=60_000.0, read_noise_e=8.0, dsnu_e=4.0),
    ChannelReading("W", time_share=0.5, light_share=0.5),
)


def camera(*readings: ChannelReading, **pixel: float) -> SensorConfig:
    return with_channel_readings(replace(low_noise(), pixel=replace(BUSY, **pixel)), readings)


def scene(white_e: float = WHITE_E) -> np.ndarray:
    return np.where(mask(RGBW, "W", SHAPE), white_e, GREEN_E)


def shot(sensor: SensorConfig, expected_e: np.ndarray, seed: int) -> RawImage:
    chip, frame = np.random.default_rng([seed, 0]), np.random.default_rng([seed, 1])
    return read_out(expected_e, sensor, draw_device(sensor, SHAPE, chip), TIME_S, frame)


def own_variance(reading: ChannelReading, mean_e: float) -> float:
    """Variance of one sample over chips [e-^2], written out in electrons that the site holds, and brought to scale."""
    share = reading.time_share * reading.light_share
    well_e, read_e, dsnu_e = reading.full_well_e or 15_000, reading.read_noise_e or 1.5, reading.dsnu_e or 1
    light_e, dark_e = share * mean_e, 2000 * TIME_S * reading.time_share
    sigmas_e = 5 * np.hypot(read_e, np.hypot(dsnu_e, 2))
    black = np.ceil((2**14 - 1) * sigmas_e / (well_e + sigmas_e))
    gain_e = well_e / (2**14 - 1 - black)
    pixels = light_e + dark_e + (0.01 * light_e) ** 2
    columns = 0.01**2 * (pixels + (light_e + dark_e) ** 2)
    return float((pixels + columns + dsnu_e**2 + 2**2 + read_e**2 + gain_e**2 / 12) / share**2)


@loop("reading", WAYS)
def test_mean_and_variance_of_each_channel_are_the_closed_form(reading):
    """8 chips, 8192 samples of W: 1e-5 for each of 16 figures; what columns share is counted by columns."""
    sensor, chips = camera(reading), 8
    samples = np.stack([shot(sensor, scene(), seed).electrons for seed in range(chips)])
    for channel, light_e, apart in (("W", WHITE_E, reading), ("G", GREEN_E, ChannelReading("G"))):
        at = mask(RGBW, channel, SHAPE)
        variance = own_variance(apart, light_e)
        assert noise_variance(scene(), sensor, TIME_S)[at] == pytest.approx(variance, rel=1e-9)
        assert noise_variance(np.array([light_e]), sensor, TIME_S, channel) == pytest.approx(variance, rel=1e-9)
        assert np.hypot.reduce(list(noise_sources(light_e, sensor, TIME_S, channel).values())) ** 2 == pytest.approx(
            variance, rel=1e-9
        )
        values = samples[:, at]
        columns = chips * 32
        common = 0.01**2 * light_e**2 + (2 / apart.share) ** 2
        mean_error = np.sqrt(variance / values.size + common / columns)
        assert abs(values.mean() - light_e) < stats.norm.isf(5e-6) * mean_error, channel
        spread = variance * np.sqrt(2 / values.size) + common * np.sqrt(2 / columns)
        assert abs(values.var() - variance) < stats.norm.isf(5e-6) * spread, channel


@loop("reading", WAYS)
def test_dark_frames_of_each_channel_have_its_read_noise_and_dsnu(reading):
    """8 chips: 1e-5 for each of 8 figures."""
    sensor = camera(reading, dark_current_e_per_s=0.0, column_gain_spread=0.0, column_offset_e=0.0)
    dark = np.stack([shot(sensor, np.zeros(SHAPE), seed).electrons for seed in range(8)])
    for channel, apart in (("W", reading), ("G", ChannelReading("G"))):
        read_e, dsnu_e = apart.read_noise_e or 1.5, apart.dsnu_e or 1.0
        alone = of_channel(sensor, channel)[0]
        variance = (read_e**2 + dsnu_e**2 + alone.gain_e_per_dn**2 / 12) / apart.share**2
        values = dark[:, mask(RGBW, channel, SHAPE)]
        assert values.var() == pytest.approx(variance, rel=stats.norm.isf(5e-6) * np.sqrt(2 / values.size)), channel


@loop("reading", WAYS)
def test_a_channel_is_full_where_its_own_well_is_and_the_others_where_theirs(reading):
    sensor = camera(reading, dark_current_e_per_s=0.0, column_gain_spread=0.0)
    full_e = (reading.full_well_e or 15_000) / (reading.time_share * reading.light_share)
    raw = shot(sensor, scene(1.2 * full_e), 1)
    white = mask(RGBW, "W", SHAPE)
    np.testing.assert_array_equal(raw.saturated, white)
    assert raw.noise_of("W").full_well_e == pytest.approx(full_e) == np.float64(sensor.metered_well_e("W"))
    assert np.median(raw.electrons[white]) == pytest.approx(full_e, rel=1e-3)
    assert not shot(sensor, scene(0.8 * full_e), 1).saturated.any()
    green = shot(sensor, np.where(white, 10.0, 20_000.0), 1)
    np.testing.assert_array_equal(green.saturated, ~white)


@loop("reading", WAYS)
def test_dark_current_takes_its_part_of_each_channel_s_well(reading):
    sensor = camera(reading)
    well_e, dark_e = reading.full_well_e or 15_000, 2000 * TIME_S * reading.time_share
    full_e = np.array([15_000 - 2000 * TIME_S, (well_e - dark_e) / (reading.time_share * reading.light_share)])
    for channel, white in (("G", 0), ("W", 1)):
        at = mask(RGBW, channel, SHAPE)
        for part in (0.999, 1.001):
            light = np.full(SHAPE, part * full_e[white])
            assert (under_well(light, sensor, TIME_S)[at] == (part < 1)).all()
            assert (under_well(light[at], sensor, TIME_S, channel) == (part < 1)).all()


def test_the_other_channels_draw_what_they_draw_where_nothing_is_apart():
    apart, plain = (shot(camera(*readings), scene(), 5) for readings in (WAYS[:1], ()))
    others = ~mask(RGBW, "W", SHAPE)
    np.testing.assert_array_equal(apart.dn[others], plain.dn[others])
    assert (apart.black_dn, apart.white_dn, apart.gain_e_per_dn) == (
        plain.black_dn,
        plain.white_dn,
        plain.gain_e_per_dn,
    )
    assert apart.dark_noise_e == pytest.approx(plain.dark_noise_e, rel=1e-12)  # floats: the rounding is in read noise


def test_charge_moves_behind_the_density_as_it_comes():
    """A fifth of W's light stays in front: G gains by what is left, and W's own sample holds more of G's."""
    pixel = {"crosstalk": 0.05, "dark_current_e_per_s": 0.0}
    sensor = camera(ChannelReading("W", light_share=0.2), **pixel)
    means = np.mean([shot(sensor, scene(), seed).electrons for seed in range(4)], axis=0)
    lit = scene() * np.where(mask(RGBW, "W", SHAPE), 0.2, 1.0)
    around = np.pad(lit, 1, mode="edge")
    moved = 0.8 * lit + 0.05 * (around[:-2, 1:-1] + around[2:, 1:-1] + around[1:-1, :-2] + around[1:-1, 2:])
    for channel, share in (("W", 0.2), ("G", 1.0), ("R", 1.0)):
        at = mask(RGBW, channel, SHAPE)
        error = np.sqrt(
            own_variance(ChannelReading(channel, light_share=share), WHITE_E) / at.sum() + (0.01 * WHITE_E) ** 2 / 128
        )
        assert abs(means[at].mean() - moved[at].mean() / share) < 4.5 * error, channel


def test_a_metered_channel_takes_the_time_that_holds_its_bright_end():
    sensor = camera(ChannelReading("W", metered=True))
    for white_e, time_share in (
        (9_000.0, 1.0),
        (12_000.0, 1.0),
        (12_040.0, 2 ** (-1 / 16)),  # of light alone 12 000
        (24_000.0, 0.5),
        (48_000.0, 0.25),
        (30_000.0, 2 ** (-22 / 16)),
    ):
        light = scene(white_e - 2000 * TIME_S)  # the rest is dark current
        reading = as_metered(sensor, light, TIME_S).chip.channels[0]
        assert reading.time_share == pytest.approx(time_share, rel=1e-12), white_e
        assert reading.time_share * white_e <= 0.8 * 15_000
        raw = shot(sensor, light, 2)
        assert raw.noise_of("W").shot == pytest.approx(1 / time_share)
        assert raw.exposure_s == TIME_S
        assert not raw.saturated.any()
    least = camera(ChannelReading("W", metered=True, time_share=0.125))
    assert as_metered(least, scene(10.0), TIME_S).chip.channels[0].time_share == 0.125


def test_rules_of_exposure_look_at_each_channel_s_own_well():
    light = np.broadcast_to(np.array([400.0, 1000.0, 500.0, 3000.0]), (*SHAPE, 4))  # electrons a second
    times = {
        None: (12.0, 4.0),
        ChannelReading("W", time_share=0.25): (12.0, 16.0),
        ChannelReading("W", light_share=0.5, full_well_e=30_000.0): (12.0, 16.0),
        ChannelReading("W", metered=True): (12.0, 4.0),
        ChannelReading("G", time_share=0.5): (24.0, 4.0),
    }
    for reading, (for_green_s, for_white_s) in times.items():
        sensor = low_noise() if reading is None else with_channel_readings(low_noise(), [reading])
        assert exposure_of_electrons_s(AUTO, light, sensor, 1e3) == pytest.approx(for_green_s), reading
        assert exposure_of_electrons_s(AUTO_W, light, sensor, 1e3) == pytest.approx(for_white_s), reading
    # Metered, W is never full: the longer time for green tells more, which a W without room for it does not allow.
    assert exposure_of_electrons_s(AUTO_INFORMATION, light, preset("white_apart"), 1e3) == pytest.approx(12.0)
    assert exposure_of_electrons_s(AUTO_INFORMATION, light, low_noise(), 1e3) == pytest.approx(4.0)


def test_light_for_an_snr_is_that_of_the_site_over_its_share():
    for reading in WAYS:
        sensor = camera(reading, column_gain_spread=0.0)
        electrons = electrons_at_snr(10.0, sensor, TIME_S, "W")
        variance = noise_variance(np.array([electrons]), sensor, TIME_S, "W")
        assert electrons / np.sqrt(variance) == pytest.approx(10.0, rel=1e-6), reading


def test_a_burst_keeps_each_channel_s_noise_and_well():
    """Four frames of one chip: the rate of four times the time, half the relative temporal noise."""
    sensor = camera(WAYS[0], prnu=0.0, column_gain_spread=0.0, column_offset_e=0.0)
    device, rng = draw_device(sensor, SHAPE, np.random.default_rng(1)), np.random.default_rng(2)
    frames = [read_out(scene(), sensor, device, TIME_S, rng) for _ in range(4)]
    merged = merged_raw(frames)
    white = mask(RGBW, "W", SHAPE)
    expected = noise_variance(4 * scene(), merged_sensor(sensor, 4), 4 * TIME_S)
    told = noise_at_sites(merged, 4 * scene())
    for at in (white, mask(RGBW, "G", SHAPE)):
        assert told[at].mean() == pytest.approx(expected[at].mean(), rel=1e-3)
        assert merged.electrons[at].var() == pytest.approx(expected[at].mean(), rel=5 * np.sqrt(2 / at.sum()))
    dark_e = 2000 * TIME_S  # on the scale of the whole time
    assert merged.noise_of("W").full_well_e == pytest.approx(4 * (60_000 - dark_e), rel=1e-12)
    assert not merged.saturated.any()
    columns = camera(WAYS[0], prnu=0.0)
    told = noise_at_sites(merged_raw([shot(columns, scene(), 1)] * 4), 4 * scene())
    np.testing.assert_allclose(told, noise_variance(4 * scene(), merged_sensor(columns, 4), 4 * TIME_S), rtol=1e-3)


def test_raw_files_give_every_channel_s_noise_back(tmp_path):
    for number, reading in enumerate(WAYS):
        sensor = camera(reading)
        raw = replace(shot(sensor, scene(), 1), colour=calibrate(sensor, illuminant("D65")))
        for name in ("a.dng", "a.tif"):
            back = read_raw(write_raw(raw, tmp_path / f"{number}{name}")[0])
            np.testing.assert_array_equal(back.dn, raw.dn)
            assert back.channel_noise == raw.channel_noise
            assert (back.read_noise_e, back.dark_current_e) == (raw.read_noise_e, raw.dark_current_e)


def test_another_mosaic_drops_the_channel_that_it_lacks(tmp_path):
    assert vary(preset("white_apart"), "bayer").chip.channels == ()
    assert preset("white_apart", "bayer") == preset("low_noise", "bayer")
    assert vary(preset("white_apart"), "rgbw_nd").chip.channels == preset("white_apart").chip.channels


@loop(
    ("lines", "parts"),
    [
        ('channel = "X"\n', ("channels: channel: 'X' is unknown", "B, G, R, W")),
        ('channel = "W"\ntime_share = 1.5\n', ("channel 'W': time_share: 1.5 is outside", "share of the exposure")),
        ('channel = "W"\nlight_share = 0.0\n', ("channel 'W': light_share: 0.0 is outside",)),
        ('channel = "W"\nfull_well_e = 0\n', ("full_well_e: 0", "give electrons")),
        ('channel = "W"\nmetered = 1\n', ("metered", "true or false")),
        ("time_share = 0.5\n", ("channel is missing",)),
        ('channel = "W"\ntimeshare = 0.5\n', ("did you mean 'time_share'?",)),
        ('channel = "W"\n[[channels]]\nchannel = "W"\n', ("channels: ['W', 'W']", "each once")),
    ],
)
def test_channels_that_no_camera_has_are_refused(lines, parts, tmp_path):
    path = tmp_path / "camera.toml"
    path.write_text(preset_file("low_noise").read_text("utf-8") + "[[channels]]\n" + lines, encoding="utf-8")
    refusal(read_sensor, path, words=parts)


def test_binning_and_several_readings_are_refused_beside_channels():
    reading, two = WAYS[0], (Reading(1.5, 1.0, 1e4), Reading(3.0, 1.0, 1.5e4))
    refusal(with_readings, camera(reading), two, match="channels: .'W'. with several readings; allowed: one of the two")
    quad = with_channel_readings(low_noise("quad_rgbw"), [reading])
    refusal(binned, quad, "charge", match="channels: .'W'. with binning; allowed: one of the two")
    refusal(noise_sources, 100.0, camera(reading), TIME_S, match="channel: none given for a camera that reads")
