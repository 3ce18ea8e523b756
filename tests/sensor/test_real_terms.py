"""Terms of real cameras that no preset has: a bent response, read noise of whole rows and of single traps."""

from dataclasses import replace
from math import comb, factorial

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
from sensor.readout import frame_moments, shared_ramp_e

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


# A ramp that the columns of a row share


def test_a_shared_ramp_reads_what_a_ramp_that_rises_in_small_steps_gives():
    """The ramp falls back by step / columns at each conversion, and rises faster by rise / columns after it."""
    pixel = camera(ramp_step_e=30.0, ramp_rise=0.4).pixel
    signals_e = np.random.default_rng(7).normal(100.0, 20.0, (3, 12))
    expected_e = np.empty_like(signals_e)
    for row, read_e in zip(signals_e, expected_e, strict=True):
        waiting, ramp_e, counter_e, tick_e = list(np.argsort(row)), row.min(), row.min(), 1e-3
        while waiting:
            converted = row.size - len(waiting)
            if ramp_e >= row[waiting[0]]:
                read_e[waiting.pop(0)] = counter_e
                ramp_e -= 30.0 / row.size
            else:
                ramp_e += (1 + 0.4 * converted / row.size) * tick_e
                counter_e += tick_e
    np.testing.assert_allclose(shared_ramp_e(signals_e, pixel), expected_e, atol=0.02)


@loop("exact", (True, False))
@loop("light_e", (0.0, 1000.0, 5000.0))
def test_a_step_of_the_ramp_adds_to_the_noise_of_an_even_field_and_not_to_its_mean(light_e, exact):
    """Normal x with spread s and x + a F(x): variance s^2 + a^2 / 12 + a s / sqrt(pi), as F(x) is even from 0 to 1.

    147 456 samples of 4 chips: 4.5 standard errors, and 1 % for rows of 192 columns in the place of endless ones.
    """
    step_e = 60.0
    sensor = camera(read_noise_e=12.0, ramp_step_e=step_e)
    field = np.full((1, 1), light_e)
    even = replace(sensor, pixel=replace(sensor.pixel, ramp_step_e=0.0))
    plain_e2 = frame_moments(field, resolve(even, field, TIME_S)).variance_e2[0, 0]
    samples = drawn(replace(sensor, black_level_dn=100), light_e, exact=exact)
    expected_e2 = plain_e2 + step_e**2 / 12 + step_e * np.sqrt(plain_e2 / np.pi)
    assert samples.var() == pytest.approx(expected_e2, rel=4.5 * np.sqrt(2 / samples.size) + 0.01)
    assert samples.mean() == pytest.approx(light_e, abs=4.5 * np.sqrt(expected_e2 / samples.size) + 0.4)


def test_a_steeper_ramp_narrows_the_noise_of_bright_columns_alone():
    """Half of the columns are far brighter: the share that has converted is 1/4 at dim ones, 3/4 at bright ones."""
    pixel = camera(ramp_rise=0.5).pixel
    rng = np.random.default_rng(3)
    signals_e = np.concatenate([rng.normal(100.0, 1.0, (400, 100)), rng.normal(5000.0, 1.0, (400, 100))], axis=1)
    read_e = shared_ramp_e(signals_e, pixel)
    dim, bright = read_e[:, :100].std(axis=1).mean(), read_e[:, 100:].std(axis=1).mean()
    assert dim / signals_e[:, :100].std(axis=1).mean() == pytest.approx(1 / 1.125, rel=0.01)
    assert bright / signals_e[:, 100:].std(axis=1).mean() == pytest.approx(1 / 1.375, rel=0.01)
    assert (read_e[:, 100:].mean() - read_e[:, :100].mean()) / 4900.0 == pytest.approx(1 / 1.25, rel=1e-3)


# Random telegraph noise

SHARE, HEIGHT_E, READ_E = 0.1, 12.0, 6.0  # 3.8 of the 6 e- are telegraph noise
STATES = {-2: 1 / 16, -1: 4 / 16, 0: 6 / 16, 1: 4 / 16, 2: 1 / 16}  # of a trap in two frames, four samples


