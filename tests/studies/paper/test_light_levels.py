"""Steps between light levels, and a frame in which W tells nothing."""

from dataclasses import replace
from math import pi

import numpy as np
import pytest

from isp.interleaved.saturation import saturated_fraction
from sensor.cfa import mask
from sensor.config import SensorConfig
from sensor.presets import preset
from sensor.shake import SHAKES, blur_variance, held_lens, shaken
from studies.paper.best_exposure import best_time_s, blur_px
from studies.paper.early import colour_noise, gathered, range_db
from studies.paper.light_levels import LEVELS_CD_M2, largest_step, without_white
from studies.paper.patches import noisy_edge
from studies.paper.setup import table1_sensor


def test_largest_step_is_the_surest_one_and_counts_in_its_direction() -> None:
    values = np.zeros((40, 3))
    values[10:] = -2.0  # a fall of 2 for certain
    values[20:] += [9.0, -3.0, 0.0]  # a rise of 2 on average, which scatters
    level, step = largest_step(values, -1.0)
    assert level == LEVELS_CD_M2[10]
    assert step == pytest.approx(2.0)
    assert largest_step(values, 0.0)[0] == LEVELS_CD_M2[10]
    assert largest_step(values, 1.0)[1].mean() < 2.0 + 1e-12


def test_a_frame_without_white_has_alpha_1_and_its_colours() -> None:
    raw = noisy_edge("table1_output")
    bare = without_white(raw)
    sites = mask(raw.cfa, "W", raw.shape)
    np.testing.assert_array_equal(saturated_fraction(bare), 1.0)
    np.testing.assert_array_equal(bare.dn[~sites], raw.dn[~sites])


@pytest.mark.thorough  # test_told_numbers counts both ends by hand
@pytest.mark.parametrize("mosaic", ["rgbw", "rgbw_nd", "cmyw"])
def test_dynamic_range_read_out_is_that_of_the_closed_form(mosaic: str) -> None:
    closed, measured = range_db(table1_sensor("table1_output", mosaic))
    # SNR from 256^2 pixels at an SNR of 1: its error is 0.5 %, 5 of them 0.22 dB.
    assert measured == pytest.approx(closed, abs=0.3)


@pytest.mark.thorough
def test_matching_w_to_g_costs_just_what_w_gathers_more() -> None:
    rgbw, matched = (range_db(table1_sensor("table1_pixel", mosaic))[0] for mosaic in ("rgbw", "rgbw_nd"))
    assert rgbw - matched == pytest.approx(20 * np.log10(4.88), abs=0.02)  # W over G under D65


@pytest.mark.sample(1)
@pytest.mark.parametrize("processor", ["cmyw_yamagami_published", "rgbw_sato_published"])
def test_colour_noise_read_out_is_that_of_the_closed_form(processor: str) -> None:
    closed, measured = colour_noise("table1_output", processor, 2.5)
    # variance of 2^16 pixels of three channels: relative error of the deviation under 0.4 %, 5 of them
    assert measured == pytest.approx(closed, rel=0.02)


def test_light_of_combined_samples_is_their_number_times_the_colours_share() -> None:
    for closed, measured in gathered(("RG", "BW")).values():
        # neighbours share samples: 2^16 pixels are worth about a fiftieth; 5 standard errors of a variance
        assert measured == pytest.approx(closed, rel=5 * np.sqrt(2 / (2**16 / 50)))
    assert gathered(("RG", "BW"))["R"][0] == pytest.approx(0.86, abs=0.02)


# The best exposure by hand: the optimum of a grating against its closed form, and the parabola that finds it.


PATHS = 300


def by_hand() -> SensorConfig:
    sensor = preset("table1_output")
    return replace(sensor, lens=held_lens(sensor.lens, "hand"))


@pytest.mark.thorough
def test_best_time_of_a_grating_under_shot_noise_is_the_closed_form() -> None:
    """Short times are straight lines of speed v, which take 2 pi^2 f^2 v^2 T^2 / 12 of a grating's amplitude a.

    E[v^4] = 3 s^4, so the squared error is c T^4 + 1 / (r T) with c = a^2 / 2 (2 pi^2 f^2 / 12)^2 3 s^4, and least at
    T^5 = 1 / (4 c r).
    """
    sensor, frequency, amplitude, rate = by_hand(), 1 / 8, 0.9, 3e5
    speed = SHAKES["hand"] / sensor.site_pitch_um * 8 * pi  # pixels a second: 4 Hz
    cost = amplitude**2 / 2 * (2 * pi**2 * frequency**2 / 12) ** 2 * 3 * speed**4
    best_s = (1 / (4 * cost * rate)) ** 0.2
    grating = 1 + amplitude * np.cos(2 * pi * frequency * (np.arange(64) + 0.5))
    still = np.broadcast_to(grating[None, :, None], (8, 64, 1))

    times_s, rng = best_s * 2.0 ** np.arange(-2.0, 2.1, 0.5), np.random.default_rng(0)
    errors = np.zeros(times_s.size)
    for index, time_s in enumerate(times_s):
        for seed in range(PATHS):
            expected_e = shaken(still * rate * time_s, sensor, time_s, np.random.default_rng(seed))
            errors[index] += ((rng.poisson(expected_e) / (rate * time_s) - still) ** 2).mean() / PATHS
    found_s, _ = best_time_s(times_s, -10 * np.log10(errors))
    # v^4 has a relative deviation of 3.3, its mean over the paths 0.19, and the fifth root a fifth of that: 4 of them
    # are 15 %. At this time, 9 ms, the path is a line to 3 % of its variance.
    assert 0.005 < best_s < 0.012
    assert found_s == pytest.approx(best_s, rel=0.17)


def test_the_parabola_goes_through_the_best_time_and_its_two_neighbours_alone() -> None:
    """Of values a, b, c an octave apart the top is (a - c) / (a - 2 b + c) / 2 octaves beside b."""
    times_s = 0.01 * 2.0 ** np.arange(5)
    for at in (1, 2, 3):
        quality = np.full(5, -50.0)
        quality[at - 1 : at + 2] = 10.0, 12.0, 11.0
        offset = (10.0 - 11.0) / (10.0 - 24.0 + 11.0) / 2
        best = 12.0 - (10.0 - 11.0) * offset / 4
        assert best_time_s(times_s, quality) == pytest.approx((times_s[at] * 2**offset, best))


def test_parabola_finds_the_top_between_times_and_an_end_is_that_time() -> None:
    times_s = 0.01 * 2.0 ** np.arange(5)
    quality = 20 - 3 * (np.log(times_s) - np.log(0.047)) ** 2
    assert best_time_s(times_s, quality) == pytest.approx((0.047, 20.0))
    assert best_time_s(times_s, times_s) == (times_s[-1], times_s[-1])
    assert best_time_s(times_s, -times_s) == (times_s[0], -times_s[0])


def test_blur_in_pixels_is_the_hand_s_displacement_over_the_pitch() -> None:
    assert blur_px(by_hand(), 1e4) == pytest.approx(SHAKES["hand"] / 2.2, rel=1e-4)
    assert blur_px(by_hand(), 0.02) == pytest.approx(SHAKES["hand"] / 2.2 * blur_variance(0.02) ** 0.5)
    assert blur_px(preset("table1_output"), 1.0) == 0.0
