"""Readings counted another way: of a share, of hot pixels that are dark current, of frames that aren't square."""

from dataclasses import replace
from math import hypot, sqrt

import numpy as np
import pytest
from refusal import refusal

from sensor.capture import expose
from sensor.config import SensorConfig, with_channel_readings
from sensor.device import draw_device
from sensor.photodiodes import with_gain
from sensor.pixel import ChannelReading
from sensor.presets import low_noise, preset
from sensor.readings.best_estimate import collected_share
from sensor.readings.clipping import clipped
from sensor.readings.resolve import at_channel, by_site, chip_readings, law_by_site, light_of, resolve, unsaturated
from sensor.readout import frame_moments, light_variance, noise_sources

TIME_S = 0.05


def camera(gain: float = 1.0, black_dn: int = 6, **pixel: float) -> SensorConfig:
    """A small well, a low black level and every term, so that each end clips."""
    own = low_noise("bayer")
    terms = {"read_noise_e": 9.0, "dsnu_e": 4.0, "dark_current_e_per_s": 2000.0, "column_gain_spread": 0.01, **pixel}
    return with_gain(replace(own, pixel=replace(own.pixel, full_well_e=3000.0, **terms), black_level_dn=black_dn), gain)


@pytest.mark.parametrize("bend", [0.0, 0.1])
@pytest.mark.parametrize("gain", [1.0, 4.0])
def test_a_reading_of_a_share_has_the_moments_of_a_plain_one_in_its_own_electrons(bend: float, gain: float) -> None:
    """A quarter of the time behind a density of 2: e / s of the raw image's electrons are e of its own."""
    (plain,) = resolve(camera(gain, black_dn=0, dark_current_e_per_s=200.0, response_bend=bend), np.ones(1), TIME_S)
    own_e = np.array([0.0, 2.0, 10.0, 300.0, 650.0, 700.0, 2500.0, 2850.0, 2890.0, 2950.0, 4000.0])
    part = replace(plain, time_share=0.25, light_share=0.5)
    scaled, own = clipped(own_e * 8, part), clipped(own_e, plain)
    assert scaled.mean_e / 8 == pytest.approx(own.mean_e, rel=1e-9, abs=1e-9)
    assert scaled.variance_e2 / 64 == pytest.approx(own.variance_e2, rel=1e-9, abs=1e-9)
    assert scaled.slope == pytest.approx(own.slope, rel=1e-9, abs=1e-12)
    assert own.mean_e[0] > 0.05, "black clips"
    assert own.slope[-1] < 1e-3, "the top clips"


@pytest.mark.parametrize("gain", [1.0, 4.0])
def test_pixels_that_are_all_hot_have_the_dark_current_of_both(gain: float) -> None:
    """Light's mean, its variance and its slope are the same, and so is the noise of each sample."""
    hot = camera(gain, hot_pixel_share=1.0, hot_pixel_dark_current_e_per_s=3000.0)
    dark = camera(gain, dark_current_e_per_s=5000.0)
    light_e = np.array([[0.0, 5.0, 50.0, 400.0], [550.0, 2700.0, 2750.0, 2800.0]])
    ours, theirs = (frame_moments(light_e, resolve(x, light_e, TIME_S)) for x in (hot, dark))
    assert ours.mean_e == pytest.approx(theirs.mean_e, rel=1e-9, abs=1e-9)
    assert ours.variance_e2 == pytest.approx(theirs.variance_e2, rel=1e-9)
    assert ours.slope == pytest.approx(theirs.slope, rel=1e-9, abs=1e-12)
    told, counted = (noise_sources(40.0, x, TIME_S) for x in (hot, dark))
    both = hypot(told.pop("hot pixels"), told.pop("dark current"))
    assert (counted.pop("hot pixels"), both) == (0.0, pytest.approx(counted.pop("dark current")))
    assert told == pytest.approx(counted)


def test_a_few_hot_pixels_add_their_mean_and_the_spread_of_who_is_hot() -> None:
    """p h of p (1 - p) h^2 + p h, of 5 % at 400 e-; in a sample of 400 000 by NumPy within five standard errors."""
    sensor = camera(hot_pixel_share=0.05, hot_pixel_dark_current_e_per_s=8000.0, dark_current_e_per_s=0.0)
    drawn = np.random.default_rng(1).poisson(np.where(np.random.default_rng(2).random(400_000) < 0.05, 400.0, 0.0))
    (reading,) = resolve(sensor, np.ones(1), TIME_S)
    assert reading.dark_e == pytest.approx(20.0)
    variance = noise_sources(0.0, sensor, TIME_S)["hot pixels"] ** 2
    assert variance == pytest.approx(0.05 * 400 + 0.05 * 0.95 * 400**2)
    assert drawn.var() == pytest.approx(variance, rel=5 * sqrt(drawn.var() * 400**2 / variance**2 / drawn.size))


def test_light_that_fills_the_well_is_known_no_better_than_a_thousandth_of_a_slope_tells() -> None:
    light_e = np.full((1, 1), 3300.0)
    sensor = camera(dark_current_e_per_s=0.0)
    readings = resolve(sensor, light_e, TIME_S)
    moments = frame_moments(light_e, readings)
    assert 0.0 < moments.slope[0, 0] < 1e-3
    assert light_variance(light_e, readings) == pytest.approx(moments.variance_e2 * 1e6)


