"""Camera shake: the spectrum, its blur in closed form, energy, and a still camera where it is off."""

from dataclasses import replace

import numpy as np
import pytest
import scipy
from loop import loop
from refusal import refusal

from render.illuminants import illuminant
from render.radiance import SpectralRadiance
from sensor.capture import photograph_radiance
from sensor.config import LensConfig, SensorConfig
from sensor.device import draw_device
from sensor.presets import preset
from sensor.shake import SHAKES, blur_variance, held_lens, path, shaken

NM = np.arange(400.0, 781.0, 40.0)
TIMES_S = (1e-5, 0.001, 0.02, 0.1, 0.3)


def by_hand() -> SensorConfig:
    sensor = preset("table1_output")
    return replace(sensor, lens=held_lens(sensor.lens, "hand"))


def spectrum(frequency_hz):
    """One-sided, of a place with variance 1 (Timmer et al. 1998): measured hands' 4 Hz, damped by half."""
    return 4 * 0.5 * 4**3 / np.pi / ((4**2 - frequency_hz**2) ** 2 + (2 * 0.5 * 4 * frequency_hz) ** 2)


def integral(function):
    return sum(
        scipy.integrate.quad(function, *ends, limit=2000)[0] for ends in ((0, 4), (4, 20), (20, 400), (400, 1e6))
    )


def test_spectrum_has_the_variance_and_the_speed_that_are_stated():
    assert integral(spectrum) == pytest.approx(1.0, rel=1e-6)
    speed = integral(lambda f: (2 * np.pi * f) ** 2 * spectrum(f)) ** 0.5  # falls as 1 / f^2: 2e-6 beyond the last
    assert speed == pytest.approx(8 * np.pi, rel=1e-5)
    # Behind F mm, in 1/F s, both axes together draw a point out to film's circle of confusion, 30 um.
    drawn_um = np.sqrt(2) * SHAKES["hand"] * speed / 6.0
    assert drawn_um == pytest.approx(30.0, rel=1e-5)


@pytest.mark.parametrize("time_s", [0.02, 0.1, 0.5])
def test_closed_form_of_the_blur_is_the_spectrum_s_integral(time_s):
    within = integral(lambda f: spectrum(f) * (1 - np.sinc(f * time_s) ** 2))
    assert blur_variance(time_s) == pytest.approx(within, rel=1e-6)


def test_short_times_are_straight_lines_and_long_ones_hold_all_of_the_variance():
    speed = 8 * np.pi
    assert blur_variance(1e-6) == pytest.approx((speed * 1e-6) ** 2 / 12, rel=1e-4)
    assert blur_variance(1e5) == pytest.approx(1.0, abs=1e-4)
    # the series and the whole expression meet
    edge_s = 1e-2 / speed
    assert blur_variance(edge_s * 0.9999) == pytest.approx(blur_variance(edge_s * 1.0001), rel=1e-3)


@pytest.mark.sample(2)
@pytest.mark.parametrize("time_s", TIMES_S)
def test_second_moment_of_the_paths_is_that_of_the_spectrum(time_s):
    squares = np.array([(path(time_s, key) ** 2).mean(axis=1) for key in range(500)])
    # a thousand independent axes; their scatter gives the standard error, 5 of them: a false alarm in a million. Steps
    # of time/32 or 2 ms miss 1/32^2 of the integral.
    error = squares.std() / np.sqrt(squares.size)
    assert squares.mean() == pytest.approx(blur_variance(time_s), abs=5 * error + 1e-3 * blur_variance(time_s))