def double_factorial(n):
    return 1 if n < 2 else n * double_factorial(n - 2)


def moment(order, normal_e2):
    """Compute a moment of the difference of two frames, of normal noise with a variance and of the traps' jumps."""
    traps = {0: 1.0}
    for j in range(2, order + 1, 2):  # E a^j of an exponential distribution is j! times the mean's power
        traps[j] = SHARE * factorial(j) * HEIGHT_E**j * sum(share * state**j for state, share in STATES.items())
    normal = {j: double_factorial(j - 1) * normal_e2 ** (j / 2) for j in range(0, order + 1, 2)}
    return sum(comb(order, j) * normal[order - j] * traps[j] for j in range(0, order + 1, 2))


def two_frames(sensor, *, exact, light_e=0.0, seed=0):
    sensor = replace(sensor, black_level_dn=800)  # far above any jump: five deviations would cut some of them off
    device, rng = draw_device(sensor, SHAPE, np.random.default_rng([seed, 0])), np.random.default_rng([seed, 1])
    taken = [expose(np.full(SHAPE, light_e), sensor, TIME_S, device, rng, exact=exact).electrons for _ in range(2)]
    return device, *taken


@loop("exact", (True, False))
def test_telegraph_noise_has_the_tails_of_its_closed_forms_and_leaves_the_read_noise(exact):
    """Second and fourth moment of 147 456 differences within 4.5 exact standard errors: each 6.8e-6, if normal.

    The variance is 2 (read noise^2 + a DN^2 / 12) as without traps. The excess of the fourth moment over three
    variances squared is 60 s A^4 - 12 s^2 A^4.
    """
    sensor = camera(read_noise_e=READ_E, telegraph_share=SHARE, telegraph_e=HEIGHT_E)
    step_e = replace(sensor, black_level_dn=800).gain_e_per_dn
    pairs = [two_frames(sensor, exact=exact, seed=seed)[1:] for seed in range(4)]
    apart = np.concatenate([(first - second).ravel() for first, second in pairs])
    rounded_e2 = READ_E**2 + step_e**2 / 12
    normal_e2 = 2 * (rounded_e2 - sensor.pixel.telegraph_noise_e**2)
    assert moment(2, normal_e2) == pytest.approx(2 * rounded_e2)
    excess = (60 * SHARE - 12 * SHARE**2) * HEIGHT_E**4
    assert moment(4, normal_e2) == pytest.approx(3 * moment(2, normal_e2) ** 2 + excess)
    assert excess > moment(2, normal_e2) ** 2  # tails that can't be missed
    for order in (2, 4):
        error = np.sqrt((moment(2 * order, normal_e2) - moment(order, normal_e2) ** 2) / apart.size)
        assert np.mean(apart**order) == pytest.approx(moment(order, normal_e2), abs=4.5 * error), order


def test_traps_are_in_the_stated_share_of_the_pixels_with_exponential_heights():
    """36 864 pixels of a chip: 4.5 standard errors of the share, and of the mean height and its scatter."""
    sensor = camera(read_noise_e=READ_E, telegraph_share=SHARE, telegraph_e=HEIGHT_E)
    device, *_ = two_frames(sensor, exact=True)
    heights = device.telegraph_e[device.telegraph_e > 0]
    assert heights.size / device.telegraph_e.size == pytest.approx(SHARE, abs=4.5 * np.sqrt(SHARE * 0.9 / 192**2))
    assert heights.mean() == pytest.approx(HEIGHT_E, rel=4.5 / np.sqrt(heights.size))
    assert heights.std() == pytest.approx(HEIGHT_E, rel=4.5 * np.sqrt(2 / heights.size))
    other, *_ = two_frames(sensor, exact=True, seed=1)
    assert abs(np.corrcoef(device.telegraph_e.ravel(), other.telegraph_e.ravel())[0, 1]) < 4.5 / 192