def test_sites_of_a_frame_that_is_not_square_have_their_own_readings() -> None:
    """One pixel in four is white, read after a quarter of the time behind a density of 2."""
    sensor = with_channel_readings(low_noise(), [ChannelReading("W", time_share=0.25, light_share=0.5)])
    shape = (4, 6)
    tile = np.array([list(row) for row in sensor.cfa])
    white = np.tile(tile == "W", (2, 3))
    readings = chip_readings(sensor, TIME_S)
    assert np.array_equal(by_site([1.0, 2.0], readings, shape), np.where(white, 2.0, 1.0))
    laws = law_by_site(readings, shape)
    assert np.array_equal(laws.shot, np.where(white, 8.0, 1.0))
    first, second = light_of(np.full(shape, 80.0), readings)
    assert np.array_equal(first, np.where(white, 40.0, 80.0))
    assert np.array_equal(second, first / 4)
    top_e = np.where(white, readings[1].headroom_e, readings[0].headroom_e)
    assert readings[1].headroom_e > 2 * readings[0].headroom_e
    assert not unsaturated(top_e, readings).any()
    assert unsaturated(np.nextafter(top_e, 0.0), readings).all()


def test_several_readings_are_full_where_the_largest_is() -> None:
    readings = chip_readings(preset("split_pixel"), TIME_S)
    top_e = max(x.sensor.top_e / x.share - x.sensor.pixel.dark_current_e_per_s * TIME_S / x.share for x in readings)
    field = np.array([[np.nextafter(top_e, 0.0), top_e]])
    assert unsaturated(field, readings).tolist() == [[True, False]]


def test_a_reading_has_its_share_of_all_that_is_dark_and_its_own_gain() -> None:
    own = preset("split_pixel")
    pixel = replace(own.pixel, dark_current_e_per_s=300.0, hot_pixel_share=0.01, hot_pixel_dark_current_e_per_s=5000.0)
    sensor = replace(own, pixel=pixel)
    for number, (plain, reading) in enumerate(zip(chip_readings(sensor, TIME_S), sensor.chip.readings, strict=True)):
        assert plain.sensor.pixel.dark_current_e_per_s == pytest.approx(300.0 * reading.share)
        assert plain.sensor.pixel.hot_pixel_dark_current_e_per_s == pytest.approx(5000.0 * reading.share)
        assert plain.sensor.pixel.hot_pixel_share == 0.01
        assert plain.dark_e == pytest.approx((300.0 + 0.01 * 5000.0) * TIME_S)
        assert plain.sensor.pixel.full_well_e == reading.full_well_e
        assert (plain.sensor.pixel.read_noise_e, plain.sensor.pixel.dsnu_e) == (reading.read_noise_e, reading.dsnu_e)
        assert (plain.light_share, plain.time_share) == (reading.light_share, reading.time_share)
        assert (plain.exposure_s, plain.patterns, plain.pixel) == (TIME_S, number, pixel)
        assert not plain.sensor.chip.readings


def test_a_merged_image_states_the_electrons_of_all_charges() -> None:
    """Its top is what the whole pixel holds beside the dark, its black level a whole number of 16 bits over 256."""
    own = preset("split_pixel")
    pixel = replace(own.pixel, dark_current_e_per_s=4000.0, hot_pixel_share=0.01, hot_pixel_dark_current_e_per_s=5000.0)
    sensor, shape = replace(own, pixel=pixel), (16, 32)
    readings = chip_readings(sensor, TIME_S)
    whole = collected_share(readings)
    assert whole == pytest.approx(sum({x.photodiode: x.share for x in readings}.values()))
    device = draw_device(sensor, shape, np.random.default_rng(1))
    raw = expose(np.full(shape, 2 * pixel.full_well_e), sensor, TIME_S, device, np.random.default_rng(2), exact=True)
    full_e = (pixel.full_well_e - 200.0) * whole
    assert (raw.white_dn - raw.black_dn) * raw.gain_e_per_dn == pytest.approx(full_e)
    assert raw.white_dn == 256 * 65_535
    assert raw.black_dn % 256 == 0
    dark_e = raw.black_dn * raw.gain_e_per_dn  # room for five deviations of what is dark; rounded up by 1 DN of 16 bits
    assert 0 <= dark_e - 5 * hypot(raw.read_noise_e, raw.dsnu_e) < 2 * full_e / 65_535
    assert raw.exposure_s == pytest.approx(whole * TIME_S)
    assert raw.dark_current_e == pytest.approx(200.0 * whole)
    assert raw.electrons == pytest.approx(full_e, rel=1e-6)
    spots = np.argwhere(np.any([x.hot for x in device.readings], axis=0))
    assert len(spots) > len(np.argwhere(device.readings[0].hot)) > 0
    assert raw.defects is not None
    assert np.array_equal(raw.defects, spots)


def test_a_camera_that_reads_channels_apart_asks_which_one() -> None:
    sensor = with_channel_readings(
        low_noise(), [ChannelReading("W", time_share=0.25), ChannelReading("G", time_share=0.5)]
    )
    readings = chip_readings(sensor, TIME_S)
    words = "channel: none given for a camera that reads W, G apart; allowed: "
    assert words in refusal(at_channel, readings, None)
    assert words in refusal(resolve, sensor, np.ones(3), TIME_S)
    for name, share in (("W", 0.25), ("G", 0.5), ("R", 1.0), ("B", 1.0)):
        (one,) = at_channel(readings, name)
        assert (one.share, one.sites) == (share, None)
        assert [x.share for x in resolve(sensor, np.ones(3), TIME_S, name)] == [share]
