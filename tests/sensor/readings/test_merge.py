"""Readings as they are drawn and merged: unbiased, at the noise of the closed form, without a step at a seam."""

from dataclasses import replace

import numpy as np
import pytest
from loop import loop
from refusal import refusal
from scipy import stats

from render.illuminants import illuminant
from sensor.burst import merge_frames, merged_raw, merged_sensor
from sensor.capture import expose
from sensor.cfa import RGBW, mask
from sensor.config import SensorConfig, with_channel_readings, with_readings
from sensor.config_file import read_sensor
from sensor.device import draw_device
from sensor.exposure import AUTO, AUTO_INFORMATION, AUTO_W, exposure_of_electrons_s
from sensor.kernel.kernel import read_frame
from sensor.photodiodes import binned
from sensor.pixel import ChannelReading, Reading
from sensor.presets import low_noise, preset, preset_file, vary
from sensor.random import poisson
from sensor.raw import RawImage, noise_at_sites
from sensor.raw_files.raw_file import read_raw, write_raw
from sensor.readings.best_estimate import collected_share, covariances, seams, shares
from sensor.readings.resolve import at_channel, chip_readings, resolve, unsaturated
from sensor.readout import draw_frame, noise_sources, noise_variance, read_out
from studies.photograph.camera import calibrate
from studies.photograph.snr import electrons_at_snr

HDR = ("dual_gain", "split_pixel", "staggered")
SHAPE, TIME_S = (256, 256), 0.01
EXACT = pytest.mark.parametrize("exact", [False, True], ids=["engine", "exact"])


def levels_of(sensor):
    """Light over six decades, and each seam in steps of a third of its noise."""
    at = seams(chip_readings(sensor, TIME_S)).handover_e
    fine = [
        e + step * np.sqrt(noise_variance(np.array([e]), sensor, TIME_S)[0])
        for e in at[:-1]
        for step in np.arange(-8, 9) / 3
    ]
    return np.array([*np.geomspace(0.1, 0.9 * at[-1], 17), *fine])


@pytest.mark.thorough
@EXACT
@pytest.mark.parametrize("name", HDR)
def test_the_merge_has_the_mean_of_the_light_and_the_noise_of_the_closed_form(name, exact):
    sensor = preset(name)
    whole = collected_share(chip_readings(sensor, TIME_S))
    chips, rng = np.random.default_rng(11), np.random.default_rng(12)
    levels = levels_of(sensor)[:: 3 if exact else 1]
    for light in levels:
        device = draw_device(sensor, SHAPE, chips)  # a chip each: PRNU is drawn anew
        merged = expose(np.full(SHAPE, light), sensor, TIME_S, device, rng, exact=exact).electrons / whole
        variance = float(noise_variance(np.array([light]), sensor, TIME_S)[0])
        # 4 standard errors at some 160 lights: a false alarm in 1 of 100 runs, and the seeds are fixed
        assert abs(merged.mean() - light) < 4 * np.sqrt(variance / merged.size), light
        # 256 x 256 samples know a variance to 0.024 dB; 0.15 dB is six times that
        assert abs(10 * np.log10(merged.var() / variance)) < 0.15, light


@loop("name", HDR)
def test_a_merged_frame_without_light_has_no_mean_and_the_noise_that_it_states(name):
    """Mean and variance of 128 x 128 samples within 4 standard errors: 1e-4 a figure."""
    sensor, shape = preset(name), (128, 128)
    sensor = replace(sensor, pixel=replace(sensor.pixel, dark_current_e_per_s=100.0, prnu=0.0))
    device = draw_device(sensor, shape, np.random.default_rng(3))
    raw = expose(np.zeros(shape), sensor, 0.1, device, np.random.default_rng(4))
    assert abs(raw.electrons.mean()) < 4 * raw.dark_noise_e / np.sqrt(raw.dn.size)
    assert raw.electrons.var() == pytest.approx(raw.dark_noise_e**2, rel=4 * np.sqrt(2 / raw.dn.size))