@loop("exact", (True, False))
def test_a_pixel_with_a_trap_reads_three_values(exact):
    """All of the read noise in traps: 1/4, 1/2 and 1/4 of 147 456 readings, within 4.5 standard errors of 0.13 %."""
    sensor = camera(read_noise_e=20.0, telegraph_share=1.0, telegraph_e=20.0)
    states = []
    for seed in range(2):
        device, *frames = two_frames(sensor, exact=exact, seed=seed)
        for frame in frames:
            jump = frame - device.dark_offset_e
            state = np.rint(jump / np.maximum(device.telegraph_e, 1.0))
            assert np.abs(jump - state * device.telegraph_e).max() < 1.001 * max(sensor.gain_e_per_dn / 2, 0.5)
            states.append(state[device.telegraph_e > 4.0])
        assert abs(np.corrcoef(states[-1], states[-2])[0, 1]) < 4.5 / np.sqrt(states[-1].size)  # anew in each frame
    read = np.concatenate(states)
    for state, share in ((-1, 0.25), (0, 0.5), (1, 0.25)):
        assert np.mean(read == state) == pytest.approx(share, abs=4.5 * np.sqrt(0.25 / read.size)), state


@pytest.mark.skipif(backend() == "numpy", reason="one engine alone")
def test_both_engines_draw_the_same_states_of_traps():
    sensor = camera(read_noise_e=4.0, telegraph_share=0.25, telegraph_e=8.0)
    np.testing.assert_array_equal(*(two_frames(sensor, exact=exact)[1:] for exact in (True, False)))


@loop("exact", (True, False))
@loop("absent", ({"telegraph_share": 0.0, "telegraph_e": 5.0}, {"telegraph_share": 0.3, "telegraph_e": 0.0}))
def test_half_a_statement_of_traps_changes_no_bit_and_traps_no_other_pattern(absent, exact):
    plain, without, with_traps = (
        two_frames(camera(read_noise_e=READ_E, column_offset_e=1.0, **terms), exact=exact, light_e=100.0)
        for terms in ({}, absent, {"telegraph_share": 0.05, "telegraph_e": 5.0})
    )
    assert without[0].telegraph_e is None
    np.testing.assert_array_equal(without[1:], plain[1:])
    np.testing.assert_array_equal(with_traps[0].dark_offset_e, plain[0].dark_offset_e)
    np.testing.assert_array_equal(with_traps[0].photo_response, plain[0].photo_response)
    quiet = with_traps[0].telegraph_e == 0  # there the frames differ by what is left of the normal noise alone
    normal = np.sqrt(1 - 0.05 * 5.0**2 / READ_E**2)
    assert np.std((with_traps[1] - plain[1])[quiet]) < 2 * (1 - normal) * READ_E + camera(read_noise_e=1).gain_e_per_dn


@loop(("way", "variance_e2"), (("digital", 4 * 144.0), ("charge", 144.0)))
def test_binned_pixels_have_the_telegraph_noise_of_what_reads_them(way, variance_e2):
    """Four amplifiers whose readings are summed, or the one behind four photodiodes."""
    quad = replace(
        camera(read_noise_e=15.0, telegraph_share=0.25, telegraph_e=24.0), cfa=("RRGG", "RRGG", "GGBB", "GGBB")
    )
    sensor = binned(quad, way)
    assert sensor.pixel.telegraph_noise_e**2 == pytest.approx(variance_e2)
    device = draw_device(sensor, SHAPE, np.random.default_rng(1))
    assert device.telegraph_e.shape == ((96, 96) if way == "charge" else SHAPE)


def test_a_merged_burst_has_more_telegraph_noise_by_the_root_of_its_count():
    four = merged_sensor(camera(read_noise_e=10.0, telegraph_share=0.25, telegraph_e=8.0), 4).pixel
    assert (four.telegraph_share, four.telegraph_noise_e, four.read_noise_e) == (0.25, 8.0, 20.0)


def test_telegraph_noise_beyond_the_read_noise_is_refused():
    beyond = {"read_noise_e": 5.0, "row_noise_e": 4.0, "telegraph_share": 0.25, "telegraph_e": 8.0}
    assert "parts of the read noise" in refusal(camera, **beyond)
    assert "telegraph_share" in refusal(camera, read_noise_e=5.0, telegraph_share=1.5)
    assert camera(**beyond | {"row_noise_e": 3.0}).pixel.telegraph_noise_e == 4.0  # 3, 4, 5: nothing is left
