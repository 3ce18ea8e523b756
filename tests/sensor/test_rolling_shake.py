"""A hand that shakes while rows roll: straight motion in closed form, the path's statistics, and still cameras."""

from dataclasses import replace

import numpy as np
import pytest
import scipy
from refusal import refusal

from sensor.cfa import quad
from sensor.photodiodes import binned
from sensor.presets import preset
from sensor.random import draw_key
from sensor.shake import moved_by_rows, path, rolling_path, row_shares, shaken

HEIGHT, WIDTH = 40, 96


def line(width_px: float = 2.5) -> np.ndarray:
    """Upright line, band-limited, so that moments are exact on samples; shape (h, w, 1)."""
    profile = np.exp(-0.5 * ((np.arange(WIDTH) - 47.5) / width_px) ** 2)
    return np.tile(profile, (HEIGHT, 1))[..., None]


def centres(light: np.ndarray) -> np.ndarray:
    return (light * np.arange(light.shape[1])).sum(axis=1) / light.sum(axis=1)


def straight(velocity_px_s, starts_s, exposure_s, count=33):
    """Places of an image that moves evenly, (down, right), and the rows' shares of them."""
    step_s = (starts_s.max() + exposure_s) / (count - 1)
    places = np.outer(velocity_px_s, np.arange(count) * step_s)
    return places, row_shares(starts_s, exposure_s, step_s, count)


@pytest.mark.parametrize("exposure_s", [1e-4, 3e-3, 0.05])
@pytest.mark.parametrize("row_time_s", [1e-4, -1e-4])
def test_an_even_motion_leans_an_upright_line_by_velocity_and_row_time(row_time_s, exposure_s):
    velocity, order = 900.0, np.arange(HEIGHT) if row_time_s > 0 else np.arange(HEIGHT)[::-1]
    starts = order * abs(row_time_s)
    places, shares = straight((0.0, velocity), starts, exposure_s)
    np.testing.assert_allclose(shares.sum(axis=1), 1.0, rtol=1e-12)
    # At most 8 px, so that the line stays clear of the border.
    slower = min(1.0, 8.0 / (velocity * (starts.max() + exposure_s)))
    found = centres(moved_by_rows(line(), places * slower, shares)[..., 0])
    # The middle of each row's exposure: the first starts at 0.
    np.testing.assert_allclose(found, 47.5 + slower * velocity * (starts + exposure_s / 2), atol=1e-6)
    lean = (found[-1] - found[0]) / (HEIGHT - 1)
    assert lean == pytest.approx(slower * velocity * row_time_s, rel=1e-6)


def test_a_picture_that_sinks_with_the_rows_is_stretched():
    speed, row_s, exposure_s = 200.0, 1e-3, 1e-3  # px/s: a fifth of a row in a row's time
    bands = np.exp(-0.5 * ((np.arange(HEIGHT) - 12.0) / 1.5) ** 2)
    picture = np.tile(bands[:, None], (1, WIDTH))[..., None]
    places, shares = straight((speed, 0.0), np.arange(HEIGHT) * row_s, exposure_s, 201)
    profile = moved_by_rows(picture, places, shares)[:, WIDTH // 2, 0]
    # Row y shows the place y - v (y t + T / 2), so that the band lies where that is 12, wider by 1 / (1 - v t).
    stretch = 1 / (1 - speed * row_s)
    centre = profile @ np.arange(HEIGHT) / profile.sum()
    assert centre == pytest.approx((12.0 + speed * exposure_s / 2) * stretch, abs=1e-2)
    assert profile.sum() / bands.sum() == pytest.approx(stretch, rel=1e-3)


def test_rows_that_start_together_see_what_a_global_shutter_does():
    picture = np.random.default_rng(0).random((HEIGHT, WIDTH, 2)) + 1
    sensor = replace(preset("low_noise"), lens=replace(preset("low_noise").lens, shake_um=3.0))
    together = shaken(picture, sensor, 0.05, np.random.default_rng(3))
    places = path(0.05, draw_key(np.random.default_rng(3))) * 3.0 / sensor.site_pitch_um
    shares = np.full((HEIGHT, places.shape[1]), 1 / places.shape[1])
    rolled = moved_by_rows(picture, places, shares)
    # All rows together, a channel's sum is brought back to the still picture's.
    rolled *= picture.sum(axis=(0, 1)) / rolled.sum(axis=(0, 1))
    np.testing.assert_allclose(rolled, together, rtol=1e-9)


@pytest.mark.parametrize("row_time_us", [250.0, -250.0])
def test_a_held_camera_s_rows_lie_where_the_path_is_within_their_exposure(row_time_us):
    still = replace(preset("low_noise"), row_time_us=row_time_us)
    sensor = replace(still, lens=replace(still.lens, shake_um=3.0 * still.site_pitch_um))
    light = shaken(line(), sensor, 0.008, np.random.default_rng(5))
    starts = np.arange(HEIGHT)[:: 1 if row_time_us > 0 else -1] * 250e-6
    places, shares = rolling_path(starts, 0.008, draw_key(np.random.default_rng(5)))
    np.testing.assert_allclose(centres(light[..., 0]), 47.5 + 3.0 * (shares @ places[1]), atol=1e-5)
    assert np.ptp(centres(light[..., 0])) > 0.1
    np.testing.assert_array_equal(shaken(line(), still, 0.008, np.random.default_rng(5)), line())
    np.testing.assert_array_equal(shaken(line(), sensor, 0.0, np.random.default_rng(5)), line())


def test_photodiodes_that_bin_are_exposed_together():
    plain = preset("low_noise")
    photodiodes = replace(plain, cfa=quad(plain.cfa), row_time_us=500.0)
    sensor = binned(photodiodes, "charge")
    sensor = replace(sensor, lens=replace(sensor.lens, shake_um=3.0 * sensor.site_pitch_um))
    light = shaken(line(), sensor, 0.008, np.random.default_rng(5))
    places, shares = rolling_path(
        np.repeat(np.arange(HEIGHT // 2) * 500e-6, 2), 0.008, draw_key(np.random.default_rng(5))
    )
    np.testing.assert_allclose(centres(light[..., 0]), 47.5 + 3.0 * (shares @ places[1]), atol=1e-5)
    refusal(shaken, line()[:-1], sensor, 0.01, np.random.default_rng(0), match="even height and width")


@pytest.mark.sample(2)
@pytest.mark.parametrize("apart_s", [0.004, 0.04])
def test_rows_apart_differ_by_the_spectrum_s_share(apart_s):
    exposure_s = 0.01

    def spectrum(f):
        return 4 * 0.5 * 4**3 / np.pi / ((4**2 - f**2) ** 2 + (2 * 0.5 * 4 * f) ** 2)  # 4 Hz, damped by half

    expected = sum(
        scipy.integrate.quad(
            lambda f: 2 * spectrum(f) * np.sinc(f * exposure_s) ** 2 * (1 - np.cos(2 * np.pi * f * apart_s)),
            *ends,
            limit=2000,
        )[0]
        for ends in ((0, 20), (20, 400))
    )
    differences = []
    for key in range(500):
        places, shares = rolling_path(np.array([0.0, apart_s]), exposure_s, key)
        differences.append(places @ (shares[1] - shares[0]))
    squares = np.square(differences)
    # A thousand independent axes, 5 standard errors: a false alarm in a million. Straight steps of at most 2 ms miss
    # less than a thousandth of the variance.
    error = squares.std() / np.sqrt(squares.size)
    assert squares.mean() == pytest.approx(expected, abs=5 * error + 2e-3 * expected)
