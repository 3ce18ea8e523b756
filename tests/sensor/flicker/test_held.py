"""A hand that shakes under lamps that flicker: a flash freezes it, bands stay, and steady lamps blur as by day."""

from dataclasses import replace

import numpy as np
import pytest

from sensor.device import draw_device
from sensor.flicker.photograph import held_under_lamps, photograph_flickering
from sensor.flicker.rows import row_weights
from sensor.flicker.waveform import Waveform, pwm
from sensor.optics import SpectralIrradiance
from sensor.presets import low_noise
from sensor.random import draw_key
from sensor.shake import moved_by_rows, rolling_path

SHAPE, EXPOSURE_S, SHAKE_PX = (24, 96), 0.03, 8.0
STILL = low_noise("mono")
HELD = replace(STILL, lens=replace(STILL.lens, shake_um=SHAKE_PX * STILL.site_pitch_um))
STEP_S = 0.01 / 16  # of the path under lamps of 100 Hz


def line() -> np.ndarray:
    profile = np.exp(-0.5 * ((np.arange(SHAPE[1]) - 47.5) / 2.5) ** 2)
    return np.tile(profile, (SHAPE[0], 1))[..., None]


def path_px(key: int, starts_s):
    places, shares = rolling_path(starts_s, EXPOSURE_S, draw_key(np.random.default_rng(key)), STEP_S)
    return places * SHAKE_PX, shares


def held(parts, sensor=HELD, key=3, start_s=0.0, whole=None):
    whole = sum(part for _, part in parts) if whole is None else whole
    return held_under_lamps(whole, parts, sensor, EXPOSURE_S, start_s, np.random.default_rng(key))


@pytest.mark.parametrize("row_time_us", [0.0, 200.0])
def test_steady_lamps_blur_as_light_that_does_not_flicker(row_time_us):
    sensor = replace(HELD, row_time_us=row_time_us)
    places, shares = path_px(3, np.arange(SHAPE[0]) * row_time_us * 1e-6)
    found = held([(Waveform(100.0), line())], sensor)
    np.testing.assert_allclose(found, moved_by_rows(line(), places, shares), atol=1e-9)


@pytest.mark.parametrize("key", [3, 4, 5])
def test_a_flash_freezes_the_hand_where_it_is_at_that_time(key):
    """Lit for 0.3 ms in 30, from 12 ms on: the line lies where the path then is, as narrow as in a still camera."""
    flash, start_s = pwm(1 / 0.03, 0.01), 0.018
    places, _ = rolling_path(np.zeros(SHAPE[0]), EXPOSURE_S, draw_key(np.random.default_rng(key)), 0.03 / 16)
    times_s = np.linspace(0, EXPOSURE_S, places.shape[1])
    found = held([(flash, line())], key=key, start_s=start_s)[0, :, 0]
    at = np.arange(SHAPE[1])
    centre = found @ at / found.sum()
    # Within an eighth of a step of the path the hand goes no farther than this.
    step_px = SHAKE_PX * np.abs(np.diff(places[1])).max() / 8
    assert centre - 47.5 == pytest.approx(SHAKE_PX * np.interp(0.01215, times_s, places[1]), abs=step_px)
    width = np.sqrt(found @ (at - centre) ** 2 / found.sum())
    steady = held([(Waveform(1 / 0.03), line())], key=key)[0, :, 0]
    middle = steady @ at / steady.sum()
    assert width == pytest.approx(2.5, abs=0.005)
    blurred = steady @ (at - middle) ** 2 / steady.sum()
    assert blurred - 2.5**2 == pytest.approx(np.trapezoid((SHAKE_PX * places[1]) ** 2, times_s) / EXPOSURE_S, rel=0.1)
    assert found.sum() == pytest.approx(line()[0].sum() * EXPOSURE_S / 0.03, rel=1e-6)


@pytest.mark.parametrize("lamp", [Waveform(100.0, 0.9), pwm(100.0, 0.2)])
def test_an_even_wall_has_the_bands_of_a_still_camera(lamp):
    sensor = replace(HELD, row_time_us=300.0)
    wall = np.ones((*SHAPE, 1))
    found = held([(lamp, wall)], sensor, start_s=0.4)
    weights = row_weights(lamp, sensor, SHAPE[0], EXPOSURE_S, 0.4)
    np.testing.assert_allclose(found, np.broadcast_to(weights[:, None, None], found.shape), rtol=1e-9)


def test_lamps_add_up_and_frames_of_a_burst_have_paths_of_their_own():
    flicker, rest = (Waveform(100.0, 0.8), 0.5 * line()), np.roll(line(), 9, axis=1)
    alone = held([flicker]), held([(Waveform(100.0), rest)])
    both = held([flicker], whole=flicker[1] + rest)
    np.testing.assert_allclose(both, sum(alone), atol=1e-9)
    nm = np.array([430.0, 530.0, 630.0, 730.0])
    image = SpectralIrradiance(np.tile(line(), nm.size) * 1e-3, nm, STILL.pixel.pitch_um)
    device, rng = draw_device(HELD, SHAPE, np.random.default_rng(1)), np.random.default_rng(2)
    taken = photograph_flickering(image, [(flicker[0], image)], HELD, EXPOSURE_S, device, rng, [0.0, 0.1], exact=True)
    again = photograph_flickering(
        image, [(flicker[0], image)], HELD, EXPOSURE_S, device, np.random.default_rng(2), [0.0, 0.1], exact=True
    )
    assert np.array_equal(taken[1].dn, again[1].dn)
    rows = [raw.electrons[5] for raw in taken]
    assert abs(np.subtract(*(row.argmax() for row in rows))) > 0
