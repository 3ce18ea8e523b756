"""Moments of clipped samples against drawn frames, closed forms at a bound, and where nothing clips."""

from dataclasses import replace

import numpy as np
import pytest
from loop import loop
from scipy import integrate, stats

from sensor.capture import expose
from sensor.cfa import mask
from sensor.config import SensorConfig, with_channel_readings
from sensor.device import draw_device
from sensor.photodiodes import with_gain
from sensor.pixel import ChannelReading
from sensor.presets import low_noise, preset
from sensor.readings.clipping import censored
from sensor.readings.resolve import resolve
from sensor.readout import frame_moments, light_variance, noise_variance, unclipped_variance

SHAPE, TIME_S = (128, 128), 0.1
WELL_E = 6000.0


def camera(gain: float = 1.0, **pixel: float) -> SensorConfig:
    own = low_noise("bayer")
    return with_gain(replace(own, pixel=replace(own.pixel, full_well_e=WELL_E, **pixel)), gain)


def drawn(sensor: SensorConfig, light_e: float, chips: int = 6) -> np.ndarray:
    frames = []
    for seed in range(chips):
        device = draw_device(sensor, SHAPE, np.random.default_rng([seed, 0]))
        rng = np.random.default_rng([seed, 1])
        frames.append(expose(np.full(SHAPE, light_e), sensor, TIME_S, device, rng, exact=True).electrons)
    return np.stack(frames)


def test_a_censored_gaussian_has_the_moments_of_its_integral() -> None:
    for mean, deviation, most in ((0.0, 1.0, 0.0), (3.0, 2.0, 4.0), (10.0, 0.5, 9.0), (0.0, 1.0, 9.0)):
        first, second, below = censored(np.array([mean]), np.array([deviation**2]), most)
        law = stats.norm(mean, deviation)
        ends = mean - 10 * deviation, min(most, mean + 10 * deviation)
        x = np.linspace(*ends, 200_001)
        integrals = [integrate.simpson((x - mean) ** p * law.pdf(x), x=x) for p in (1, 2)]
        assert first[0] == pytest.approx(integrals[0] + (most - mean) * law.sf(most), abs=1e-9)
        assert second[0] == pytest.approx(integrals[1] + (most - mean) ** 2 * law.sf(most), abs=1e-9)
        assert below[0] == pytest.approx(law.cdf(most), abs=1e-12)


@loop("part", [0.97, 0.985, 0.995, 1.01])
@loop("gain", [1.0, 4.0])
def test_samples_beside_the_well_have_the_stated_mean_and_variance(gain: float, part: float) -> None:
    """98 304 samples of 6 chips: 4.5 standard errors, 7e-6 a figure, and 2 % for Poisson's skewness."""
    sensor = camera(gain, read_noise_e=8.0, dsnu_e=5.0, dark_current_e_per_s=3000.0)
    light_e = part * (WELL_E / gain - 300.0)
    field = np.full((1, 1), light_e)
    moments, samples = frame_moments(field, resolve(sensor, field, TIME_S)), drawn(sensor, light_e)
    variance = moments.variance_e2[0, 0]
    assert samples.mean() == pytest.approx(moments.mean_e[0, 0], abs=4.5 * np.sqrt(variance / samples.size) + 0.2)
    assert samples.var() == pytest.approx(variance, rel=4.5 * np.sqrt(2 / samples.size) + 0.02)
    assert noise_variance(field, sensor, TIME_S)[0, 0] == variance


def test_a_preset_s_unclipped_variance_is_a_quarter_too_large_at_98_per_cent_of_the_well_and_twice_at_99() -> None:
    sensor = preset("low_noise", "bayer")
    for part, excess in ((0.985, 0.24), (0.995, 0.93)):
        light_e = part * sensor.pixel.full_well_e
        field = np.full((1, 1), light_e)
        variance = drawn(sensor, light_e).var()
        too_large = unclipped_variance(field, resolve(sensor, field, TIME_S))[0, 0] / variance - 1
        assert too_large == pytest.approx(excess, rel=0.15)
        assert noise_variance(field, sensor, TIME_S)[0, 0] == pytest.approx(variance, rel=0.04)