@loop("name", ["low_noise", "white_apart", *HDR])
def test_a_raw_image_states_what_columns_gains_make_of_light_and_dark_current_together(name):
    """2 s^2 light dark current: 40 % of the variance of a single reading. Charges share it as `noise_variance` says."""
    sensor = preset(name)
    sensor = replace(sensor, pixel=replace(sensor.pixel, prnu=0.0, column_gain_spread=0.03, dark_current_e_per_s=1e4))
    light, device = np.full((8, 8), 1000.0), draw_device(sensor, (8, 8), np.random.default_rng(3))
    raw = expose(light, sensor, 0.1, device, np.random.default_rng(4))
    whole = collected_share(chip_readings(sensor, 0.1)) if name in HDR else 1.0
    stated = noise_at_sites(raw, whole * light) / whole**2
    np.testing.assert_allclose(stated, noise_variance(light, sensor, 0.1), rtol=0.01)


@loop("share", [0.9, 1.05, 1.3])
@loop("name", HDR)
def test_a_reading_that_dark_current_fills_is_left_out(name, share):
    """At three lights: mean, and variance by the raw image, within 4 standard errors and a tenth, 1e-4 a figure."""
    sensor, shape = preset(name), (128, 128)
    well_e = min(reading.full_well_e / reading.share for reading in sensor.chip.readings)
    sensor = replace(sensor, pixel=replace(sensor.pixel, dark_current_e_per_s=share * well_e / 0.1, prnu=0.0))
    device, whole = draw_device(sensor, shape, np.random.default_rng(3)), collected_share(chip_readings(sensor, 0.1))
    for light in (0.0, 0.01 * sensor.pixel.full_well_e, 0.2 * sensor.pixel.full_well_e):
        raw = expose(np.full(shape, light), sensor, 0.1, device, np.random.default_rng(4))
        stated = noise_at_sites(raw, np.full(shape, whole * light)).mean()
        assert abs(raw.electrons.mean() - whole * light) < 4 * np.sqrt(stated / raw.dn.size), light
        assert raw.electrons.var() == pytest.approx(stated, rel=0.1 + 4 * np.sqrt(2 / raw.dn.size)), light


@loop("light", [3.0, 900.0])  # read noise that were shared would show in the dark
@loop("draw", [draw_frame, read_frame])
@loop("name", HDR)
def test_readings_covary_as_their_charges_and_photodiodes_say(name, draw, light):
    sensor = preset(name)
    chips, rng = np.random.default_rng(3), np.random.default_rng(4)
    device = draw_device(sensor, SHAPE, chips)
    keys = {}
    samples = []
    readings = chip_readings(sensor, TIME_S)
    for number, reading in enumerate(readings):
        own = reading.sensor
        key = keys.setdefault(reading.charge, int(rng.integers(2**63)))
        dn = draw(np.full(SHAPE, light * reading.share), own, device.readings[number], TIME_S, key, number)
        samples.append((dn.astype(float) - own.black_dn).ravel() * own.gain_e_per_dn / reading.share)
    found = np.cov(samples)
    meant = sum(covariances(np.array([light]), readings).values())[0]
    # standard error of a covariance of Gaussians; 4 of them in at most 9 entries: 6e-4
    error = np.sqrt((np.outer(np.diag(meant), np.diag(meant)) + meant**2) / samples[0].size)
    assert (np.abs(found - meant) < 4 * error).all(), (found, meant)


def test_a_frame_depends_on_its_key_alone_and_both_engines_agree_in_the_mean():
    sensor = preset("split_pixel")
    device = draw_device(sensor, SHAPE, np.random.default_rng(1))
    light = np.linspace(0, 60_000, SHAPE[0] * SHAPE[1]).reshape(SHAPE)
    for exact in (False, True):
        one, other = (expose(light, sensor, TIME_S, device, np.random.default_rng(5), exact=exact) for _ in range(2))
        np.testing.assert_array_equal(one.dn, other.dn)
        assert one.dn.dtype == np.float32


