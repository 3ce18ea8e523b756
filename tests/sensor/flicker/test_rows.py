"""Bands of a rolling shutter: their amplitude by closed form, which way rows roll, and the lamps' parts."""

from dataclasses import replace

import numpy as np
import pytest
from refusal import refusal

from render.radiance import SpectralRadiance
from sensor.config import frame_interval_s, row_starts_s
from sensor.device import draw_device
from sensor.flicker.photograph import frame_starts_s, photograph_flickering
from sensor.flicker.rows import check_flicker, flickering, row_weights, steady_exposure_s
from sensor.flicker.waveform import Waveform, pwm
from sensor.optics import form_image
from sensor.photodiodes import binned
from sensor.presets import low_noise, preset
from sensor.shake import held_lens

ROWS = 400
ROLLING = replace(low_noise("mono"), row_time_us=100.0)  # 400 rows take 40 ms: whole periods of 50, 100, 125 Hz


def even(level: float = 1e-3, shape=(ROWS, 64)):
    return SpectralRadiance(np.full((*shape, 4), level), np.arange(430.0, 780.0, 100.0))


BANDS = {  # each lamp, and the amplitude of its first cosine over the mean
    "cosine 100 Hz": (Waveform(100.0, 0.9), 0.9),
    "cosine 120 Hz": (Waveform(120.0, 0.9), 0.9),
    "duty 0.25": (pwm(100.0, 0.25), 2 * np.sin(np.pi * 0.25) / (np.pi * 0.25)),
    "duty 0.6": (pwm(120.0, 0.6), 2 * np.sin(np.pi * 0.6) / (np.pi * 0.6)),
}


@pytest.mark.parametrize("name", BANDS)
@pytest.mark.parametrize("exposure_s", [0.0008, 0.0031, 0.0072, 0.0143])
def test_bands_of_a_raw_frame_have_the_amplitude_of_the_sinc(name, exposure_s):
    """Within 1 %: 512 pixels of 2000 e- in each of 400 rows leave a standard error of 7e-5 of the mean to noise."""
    lamp, amplitude = BANDS[name]
    sensor = replace(ROLLING, pixel=replace(ROLLING.pixel, prnu=0.0))
    shape = (ROWS, 512)
    image = form_image(even(6e-6 / exposure_s, shape), sensor)
    device, rng = draw_device(sensor, shape, np.random.default_rng(1)), np.random.default_rng(2)
    (raw,) = photograph_flickering(image, [(lamp, image)], sensor, exposure_s, device, rng, [0.0])
    rows = raw.electrons.mean(axis=1)
    assert 1500 < rows.mean() < 3000
    turns = 2 * np.pi * lamp.frequency_hz * np.arange(ROWS)[:, None] * 1e-4 * np.arange(1, 9)
    columns = np.concatenate([np.ones((ROWS, 1)), np.cos(turns), np.sin(turns)], axis=1)
    fit, *_ = np.linalg.lstsq(columns, rows, rcond=None)
    found = np.hypot(fit[1], fit[9]) / fit[0]
    x = np.pi * lamp.frequency_hz * exposure_s
    assert found == pytest.approx(amplitude * abs(np.sin(x) / x), rel=0.01)


def test_rows_of_a_switched_lamp_are_the_share_of_the_time_that_it_is_lit():
    """Counted by hand: 3 ms from 1 ms on of a lamp that is lit from 0 to 2 ms of 10 hold 1 ms of light."""
    sensor = replace(ROLLING, row_time_us=1000.0)
    weights = row_weights(pwm(100.0, 0.2), sensor, 10, 0.003)
    lit_ms = np.array([2, 1, 0, 0, 0, 0, 0, 0, 1, 2])
    np.testing.assert_allclose(weights, lit_ms / 3 / 0.2, atol=1e-12)


def test_rows_roll_down_up_or_not_at_all():
    np.testing.assert_allclose(row_starts_s(ROLLING, 4), [0, 1e-4, 2e-4, 3e-4])
    np.testing.assert_allclose(row_starts_s(replace(ROLLING, row_time_us=-100.0), 4), [3e-4, 2e-4, 1e-4, 0])
    still = replace(ROLLING, row_time_us=0.0)
    assert np.ptp(row_weights(Waveform(100.0, 0.5), still, 8, 1e-3)) == 0
    down, up = (row_weights(Waveform(100.0, 0.5), replace(ROLLING, row_time_us=x), 8, 1e-3) for x in (100.0, -100.0))
    np.testing.assert_array_equal(down, up[::-1])