def test_samples_at_a_black_level_of_0_are_half_a_gaussian() -> None:
    sensor = replace(camera(read_noise_e=10.0, dsnu_e=0.0), black_level_dn=0)
    field = np.zeros((1, 1))
    moments = frame_moments(field, resolve(sensor, field, TIME_S))
    assert moments.mean_e[0, 0] == pytest.approx(10.0 / np.sqrt(2 * np.pi))
    rounding_e2 = sensor.gain_e_per_dn**2 / 12 / 2
    assert moments.variance_e2[0, 0] == pytest.approx(10.0**2 * (1 / 2 - 1 / (2 * np.pi)) + rounding_e2)
    samples = drawn(sensor, 0.0)
    assert samples.mean() == pytest.approx(moments.mean_e[0, 0], rel=0.01)
    assert samples.var() == pytest.approx(moments.variance_e2[0, 0], rel=0.03)


def test_each_channel_clips_at_its_own_well() -> None:
    sensor = with_channel_readings(low_noise(), [ChannelReading("W", time_share=0.25)])
    light = np.full((8, 8), 15_000.0)
    moments = frame_moments(light, resolve(sensor, light, TIME_S))
    white = mask(sensor.cfa, "W", light.shape)
    assert moments.slope[white] == pytest.approx(1.0)
    assert moments.slope[~white] == pytest.approx(0.5, abs=3e-3)  # less what reads over the top by its noise
    np.testing.assert_allclose(moments.mean_e[white], 15_000.0)


@pytest.mark.parametrize("bend", [0.0, 0.1, -0.1])
@pytest.mark.parametrize("gain", [1.0, 4.0])
def test_the_slope_is_how_the_mean_grows_with_light(bend: float, gain: float) -> None:
    """By differences of 2 e-, from black at 0 to over the well; that noise grows as well adds 0.4 / (2 x 20 e-)."""
    sensor = replace(camera(gain, response_bend=bend, read_noise_e=20.0), black_level_dn=0)
    light_e = np.array([[0.0, 3.0, 10.0, 300.0], [1400.0, 1500.0, 1600.0, 3000.0], [5800.0, 5950.0, 6000.0, 6100.0]])
    readings = resolve(sensor, light_e, TIME_S)
    at, above, under = (frame_moments(light_e + off, readings) for off in (0.0, 1.0, -1.0))
    assert at.slope == pytest.approx((above.mean_e - under.mean_e) / 2, abs=0.02)


def test_a_merge_has_the_light_s_mean_its_own_variance_and_a_slope_of_1() -> None:
    light_e = np.array([[10.0, 100.0], [1000.0, 5000.0]])
    readings = resolve(preset("dual_gain"), light_e, TIME_S)
    moments = frame_moments(light_e, readings)
    assert np.array_equal(moments.mean_e, light_e)
    assert np.array_equal(moments.variance_e2, noise_variance(light_e, preset("dual_gain"), TIME_S))
    assert (moments.slope == 1).all()


def test_where_nothing_clips_all_variances_are_the_same_and_beside_the_well_light_is_told_worse() -> None:
    sensor = camera()
    for light_e, least in ((50.0, 1.0), (3000.0, 1.0), (0.985 * WELL_E, 1.02), (0.999 * WELL_E, 1.2)):
        field = np.full((1, 1), light_e)
        readings = resolve(sensor, field, TIME_S)
        unclipped = unclipped_variance(field, readings)[0, 0]
        told = light_variance(field, readings)[0, 0]
        if least == 1.0:
            assert noise_variance(field, sensor, TIME_S)[0, 0] == pytest.approx(unclipped, rel=1e-9)
            assert told == pytest.approx(unclipped, rel=1e-9)
        else:
            assert told > least * unclipped