def test_two_readings_of_one_charge_see_the_same_electrons_beside_a_lamp():
    """A lamp over every well stands in each row: of one key, what both wells hold is the same number beyond it."""
    sensor = preset("dual_gain")
    sensor = replace(sensor, pixel=replace(sensor.pixel, prnu=0.0, dark_current_e_per_s=0.0))
    light = np.full((64, 64), 300.0)
    light[:, ::8] = np.geomspace(1e3, 1e9, 8)
    chip, seen = draw_device(sensor, light.shape, np.random.default_rng(1)), []

    def drawn(key, term, mean_e):
        seen.append(poisson(key, term, mean_e))
        return seen[-1]

    for number in range(2):
        draw_frame(light, chip_readings(sensor, 0.01)[number].sensor, chip.readings[number], 0.01, 7, number, drawn)
    assert np.array_equal(*seen)


def test_what_fills_the_last_reading_reads_the_top_and_counts_as_saturated():
    sensor = preset("split_pixel")
    device = draw_device(sensor, (64, 64), np.random.default_rng(1))
    well_e = sensor.pixel.full_well_e
    full = expose(np.full((64, 64), 1.5 * well_e), sensor, TIME_S, device, np.random.default_rng(2))
    assert (full.dn == full.white_dn).all()
    assert full.saturated.all()
    assert full.full_well_e == pytest.approx(well_e - sensor.pixel.dark_current_e_per_s * TIME_S, rel=1e-9)
    under = expose(np.full((64, 64), 0.8 * well_e), sensor, TIME_S, device, np.random.default_rng(2))
    assert not under.saturated.any()


def test_a_camera_that_switches_gives_one_gain_s_frame():
    sensor = preset("dual_gain")
    sensor = replace(sensor, chip=replace(sensor.chip, readout="switched"))
    device = draw_device(sensor, (32, 32), np.random.default_rng(1))
    for light, index in ((100.0, 0), (5000.0, 1)):
        own = chip_readings(sensor, TIME_S)[index].sensor
        raw = expose(np.full((32, 32), light), sensor, TIME_S, device, np.random.default_rng(2), exact=True)
        dark_e = own.pixel.dark_current_e_per_s * TIME_S
        assert raw.read_noise_e == pytest.approx(np.hypot(own.pixel.read_noise_e, np.sqrt(dark_e)), rel=1e-12)
        assert raw.gain_e_per_dn == own.gain_e_per_dn
        assert raw.dn.dtype == np.uint16
        assert raw.noise_steps == ()
        assert raw.electrons.mean() == pytest.approx(light, rel=0.02)


def test_a_burst_is_merged_as_frames_of_one_reading_are():
    for name in HDR:
        sensor = preset(name)
        device, rng = draw_device(sensor, SHAPE, np.random.default_rng(1)), np.random.default_rng(2)
        frames = [expose(np.full(SHAPE, 3000.0), sensor, TIME_S, device, rng) for _ in range(4)]
        merged = merged_raw(frames)
        assert merged.electrons.mean() == pytest.approx(sum(frame.electrons.mean() for frame in frames), rel=1e-6)
        assert merged.exposure_s == pytest.approx(4 * collected_share(chip_readings(sensor, TIME_S)) * TIME_S)
        assert [step.from_e for step in merged.noise_steps] == [4 * step.from_e for step in frames[0].noise_steps]
        refusal(merged_raw, [frames[0], replace(frames[1], exposure_s=1.0)], match="each of several readings")


