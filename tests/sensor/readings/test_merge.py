"""Readings as they are drawn and merged: unbiased, at the noise of the closed form, without a step at a seam."""

from dataclasses import replace

import numpy as np
import pytest
from loop import loop
from refusal import refusal

from render.illuminants import illuminant
from sensor.burst import merged_raw
from sensor.capture import expose
from sensor.device import draw_device
from sensor.kernel.kernel import read_frame
from sensor.presets import preset
from sensor.random import poisson
from sensor.raw import noise_at_sites
from sensor.raw_files.raw_file import read_raw, write_raw
from sensor.readings.noise import covariances, of_reading, seams, shares, whole_share
from sensor.readout import draw_frame, noise_variance
from studies.photograph.camera import calibrate

HDR = ("dual_gain", "split_pixel", "staggered")
SHAPE, TIME_S = (256, 256), 0.01
EXACT = pytest.mark.parametrize("exact", [False, True], ids=["engine", "exact"])


def levels_of(sensor):
    """Light over six decades, and each seam in steps of a third of its noise."""
    at = seams(sensor, TIME_S).above_e
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
    whole = whole_share(sensor)
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
    whole = whole_share(sensor) if name in HDR else 1.0
    stated = noise_at_sites(raw, whole * light) / whole**2
    np.testing.assert_allclose(stated, noise_variance(light, sensor, 0.1), rtol=0.01)


@loop("share", [0.9, 1.05, 1.3])
@loop("name", HDR)
def test_a_reading_that_dark_current_fills_is_left_out(name, share):
    """At three lights: mean, and variance by the raw image, within 4 standard errors and a tenth, 1e-4 a figure."""
    sensor, shape = preset(name), (128, 128)
    well_e = min(reading.full_well_e / reading.share for reading in sensor.chip.readings)
    sensor = replace(sensor, pixel=replace(sensor.pixel, dark_current_e_per_s=share * well_e / 0.1, prnu=0.0))
    device, whole = draw_device(sensor, shape, np.random.default_rng(3)), whole_share(sensor)
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
    for number, reading in enumerate(sensor.chip.readings):
        own = of_reading(sensor, number)
        key = keys.setdefault(reading.charge, int(rng.integers(2**63)))
        dn = draw(np.full(SHAPE, light * reading.share), own, device.readings[number], TIME_S, key, number)
        samples.append((dn.astype(float) - own.black_dn).ravel() * own.gain_e_per_dn / reading.share)
    found = np.cov(samples)
    meant = sum(covariances(np.array([light]), sensor, TIME_S).values())[0]
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
        draw_frame(light, of_reading(sensor, number), chip.readings[number], 0.01, 7, number, drawn)
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
        own = of_reading(sensor, index)
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
        assert merged.exposure_s == pytest.approx(4 * whole_share(sensor) * TIME_S)
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
    assert raw.electrons[hot].mean() / whole_share(sensor) == pytest.approx(1000.0, rel=0.01)
    assert shares(sensor).tolist() == [1.0, 0.0625]
