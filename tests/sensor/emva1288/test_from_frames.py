"""Photon transfer of flat and dark frames: coverage of its intervals, and frames that it refuses."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from loop import loop
from refusal import refusal

from sensor.capture import expose
from sensor.cfa import BAYER
from sensor.device import draw_device
from sensor.emva1288.from_frames import NORMAL_95, figures_of_frames
from sensor.presets import low_noise

RUNS = 200


def chip(**pixel):
    sensor = low_noise("bayer")
    return replace(sensor, pixel=replace(sensor.pixel, **{"read_noise_e": 3.0, "dsnu_e": 2.0, "prnu": 0.01, **pixel}))


def bench(sensor, seed, shape=(96, 96)):
    """Draw frames of one chip at a light [e-], which may be a picture."""
    device, rng = draw_device(sensor, shape, np.random.default_rng([seed, 0])), np.random.default_rng([seed, 1])
    return lambda light_e, count: [
        expose(np.broadcast_to(np.float64(light_e), shape), sensor, 0.01, device, rng, exact=True).dn
        for _ in range(count)
    ]


def measure(sensor, frames, *, bright=4):
    # Three lights: of fewer, the interval allows for a change of K that they can't show.
    flats = [*frames(8000.0, bright), *frames(5000.0, 2), *frames(2000.0, 2)]
    return figures_of_frames(flats, frames(0.0, 4), sensor.cfa, sensor.white_dn)


@pytest.mark.thorough
def test_the_intervals_hold_what_was_configured_in_95_of_100_runs_give_or_take_3():
    """A binomial of 200 runs at 0.95 has a standard deviation of 1.5 %: outside 92-98 % with probability 5 %.

    Of K that is the interval by frames and lights: the whole one, which read noise and DSNU in electrons take on,
    allows for a change of K with light too, which this chip hasn't, and holds more.
    """
    sensor = chip()
    truth = {"gain_dn_per_e": 1 / sensor.gain_e_per_dn, "read_noise_e": 3.0, "prnu": 0.01, "dsnu_e": 2.0}
    held, values = dict.fromkeys((*truth, "by frames"), 0), {name: [] for name in truth}
    for seed in range(RUNS):
        found = measure(sensor, bench(sensor, seed, (80, 80)))
        for name, true in truth.items():
            each = getattr(found, name)
            held[name] += each.low <= true <= each.high
            values[name].append(each.value / true)
        error = NORMAL_95 * found.gain_error[0] * found.gain_dn_per_e.value
        held["by frames"] += abs(found.gain_dn_per_e.value - truth["gain_dn_per_e"]) <= error
    assert all(0.92 <= held[name] / RUNS <= 0.98 for name in ("by frames", "prnu")), held
    assert all(held[name] / RUNS >= 0.95 for name in ("gain_dn_per_e", "read_noise_e", "dsnu_e")), held
    for name, each in values.items():  # four standard errors of the mean: once in 15 000 runs
        assert abs(np.mean(each) - 1) < 4 * np.std(each) / np.sqrt(RUNS), name


def test_columns_flicker_and_smooth_shading_do_not_move_the_figures():
    sensor = chip(column_offset_e=0.0)
    shade = 1 + 0.01 * np.linspace(-1, 1, 96)[:, None] - 0.01 * np.linspace(-1, 1, 96)[None, :] ** 2
    frames = bench(sensor, 3)
    flats = [frames(8000.0 * shade * factor, 1)[0] for factor in (1.0, 1.01, 0.995, 1.004)]
    found = figures_of_frames(flats, frames(0.0, 4), BAYER, sensor.white_dn)
    for name, true in (("gain_dn_per_e", 1 / sensor.gain_e_per_dn), ("prnu", 0.01), ("read_noise_e", 3.0)):
        each = getattr(found, name)
        width = each.high - each.low
        assert each.low - width / 2 <= true <= each.high + width / 2, name  # twice the interval: once in 1e4 runs


def test_one_pair_and_a_monochrome_chip_are_enough():
    sensor = replace(chip(), cfa=("W",))
    frames = bench(sensor, 5)
    found = figures_of_frames(frames(6000.0, 2), frames(0.0, 2), ("W",), sensor.white_dn)
    assert found.gain_dn_per_e.value * sensor.gain_e_per_dn == pytest.approx(1.0, abs=0.1)
    assert found.levels_dn.shape == (1, 1)
    assert found.frames == (2, 2)


def test_notes_tell_how_far_the_light_drifted_and_how_much_of_the_dark_is_cut_off():
    """Of the brightest stack, whose frames differ by 1.4 %; 4 of the 2304 pixels of a site read 0 in all frames."""
    sensor = chip()
    frames = bench(sensor, 6)
    bright = [frames(8000.0 * factor, 1)[0] for factor in (1.0, 1.01, 0.996)]
    flats, darks = [*bright, *frames(5000.0, 2), *frames(2000.0, 2)], frames(0.0, 4)
    for dark in darks:
        dark[0:8:2, 1] = 0
    darks[0][10:16:2, 1] = 0  # once only: noise, and no pixel that is cut off
    notes = "; ".join(figures_of_frames(flats, darks, BAYER, sensor.white_dn).notes)
    means = [float(frame.mean()) for frame in bright]
    assert f"it changed by {(max(means) - min(means)) / np.mean(means):.2%} at most" in notes
    assert f"{4 / 2304:.2%} of its pixels read 0 in all frames" in notes


def test_a_chip_without_fixed_patterns_has_intervals_that_begin_at_0():
    sensor = chip(prnu=0.0, dsnu_e=0.0)
    found = [measure(sensor, bench(sensor, seed)) for seed in range(8)]
    assert sum(each.prnu.low == 0.0 for each in found) >= 6
    assert all(each.prnu.high < 0.003 for each in found)


def test_an_interval_reaches_as_far_up_as_down_and_roots_do_by_their_squares():
    """Of K 1.96 of its whole standard error, which is told in parts; of a root the ends of its variance's interval."""
    sensor = chip()
    found = measure(sensor, bench(sensor, 4))
    gain, parts = found.gain_dn_per_e, np.hypot(*found.gain_error)
    assert gain.high / gain.value - 1 == pytest.approx(1.959964 * parts, rel=1e-6)
    assert gain.value - gain.low == pytest.approx(gain.high - gain.value, rel=1e-9)
    for each in (found.read_noise_e, found.dsnu_e, found.prnu):
        assert 0 < each.low < each.value < each.high
        assert each.value**2 - each.low**2 == pytest.approx(each.high**2 - each.value**2, rel=1e-9)