@loop("ending", [".dng", ".tif"])
@loop("name", HDR)
def test_a_raw_file_holds_merged_samples_and_their_noise_bit_for_bit(name, ending, tmp_path):
    sensor = preset(name, "bayer")
    device = draw_device(sensor, (32, 40), np.random.default_rng(1))
    light = np.geomspace(0.1, 2 * sensor.pixel.full_well_e, 32 * 40).reshape(32, 40)
    raw = expose(light, sensor, TIME_S, device, np.random.default_rng(2))
    raw = replace(raw, colour=calibrate(sensor, illuminant("D65")))
    back = read_raw(write_raw(raw, tmp_path / f"shot{ending}")[0])
    np.testing.assert_array_equal(back.dn, raw.dn)
    assert back.dn.dtype == np.float32
    assert back.noise_steps == raw.noise_steps
    assert len(raw.noise_steps) == len(sensor.chip.readings) - 1
    np.testing.assert_array_equal(back.saturated, raw.saturated)


def test_a_chip_of_other_patterns_has_shares_of_dark_current_and_hot_pixels():
    own = preset("staggered")
    sensor = replace(own, pixel=replace(own.pixel, hot_pixel_share=0.02, hot_pixel_dark_current_e_per_s=1e5))
    device = draw_device(sensor, SHAPE, np.random.default_rng(1))
    raw = expose(np.zeros(SHAPE), sensor, TIME_S, device, np.random.default_rng(2), exact=True)
    hot = np.zeros(SHAPE, bool)
    hot[tuple(raw.defects.T)] = True
    np.testing.assert_array_equal(hot, device.hot)
    assert raw.electrons[hot].mean() / collected_share(chip_readings(sensor, TIME_S)) == pytest.approx(1000.0, rel=0.01)
    assert shares(chip_readings(sensor, TIME_S)).tolist() == [1.0, 0.0625]


@loop("name", ["low_noise", *HDR, "white_apart"])
def test_a_burst_has_the_variance_of_the_raw_image_that_is_made_of_it(name):
    """Light from the dark to the well, over every seam; columns' gains act on dark current too."""
    sensor = preset(name)
    busy = replace(sensor.pixel, column_gain_spread=0.01, dark_current_e_per_s=2000.0)
    sensor = replace(sensor, pixel=busy)
    light = np.tile(np.geomspace(1.0, 0.8 * sensor.pixel.full_well_e, 128), (16, 1))
    device, rng = draw_device(sensor, light.shape, np.random.default_rng(1)), np.random.default_rng(2)
    frames = [expose(light, sensor, TIME_S, device, rng) for _ in range(4)]
    merged, raw = merge_frames(frames), merged_raw(frames)
    stated = (merged.temporal_variance + merged.fixed_variance) * raw.exposure_s**2
    at = ~raw.saturated & (raw.electrons > 0)
    assert at.mean() > 0.9
    np.testing.assert_allclose(stated[at], noise_at_sites(raw, raw.electrons)[at], rtol=1e-9)


# Channels that are read apart: mean, variance, well and metering of each in closed form, and what is refused.


FRAME, EXPOSURE_S, GREEN_E = (64, 64), 0.02, 3000.0
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
    return np.where(mask(RGBW, "W", FRAME), white_e, GREEN_E)


def shot(sensor: SensorConfig, expected_e: np.ndarray, seed: int) -> RawImage:
    chip, frame = np.random.default_rng([seed, 0]), np.random.default_rng([seed, 1])
    return read_out(expected_e, sensor, draw_device(sensor, FRAME, chip), EXPOSURE_S, frame)


