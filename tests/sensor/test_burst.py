"""Bracket and burst merged: closed forms, no bias at any light, the variance that theory gives, saturation left out."""

from dataclasses import replace

import numpy as np
import pytest
from builders import even_device, raw_image
from loop import loop
from refusal import refusal

from render.radiance import SpectralRadiance
from sensor.burst import merge_frames, merged_raw, merged_sensor
from sensor.capture import photograph_radiance
from sensor.config import LensConfig, SensorConfig
from sensor.device import draw_device
from sensor.pixel import PixelConfig
from sensor.presets import low_noise, preset, table1_pixel
from sensor.readout import read_out

QUIET = PixelConfig(2.2, 0.9, full_well_e=10_000.0, read_noise_e=0.0, dsnu_e=0.0, prnu=0.0)
SHAPE = (256, 256)
PIXELS = SHAPE[0] * SHAPE[1]


def camera(**pixel):
    return SensorConfig(replace(QUIET, **pixel), LensConfig(2.8), bits=16)


def shoot(sensor, rate, exposures_s, device=None, seed=0, shape=SHAPE):
    device = even_device(shape) if device is None else device
    rng = np.random.default_rng(seed)
    light = np.broadcast_to(np.asarray(rate, dtype=float), shape)
    return [read_out(light * t, sensor, device, t, rng) for t in exposures_s]


def test_a_burst_of_equal_frames_merges_to_their_mean_and_an_nth_of_the_variance():
    sensor = camera(read_noise_e=20.0)
    frames = shoot(sensor, 1e5, [0.01] * 5)
    merged = merge_frames(frames)
    mean = np.mean([frame.electrons for frame in frames], axis=0)
    np.testing.assert_allclose(merged.rate_e_per_s, mean / 0.01, rtol=1e-12)
    expected = (mean + 400 + sensor.gain_e_per_dn**2 / 12) / (5 * 0.01**2)
    np.testing.assert_allclose(merged.temporal_variance, expected, rtol=1e-12)
    assert not merged.saturated.any()


# Levels from the dark to beyond the shortest frame's well: read noise rules, shot noise rules, the longest frame
# clips in its very midst, the middle one does.
RATES = (0.0, 50.0, 1e3, 1e4, 1e5, 4e5, 5.6e5, 5.8e5, 5.9e5, 6e5, 6.2e5, 1e6, 2.3e6, 2.4e6, 4e6, 8e6)
TIMES = (0.001, 0.004, 0.016)


@pytest.mark.sample(9)
@pytest.mark.parametrize("rate", RATES)
@pytest.mark.parametrize("read_noise_e", [2.0, 30.0])
def test_the_merge_has_no_bias_and_the_stated_variance_at_any_light(rate, read_noise_e):
    sensor = camera(read_noise_e=read_noise_e)
    merged = merge_frames(shoot(sensor, rate, TIMES, seed=int(rate)))
    noise = merged.rate_e_per_s.std()
    # the mean of 65 536 pixels within 4 standard errors (32 levels: 2e-3 for fresh seeds) and the stated 1 %
    assert abs(merged.rate_e_per_s.mean() - rate) < noise * (4 / np.sqrt(PIXELS) + 0.01)
    stated, error = np.sqrt(merged.temporal_variance.mean()), 4 / np.sqrt(2 * PIXELS) + 0.01
    assert abs(stated / noise - 1) < error  # of 2 e-, in the dark: 0.4 % for the least that is stated
    assert not merged.saturated.any()


def theory(rate, times, read_noise_e, sensor):
    """Variance of the best linear estimate, with the rate known."""
    temporal = read_noise_e**2 + sensor.gain_e_per_dn**2 / 12
    return 1 / sum(t**2 / (rate * t + temporal) for t in times)


@loop(("rate", "clear"), [(100.0, TIMES), (2e5, TIMES), (1e6, TIMES[:2]), (2e6, TIMES[:2]), (5e6, TIMES[:1])])
def test_the_variance_is_the_best_that_the_unsaturated_frames_allow(rate, clear):
    sensor = camera(read_noise_e=10.0)
    merged = merge_frames(shoot(sensor, rate, TIMES))
    best = theory(rate, clear, 10.0, sensor)
    # within 1 % and 4 standard errors of a variance (6.3e-5)
    assert merged.rate_e_per_s.var() == pytest.approx(best, rel=0.01 + 4 * np.sqrt(2 / PIXELS))
    assert merged.temporal_variance.mean() == pytest.approx(best, rel=0.01)
    assert best <= theory(rate, clear[-1:], 10.0, sensor)


