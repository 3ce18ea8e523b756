"""Terms of real cameras that no preset has: a response that isn't straight, and read noise of whole rows."""

from dataclasses import replace

import numpy as np
import pytest
from loop import loop
from refusal import refusal

from rodcone.jit import backend
from sensor.burst import merged_sensor
from sensor.capture import expose
from sensor.device import draw_device
from sensor.photodiodes import binned
from sensor.pixel import bent_e, bent_slope
from sensor.presets import low_noise
from sensor.readings.resolve import resolve
from sensor.readout import frame_moments

SHAPE, TIME_S, WELL_E = (192, 192), 0.01, 10_000.0


def camera(**pixel):
    own = low_noise("mono")
    return replace(own, pixel=replace(own.pixel, full_well_e=WELL_E, dsnu_e=1.0, prnu=0.004, **pixel))


def drawn(sensor, light_e, *, exact, chips=4):
    frames = []
    for seed in range(chips):
        device, rng = draw_device(sensor, SHAPE, np.random.default_rng([seed, 0])), np.random.default_rng([seed, 1])
        raw = expose(np.full(SHAPE, light_e), sensor, TIME_S, device, rng, exact=exact)
        frames.append((raw.dn - raw.black_dn) * raw.gain_e_per_dn)
    return np.stack(frames)


def test_a_bent_response_keeps_both_ends_and_has_the_stated_slopes():
    pixel = camera(response_bend=0.08).pixel
    at = np.array([0.0, WELL_E])
    np.testing.assert_allclose(bent_e(at, pixel), at)
    np.testing.assert_allclose(bent_slope(at, pixel), [1.08, 0.92])
    assert bent_e(WELL_E / 2, pixel) == pytest.approx(WELL_E / 2 * 1.04)


@loop("exact", (True, False))
@loop("bend", (0.1, -0.1))
@loop("light_e", (0.0, 1000.0, 5000.0, 9600.0))
def test_drawn_samples_of_a_bent_response_have_the_stated_moments(light_e, bend, exact):
    """147 456 samples of 4 chips: 4.5 standard errors of each figure, and 1 % for Poisson's skewness at the well."""
    sensor = camera(response_bend=bend, read_noise_e=6.0, dark_current_e_per_s=5000.0)
    field = np.full((1, 1), light_e)
    moments, samples = frame_moments(field, resolve(sensor, field, TIME_S)), drawn(sensor, light_e, exact=exact)
    variance = moments.variance_e2[0, 0]
    assert samples.mean() == pytest.approx(moments.mean_e[0, 0], abs=4.5 * np.sqrt(variance / samples.size) + 0.2)
    assert samples.var() == pytest.approx(variance, rel=4.5 * np.sqrt(2 / samples.size) + 0.01)


@loop("exact", (True, False))
def test_rows_share_their_part_of_the_read_noise_and_its_sum_stays(exact):
    """768 rows of 4 frames: 4.5 standard errors of a variance, 4.5 sqrt(2 / 768)."""
    sensor = camera(read_noise_e=10.0, row_noise_e=4.0)
    first, second = (
        drawn(sensor, 0.0, exact=exact, chips=4),
        drawn(replace(sensor, black_level_dn=60), 0.0, exact=exact),
    )
    rows = first.mean(axis=2) - np.mean(first.mean(axis=2), axis=0)  # DSNU of a row has the size 1 / sqrt(192)
    share = 4.0**2 + (10.0**2 - 4.0**2) / SHAPE[1]
    assert np.var(first.mean(axis=2)) == pytest.approx(share, rel=4.5 * np.sqrt(2 / 768))
    assert np.corrcoef(rows[0], rows[1])[0, 1] < 0  # anew in each frame: what is left of four is -1/3
    assert first.var() == pytest.approx(10.0**2 + 1.0 + sensor.gain_e_per_dn**2 / 12, rel=0.07)
    np.testing.assert_allclose(second.std(), first.std(), rtol=0.01)  # the sum is by key, not by black level


@pytest.mark.skipif(backend() == "numpy", reason="one engine alone")
def test_both_engines_draw_the_same_rows():
    sensor = camera(read_noise_e=4.0, row_noise_e=4.0)
    np.testing.assert_array_equal(*(drawn(sensor, 0.0, exact=exact, chips=1) for exact in (True, False)))


def test_binned_sums_state_the_noise_of_their_rows():
    """Two rows of two photodiodes: 4 (10^2 - 4^2) + 8 * 4^2 = 464 e-^2, where rows apart would give 400."""
    sensor = binned(camera(read_noise_e=10.0, row_noise_e=4.0), "digital")
    frames = drawn_binned(sensor)
    assert sensor.pixel.read_noise_e**2 == pytest.approx(464.0 + sensor.gain_e_per_dn**2 / 4)
    assert frames.var() == pytest.approx(464.0 + 4.0 + sensor.gain_e_per_dn**2 / 3, rel=4.5 * np.sqrt(2 / 768))


def drawn_binned(sensor):
    frames = []
    for seed in range(4):
        device, rng = draw_device(sensor, SHAPE, np.random.default_rng([seed, 0])), np.random.default_rng([seed, 1])
        raw = expose(np.zeros(SHAPE), sensor, TIME_S, device, rng, exact=True)
        frames.append(raw.electrons)
    return np.stack(frames)


def test_a_merged_burst_has_more_row_noise_by_the_root_of_its_count():
    assert merged_sensor(camera(read_noise_e=10.0, row_noise_e=4.0), 4).pixel.row_noise_e == 8.0


def test_row_noise_beyond_the_read_noise_it_is_a_part_of_is_refused():
    assert "part of the read noise" in refusal(camera, read_noise_e=2.0, row_noise_e=3.0)
    assert "response_bend" in refusal(camera, response_bend=0.6)