def own_variance(reading: ChannelReading, mean_e: float) -> float:
    """Variance of one sample over chips [e-^2], written out in electrons that the site holds, and brought to scale."""
    share = reading.time_share * reading.light_share
    well_e, read_e, dsnu_e = reading.full_well_e or 15_000, reading.read_noise_e or 1.5, reading.dsnu_e or 1
    light_e, dark_e = share * mean_e, 2000 * EXPOSURE_S * reading.time_share
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
        at = mask(RGBW, channel, FRAME)
        variance = own_variance(apart, light_e)
        assert noise_variance(scene(), sensor, EXPOSURE_S)[at] == pytest.approx(variance, rel=1e-9)
        assert noise_variance(np.array([light_e]), sensor, EXPOSURE_S, channel) == pytest.approx(variance, rel=1e-9)
        assert np.hypot.reduce(
            list(noise_sources(light_e, sensor, EXPOSURE_S, channel).values())
        ) ** 2 == pytest.approx(variance, rel=1e-9)
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
    dark = np.stack([shot(sensor, np.zeros(FRAME), seed).electrons for seed in range(8)])
    for channel, apart in (("W", reading), ("G", ChannelReading("G"))):
        read_e, dsnu_e = apart.read_noise_e or 1.5, apart.dsnu_e or 1.0
        alone = at_channel(chip_readings(sensor, EXPOSURE_S), channel)[0].sensor
        variance = (read_e**2 + dsnu_e**2 + alone.gain_e_per_dn**2 / 12) / apart.share**2
        values = dark[:, mask(RGBW, channel, FRAME)]
        assert values.var() == pytest.approx(variance, rel=stats.norm.isf(5e-6) * np.sqrt(2 / values.size)), channel


@loop("reading", WAYS)
def test_a_channel_is_full_where_its_own_well_is_and_the_others_where_theirs(reading):
    sensor = camera(reading, dark_current_e_per_s=0.0, column_gain_spread=0.0)
    full_e = (reading.full_well_e or 15_000) / (reading.time_share * reading.light_share)
    raw = shot(sensor, scene(1.2 * full_e), 1)
    white = mask(RGBW, "W", FRAME)
    np.testing.assert_array_equal(raw.saturated, white)
    assert raw.noise_of("W").full_well_e == pytest.approx(full_e) == np.float64(sensor.metered_well_e("W"))
    assert np.median(raw.electrons[white]) == pytest.approx(full_e, rel=1e-3)
    assert not shot(sensor, scene(0.8 * full_e), 1).saturated.any()
    green = shot(sensor, np.where(white, 10.0, 20_000.0), 1)
    np.testing.assert_array_equal(green.saturated, ~white)


@loop("reading", WAYS)
def test_dark_current_takes_its_part_of_each_channel_s_well(reading):
    sensor = camera(reading)
    well_e, dark_e = reading.full_well_e or 15_000, 2000 * EXPOSURE_S * reading.time_share
    full_e = np.array([15_000 - 2000 * EXPOSURE_S, (well_e - dark_e) / (reading.time_share * reading.light_share)])
    for channel, white in (("G", 0), ("W", 1)):
        at = mask(RGBW, channel, FRAME)
        for part in (0.999, 1.001):
            light = np.full(FRAME, part * full_e[white])
            assert (unsaturated(light, resolve(sensor, light, EXPOSURE_S))[at] == (part < 1)).all()
            assert (unsaturated(light[at], resolve(sensor, light[at], EXPOSURE_S, channel)) == (part < 1)).all()


def test_the_other_channels_draw_what_they_draw_where_nothing_is_apart():
    apart, plain = (shot(camera(*readings), scene(), 5) for readings in (WAYS[:1], ()))
    others = ~mask(RGBW, "W", FRAME)
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
    lit = scene() * np.where(mask(RGBW, "W", FRAME), 0.2, 1.0)
    around = np.pad(lit, 1, mode="edge")
    moved = 0.8 * lit + 0.05 * (around[:-2, 1:-1] + around[2:, 1:-1] + around[1:-1, :-2] + around[1:-1, 2:])
    for channel, share in (("W", 0.2), ("G", 1.0), ("R", 1.0)):
        at = mask(RGBW, channel, FRAME)
        error = np.sqrt(
            own_variance(ChannelReading(channel, light_share=share), WHITE_E) / at.sum() + (0.01 * WHITE_E) ** 2 / 128
        )
        assert abs(means[at].mean() - moved[at].mean() / share) < 4.5 * error, channel