@cache
def bad_frames():
    sensor = chip()
    frames = bench(sensor, 1)
    flat, dark = frames(6000.0, 2), frames(0.0, 2)
    edge = np.where(np.arange(96) < 48, 6000.0, 5600.0)
    picture = 6000.0 * (1 + 0.3 * np.sin(np.arange(96) / 9.0))
    return {
        "no flat": ([], dark, "flat frames: 0 given"),
        "one flat": (flat[:1], dark, "flat frames: 1 given"),
        "one dark": (flat, dark[:1], "dark frames: 1 given"),
        "other shape": (flat, [frame[:90] for frame in dark], "their shapes differ"),
        "too small": ([frame[:8, :8] for frame in flat], [frame[:8, :8] for frame in dark], "too few"),
        "no pair": ([*flat, *frames(3000.0, 1)], dark, "flat frame 3: its mean"),
        "an edge": (frames(edge, 2), dark, "they are not flat"),
        "a picture": (frames(picture, 2), dark, "they are not flat"),
        "clipped": (frames(15_500.0, 2), dark, "where they are clipped"),
        "all near white": (frames(13_000.0, 2), dark, "over 70% of white"),
        "no black": (flat, [np.zeros_like(frame) for frame in dark], "dark frame 1: 100.00% of its pixels read 0 DN"),
        "sorted wrongly": (dark, flat, "is not over the dark frames'"),
        "the same twice": ([flat[0], flat[0]], dark, "can't be told from 0"),
    }


@loop("name", bad_frames())
def test_frames_that_are_not_flat_or_not_frames_of_a_bench_are_refused_in_one_line(name):
    flats, darks, words = bad_frames()[name]
    assert words in refusal(figures_of_frames, flats, darks, BAYER, chip().white_dn)