def test_beyond_the_shortest_frame_s_well_pixels_are_told_to_be_saturated():
    light = np.full(SHAPE, 1e5)
    light[:, ::2] = 1e9
    merged = merge_frames(shoot(camera(read_noise_e=10.0), light, TIMES))
    np.testing.assert_array_equal(merged.saturated, light > 1e8)
    np.testing.assert_allclose(merged.rate_e_per_s[:, ::2], 1e7, rtol=0.01)  # the well in the shortest time


def test_frames_of_a_noisy_camera_that_are_full_are_left_out_although_many_read_under_the_top():
    sensor = table1_pixel()
    device = draw_device(sensor, SHAPE, np.random.default_rng(1))
    merged = merge_frames(shoot(sensor, 5e6, (0.001, 0.1), device))
    spread = np.sqrt((merged.temporal_variance + merged.fixed_variance).mean())
    assert abs(merged.rate_e_per_s.mean() - 5e6) < 4 * spread / np.sqrt(PIXELS)
    assert not merged.saturated.any()


@loop("dark_e", [0.0, 3000.0])
def test_a_frame_counts_up_to_six_standard_deviations_below_its_well(dark_e):
    """By hand: shot noise, dark noise, and columns' gains of 3 % on light and dark current together."""
    well_e, spread = 10_000.0 - dark_e, 0.03
    told = {"white_dn": 100 + well_e, "dark_current_e": dark_e, "column_gain_spread": spread, "read_noise_e": 5.0}
    told |= {"dsnu_e": np.hypot(7.0, spread * dark_e)}
    variance_e2 = well_e + 5.0**2 + 1 / 12 + 7.0**2 + (spread * (well_e + dark_e)) ** 2
    wanted_e = well_e - 6 * np.sqrt(variance_e2)
    electrons = np.arange(4000, 7000 + 3000 * (dark_e == 0)).reshape(-1, 100)
    long = raw_image(electrons + 100, exposure_s=0.1, **told)
    short = raw_image(np.full(electrons.shape, 100), exposure_s=1e-5, **told)  # reads nothing, and hardly weighs
    alone = electrons / 0.1
    merged = merge_frames([long, short]).rate_e_per_s
    counted = electrons[merged > alone / 2]
    assert counted.max() == pytest.approx(wanted_e, abs=3)
    assert counted.size == counted.max() - 4000 + 1


def test_fixed_patterns_have_the_stated_variance_over_a_chip():
    sensor = camera(read_noise_e=5.0, dsnu_e=10.0, prnu=0.02)
    device = draw_device(sensor, SHAPE, np.random.default_rng(2))
    for rate in (1e3, 3e5):
        merged = merge_frames(shoot(sensor, rate, TIMES, device))
        stated = (merged.temporal_variance + merged.fixed_variance).mean()
        # within 4 standard errors of a variance and 2 %: false-alarm rate 1.3e-4
        assert merged.rate_e_per_s.var() == pytest.approx(stated, rel=4 * np.sqrt(2 / PIXELS) + 0.02)
        assert merged.fixed_variance.mean() > 0.2 * stated


@loop("name", ["low_noise", "dual_gain", "split_pixel", "staggered"])
def test_frames_of_one_reading_or_several_and_dark_current_merge_over_times(name):
    sensor = preset(name)
    sensor = replace(sensor, pixel=replace(sensor.pixel, dark_current_e_per_s=500.0))
    device = draw_device(sensor, SHAPE, np.random.default_rng(5))
    merged = merge_frames(shoot(sensor, 2e4, [0.01, 0.04], device))
    noise = np.sqrt(merged.temporal_variance.mean() + merged.fixed_variance.mean())
    assert abs(merged.rate_e_per_s.mean() - 2e4) < noise * (4 / np.sqrt(PIXELS) + 0.02)