def test_metered_exposure_keeps_highlights_below_saturation():
    sensor = camera(ChannelReading("W", metered=True))
    for white_e, time_share in (
        (9_000.0, 1.0),
        (12_000.0, 1.0),
        (12_040.0, 2 ** (-1 / 16)),  # of light alone 12 000
        (24_000.0, 0.5),
        (48_000.0, 0.25),
        (30_000.0, 2 ** (-22 / 16)),
    ):
        light = scene(white_e - 2000 * EXPOSURE_S)  # the rest is dark current
        reading = resolve(sensor, light, EXPOSURE_S)[1]
        assert reading.time_share == pytest.approx(time_share, rel=1e-12), white_e
        assert reading.time_share * white_e <= 0.8 * 15_000
        raw = shot(sensor, light, 2)
        both = 2 * raw.column_gain_spread**2 * raw.noise_of("W").dark_current_e
        assert raw.noise_of("W").shot - both == pytest.approx(1 / time_share)
        assert raw.exposure_s == EXPOSURE_S
        assert not raw.saturated.any()
    least = camera(ChannelReading("W", metered=True, time_share=0.125))
    assert resolve(least, scene(10.0), EXPOSURE_S)[1].time_share == 0.125


def test_rules_of_exposure_look_at_each_channel_s_own_well():
    light = np.broadcast_to(np.array([400.0, 1000.0, 500.0, 3000.0]), (*FRAME, 4))  # electrons a second
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
    # Metered, W is never full: the time is green's, which a W without room for it does not allow.
    assert 10.0 < exposure_of_electrons_s(AUTO_INFORMATION, light, preset("white_apart"), 1e3) < 15.0
    assert 3.0 < exposure_of_electrons_s(AUTO_INFORMATION, light, low_noise(), 1e3) < 5.0


def test_light_for_an_snr_is_that_of_the_site_over_its_share():
    for reading in WAYS:
        sensor = camera(reading, column_gain_spread=0.0)
        electrons = electrons_at_snr(10.0, sensor, EXPOSURE_S, "W")
        variance = noise_variance(np.array([electrons]), sensor, EXPOSURE_S, "W")
        assert electrons / np.sqrt(variance) == pytest.approx(10.0, rel=1e-6), reading


def test_a_burst_keeps_each_channel_s_noise_and_well():
    """Four frames of one chip: the rate of four times the time, half the relative temporal noise."""
    sensor = camera(WAYS[0], prnu=0.0, column_gain_spread=0.0, column_offset_e=0.0)
    device, rng = draw_device(sensor, FRAME, np.random.default_rng(1)), np.random.default_rng(2)
    frames = [read_out(scene(), sensor, device, EXPOSURE_S, rng) for _ in range(4)]
    merged = merged_raw(frames)
    white = mask(RGBW, "W", FRAME)
    expected = noise_variance(4 * scene(), merged_sensor(sensor, 4), 4 * EXPOSURE_S)
    told = noise_at_sites(merged, 4 * scene())
    for at in (white, mask(RGBW, "G", FRAME)):
        assert told[at].mean() == pytest.approx(expected[at].mean(), rel=1e-3)
        assert merged.electrons[at].var() == pytest.approx(expected[at].mean(), rel=5 * np.sqrt(2 / at.sum()))
    dark_e = 2000 * EXPOSURE_S  # on the scale of the whole time
    assert merged.noise_of("W").full_well_e == pytest.approx(4 * (60_000 - dark_e), rel=1e-12)
    assert not merged.saturated.any()
    columns = camera(WAYS[0], prnu=0.0)
    told = noise_at_sites(merged_raw([shot(columns, scene(), 1)] * 4), 4 * scene())
    np.testing.assert_allclose(told, noise_variance(4 * scene(), merged_sensor(columns, 4), 4 * EXPOSURE_S), rtol=1e-3)


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
    refusal(noise_sources, 100.0, camera(reading), EXPOSURE_S, match="channel: none given for a camera that reads")