def test_second_moment_of_a_point_s_image_is_that_of_the_path():
    sensor, time_s = by_hand(), 0.05
    point = np.zeros((63, 63, 4))
    gauss = np.exp(-0.5 * ((np.arange(63) - 31) / 2.0) ** 2)  # band-limited, so that moments are exact on samples
    point += np.outer(gauss, gauss)[..., None]
    image = shaken(point, sensor, time_s, np.random.default_rng(3))
    key = int(np.random.default_rng(3).integers(0, 2**64, dtype=np.uint64))
    places = path(time_s, key) * sensor.lens.shake_um / sensor.site_pitch_um
    grid = np.arange(63) - 31.0
    for axis, grown in enumerate((places**2).mean(axis=1)):
        before, after = (
            (light[..., 0].sum(axis=1 - axis) * grid**2).sum() / light[..., 0].sum() for light in (point, image)
        )
        assert after - before == pytest.approx(grown, rel=1e-5)


def test_zero_exposure_gives_no_blur_and_a_still_camera_draws_nothing():
    field = np.random.default_rng(0).random((16, 12, 4))
    np.testing.assert_array_equal(shaken(field, by_hand(), 0.0, np.random.default_rng(1)), field)
    rng = np.random.default_rng(1)
    assert shaken(field, preset("table1_output"), 0.1, rng) is field
    assert rng.random() == np.random.default_rng(1).random()


@pytest.mark.parametrize("time_s", [0.005, 0.3])
def test_energy_of_every_channel_is_kept_and_nothing_is_negative(time_s):
    field = np.random.default_rng(0).random((32, 24, 4)) ** 8
    field[20, 5] = 1e4  # a lamp
    field[..., 3] = 0.0
    image = shaken(field, by_hand(), time_s, np.random.default_rng(1))
    np.testing.assert_allclose(image.sum(axis=(0, 1)), field.sum(axis=(0, 1)), rtol=1e-6)
    assert image.min() >= 0.0
    assert image[20, 5, 0] < field[20, 5, 0]


def test_unknown_way_to_hold_a_camera_is_refused():
    refusal(held_lens, LensConfig(2.8), "tripod", match="shake: 'tripod' is unknown; allowed: hand")


@loop("name, time_s", [("staggered", 0.001), ("white_apart", 0.01)])
def test_a_hand_s_blur_of_the_whole_time_is_given_to_no_shorter_reading(name, time_s):
    still = preset(name)
    light = SpectralRadiance(np.full((8, 8, NM.size), 0.01), NM)
    shaky = LensConfig(2.8, shake_um=5.0)
    refusal(
        lambda: photograph_radiance(light, replace(still, lens=shaky), time_s),
        match="shake_um: 5 .*after a part of the time",
    )
    photograph_radiance(light, replace(still, lens=LensConfig(2.8)), time_s)


def test_a_channel_that_takes_the_whole_time_shakes_as_the_others_do():
    light = SpectralRadiance(np.full((8, 8, NM.size), 1e-6), NM)
    sensor = replace(preset("white_apart"), lens=LensConfig(2.8, shake_um=5.0))
    assert photograph_radiance(light, sensor, 0.01).noise_of("W").shot == 1.0


def test_frames_of_a_held_camera_differ_by_their_paths_and_repeat_with_the_seed():
    light = illuminant("D65").band_average(NM, np.full(NM.size, 40.0))
    card = np.indices((48, 48)).sum(axis=0) // 6 % 2
    radiance = SpectralRadiance((0.1 + card[..., None]) * light, NM)
    sensor = replace(by_hand(), pixel=replace(by_hand().pixel, read_noise_e=0.0, dsnu_e=0.0, prnu=0.0))
    device = draw_device(sensor, (48, 48), np.random.default_rng(0))
    rng = np.random.default_rng(5)
    one, other = (photograph_radiance(radiance, sensor, 0.05, device, rng) for _ in range(2))
    again = photograph_radiance(radiance, sensor, 0.05, device, np.random.default_rng(5))
    np.testing.assert_array_equal(one.dn, again.dn)
    assert not np.array_equal(one.dn, other.dn)
    still = photograph_radiance(radiance, replace(sensor, lens=LensConfig(2.8)), 0.05, device, np.random.default_rng(5))
    white = np.s_[1::2, 1::2]  # the edges are softer by hand: less spread in the samples of one channel
    assert one.electrons[white].std() < still.electrons[white].std()