def test_photodiodes_that_bin_are_exposed_together():
    sensor = replace(binned(low_noise("quad_bayer"), "charge"), row_time_us=100.0)
    weights = row_weights(Waveform(100.0, 0.5), sensor, 8, 1e-3)
    np.testing.assert_array_equal(weights[::2], weights[1::2])
    np.testing.assert_array_equal(weights[::2], row_weights(Waveform(100.0, 0.5), ROLLING, 4, 1e-3))


def test_each_lamp_weighs_its_own_part_alone():
    lamp, other = Waveform(100.0, 0.9), pwm(240.0, 0.3)
    left, right = np.zeros((ROWS, 4)), np.zeros((ROWS, 4))
    left[:, :2], right[:, 2:] = 100.0, 50.0
    seen = flickering(left + right + 7.0, [(lamp, left), (other, right)], ROLLING, 0.002, 0.3)
    weights = [row_weights(x, ROLLING, ROWS, 0.002, 0.3) for x in (lamp, other)]
    np.testing.assert_allclose(seen[:, 0], 100 * weights[0] + 7)
    np.testing.assert_allclose(seen[:, 3], 50 * weights[1] + 7)


def test_frames_of_a_burst_follow_the_readout_or_the_exposure():
    assert frame_interval_s(ROLLING, ROWS, 0.01) == pytest.approx(0.04)
    assert frame_interval_s(ROLLING, ROWS, 0.05) == 0.05
    first, second, third = frame_starts_s(ROLLING, (ROWS, 64), 0.01, np.random.default_rng(3), 3)
    assert 0 <= first < 1
    assert second - first == pytest.approx(0.04) == third - second
    other, *_ = frame_starts_s(ROLLING, (ROWS, 64), 0.01, np.random.default_rng(4))
    assert other != first


def test_no_time_and_steady_lamps_change_nothing():
    frame = np.full((ROWS, 4), 10.0)
    np.testing.assert_array_equal(flickering(frame, [(Waveform(100.0, 0.9), frame)], ROLLING, 0.0), frame)
    steady = flickering(frame, [(Waveform(100.0), frame)], ROLLING, 0.003)
    np.testing.assert_allclose(steady, frame, rtol=1e-12)


def test_a_rule_cuts_its_time_to_whole_periods_of_the_slowest_lamp():
    lamps = [Waveform(100.0, 0.5), pwm(1000.0, 0.2)]
    assert steady_exposure_s(lamps, 0.066) == pytest.approx(0.06)
    assert steady_exposure_s(lamps, 0.01) == pytest.approx(0.01)
    assert steady_exposure_s(lamps, 0.0099) == 0.0099
    assert steady_exposure_s([], 0.066) == 0.066


def test_cameras_that_flicker_is_not_modelled_for_are_refused():
    refusal(check_flicker, preset("staggered"), match="flicker: .*after a part of the time")
    refusal(check_flicker, preset("white_apart"), match="flicker: .*after a part of the time")
    shaky = replace(low_noise(), lens=held_lens(low_noise().lens, "hand"))
    refusal(check_flicker, shaky, match="flicker: with shake_um")
    check_flicker(preset("dual_gain"))  # two gains of one charge see the same light
    refusal(replace, ROLLING, row_time_us=1e6, match="row_time_us: 1000000.0")


@pytest.mark.parametrize(("frames_per_s", "hertz", "apart"), [(30, 100, 3), (30, 300, 1), (25, 100, 1), (25, 300, 1)])
def test_a_printer_s_camera_pulsates_under_100_hz_and_not_under_300_or_at_25_frames(frames_per_s, hertz, apart):
    """What was found of a 3D printer's camera: 30 frames/s see a switched lamp of 100 Hz at three phases in turn.

    github.com/paxx12-snapmaker-u1/SnapmakerU1-Extended-Firmware, pull requests 490 and 575: 300 Hz, or 25 frames/s, end
    it.
    """
    sensor, lamp, exposure_s = replace(ROLLING, row_time_us=1e6 / frames_per_s / ROWS), pwm(hertz, 0.5), 0.002
    starts_s = frame_starts_s(sensor, (ROWS, 64), exposure_s, np.random.default_rng(1), 12)
    frames = np.array([row_weights(lamp, sensor, ROWS, exposure_s, start_s) for start_s in starts_s])
    swing = np.ptp(frames, axis=0)  # of each row, from frame to frame
    np.testing.assert_allclose(frames[apart:], frames[:-apart], atol=1e-9)
    assert (swing.max() > 1.5) == (apart > 1)
    if apart > 1:
        np.testing.assert_allclose(frames[:3].mean(axis=0).mean(), 1.0, atol=0.01)