@pytest.mark.parametrize("light_share", [1.0, 0.25])
def test_a_metered_channels_time_counts_what_its_density_lets_through(light_share):
    """White of 80 000 e- in the whole time: the share of it that puts them at 80 % of 15 000, in 16ths of an octave."""
    sensor = with_channel_readings(low_noise(), [ChannelReading("W", metered=True, light_share=light_share)])
    white = np.full((8, 8), 80_000.0)
    (reading,) = resolve(sensor, white, 1.0, "W")
    held = 80_000.0 * light_share * reading.time_share
    assert 0.8 * 15_000 * 2 ** (-1 / 16) < held <= 0.8 * 15_000 * (1 + 1e-9)


def test_a_metered_channel_is_open_for_a_millionth_of_the_time_at_least():
    """White of 12 000 e- in 2e-5, 1e-6 and 1e-8 of the time, down to a sixteenth of an octave."""
    sensor = with_channel_readings(low_noise(), [ChannelReading("W", metered=True)])
    for share, wanted in ((2e-5, 2 ** (np.floor(16 * np.log2(2e-5)) / 16)), (1e-6, 1e-6), (1e-8, 1e-6)):
        (reading,) = resolve(sensor, np.full((8, 8), 12_000.0 / share), 1.0, "W")
        assert reading.time_share == pytest.approx(wanted, rel=1e-9)


@pytest.mark.parametrize("exposure_s", [0.25, 4.0])
def test_a_metered_channels_time_leaves_room_for_the_dark_current_of_the_whole_time(exposure_s):
    """White of 80 000 e- and 10 000 e- of dark current a second: both are in the well until the channel closes."""
    sensor = with_channel_readings(low_noise(), [ChannelReading("W", metered=True)])
    sensor = replace(sensor, pixel=replace(sensor.pixel, dark_current_e_per_s=10_000.0))
    (reading,) = resolve(sensor, np.full((8, 8), 80_000.0), exposure_s, "W")
    collected = (80_000.0 + 10_000.0 * exposure_s) * reading.time_share
    assert 0.8 * 15_000 * 2 ** (-1 / 16) < collected <= 0.8 * 15_000 * (1 + 1e-9)


@pytest.mark.parametrize("gain", [1.0, 2.0])
def test_a_metered_channel_fills_the_converters_range_at_the_cameras_gain(gain):
    sensor = with_channel_readings(replace(low_noise(), gain=gain), [ChannelReading("W", metered=True)])
    (reading,) = resolve(sensor, np.full((8, 8), 80_000.0), 1.0, "W")
    most = 0.8 * 15_000 / gain
    assert most * 2 ** (-1 / 16) < 80_000.0 * reading.time_share <= most * (1 + 1e-9)


@loop("reading", WAYS)
def test_a_raw_image_states_each_channels_noise_with_its_converters_rounding(reading):
    sensor = camera(reading, column_gain_spread=0.0)
    raw = shot(sensor, scene(), 1)
    for channel, apart in (("W", reading), ("G", ChannelReading("G"))):
        alone = at_channel(chip_readings(sensor, EXPOSURE_S), channel)[0].sensor
        read_e, dark_e = apart.read_noise_e or 1.5, 2000 * EXPOSURE_S * apart.time_share
        noise, fixed_e2 = raw.noise_of(channel), (apart.dsnu_e or 1.0) ** 2 + 2.0**2
        stated_e2 = (noise.read_noise_e**2 + noise.dsnu_e**2) * apart.share**2
        written_e2 = read_e**2 + dark_e + alone.gain_e_per_dn**2 / 12 + fixed_e2
        assert stated_e2 == pytest.approx(written_e2, rel=1e-6), channel