def test_a_bracket_of_photographs_gives_back_the_scene_from_shadow_to_light():
    nm = np.arange(385.0, 780.0, 10.0)
    values = np.full((64, 64, nm.size), 2e-3)
    values[:, 32:] = 0.2
    sensor, times = low_noise(), (0.01 / 64, 0.01 / 8, 0.01, 0.04)
    sensor = replace(sensor, lens=replace(sensor.lens, diffraction=0.0))  # no light of the bright half in the dark one
    device = draw_device(sensor, (64, 64), np.random.default_rng(3))
    radiance = SpectralRadiance(values, nm)
    rng = np.random.default_rng(4)
    frames = [photograph_radiance(radiance, sensor, exposure_s, device, rng) for exposure_s in times]
    merged = merge_frames(frames)
    dark, bright = merged.rate_e_per_s[1::2, 1:31:2].mean(), merged.rate_e_per_s[1::2, 33::2].mean()  # W
    assert bright / dark == pytest.approx(100.0, rel=0.01)
    assert not merged.saturated.any()


@loop("full_well_e", [1.0, 50.0])
def test_a_well_of_a_few_electrons_still_counts_until_half(full_well_e):
    merged = merge_frames(shoot(camera(full_well_e=full_well_e), 0.2 * full_well_e / 0.01, [0.01] * 3))
    assert merged.saturated.mean() < 0.3


def test_frames_that_do_not_belong_together_are_refused():
    one, other = shoot(camera(), 1e4, [0.01, 0.02], shape=(8, 8))
    assert "frames: none were given" in refusal(merge_frames, [])
    assert "gain_e_per_dn of frame 1 is 2.0" in refusal(merge_frames, [one, replace(other, gain_e_per_dn=2.0)])
    assert "cfa of frame 1" in refusal(merge_frames, [one, replace(other, cfa=("RG", "GB"))])
    assert "shape of frame 1 is (8, 10)" in refusal(merge_frames, [one, shoot(camera(), 1e4, [0.01], shape=(8, 10))[0]])
    assert "exposure_s of frame 1" in refusal(merge_frames, [one, replace(other, exposure_s=0.0)])


def test_a_merged_burst_is_one_exposure_of_all_its_time():
    """n frames of rate r over t, whole: mean n r t, variance n (r t + read^2 + quantisation), offsets n times DSNU."""
    frames = [raw_image(np.full((8, 10), 1100 + step), prnu=0.01) for step in (0, 4, -4, 0)]
    raw = merged_raw(frames)
    assert raw.electrons == pytest.approx(np.full((8, 10), 4000.0), rel=1e-9)
    assert (raw.exposure_s, raw.cfa, raw.prnu) == (pytest.approx(0.04), frames[0].cfa, 0.01)
    assert raw.full_well_e == pytest.approx(4 * frames[0].full_well_e)
    assert raw.dark_noise_e**2 == pytest.approx(4 * (1.0 + 1 / 12) + (4 * 1.0) ** 2)
    assert merged_raw(frames[:1]) is frames[0]
    bright = merged_raw([raw_image(np.full((8, 10), 14_800))] * 4)
    assert bright.electrons == pytest.approx(np.full((8, 10), 4 * 14_700.0), rel=1e-6)
    assert not bright.saturated.any()
    full = merged_raw([raw_image(np.full((8, 10), 15_100))] * 4)
    assert full.saturated.all()


def test_a_merged_bracket_goes_on_above_the_longest_frames_well():
    """Two frames, 10 and 40 ms, of light that fills the long one: the short one's rate over 50 ms."""
    long_frame = raw_image(np.full((8, 10), 15_100), exposure_s=0.04)
    short_frame = raw_image(np.full((8, 10), 100 + 10_000), exposure_s=0.01)
    raw = merged_raw([long_frame, short_frame])
    assert raw.electrons == pytest.approx(np.full((8, 10), 10_000 * 5.0), rel=1e-6)
    assert not raw.saturated.any()
    assert raw.full_well_e == pytest.approx(15_000 * 5.0)


def test_a_sensor_of_merged_frames_has_the_bursts_noise():
    sensor = preset("low_noise")
    four = merged_sensor(sensor, 4)
    quiet = replace(sensor.pixel, read_noise_e=2.0, dsnu_e=0.5)
    merged = merged_sensor(replace(sensor, pixel=quiet), 4).pixel
    assert (merged.read_noise_e, merged.dsnu_e, merged.full_well_e) == (4.0, 2.0, 4 * quiet.full_well_e)
    assert four.pixel.prnu == sensor.pixel.prnu
