"""Exposure times: automatic by a stated rule, and bracketed."""

from dataclasses import replace

import numpy as np
import pytest
from builders import any_order
from loop import loop
from refusal import refusal

from sensor.chip import ChannelReading, Chip
from sensor.config import LONGEST_S
from sensor.exposure import (
    RULES,
    at_level_s,
    auto_exposure_s,
    exposure_by_rule_s,
    exposure_of_electrons_s,
    information_bits,
    most_informative_s,
)
from sensor.optics import SpectralIrradiance
from sensor.photodiodes import binned
from sensor.presets import preset
from sensor.response import channel_electrons

NM = np.arange(385.0, 780.0, 10.0)


def ramp(peak=1.0):
    """Irradiance that rises evenly over 101 pixels, so that percentiles are whole pixels."""
    values = np.linspace(0, peak, 101)[None, :, None] * np.ones((2, 1, NM.size))
    return SpectralIrradiance(values, NM, 2.2)


@loop("channel", ["R", "G", "B", "W"])
@loop("percentile", [50.0, 99.0, 100.0])
@loop("well_share", [0.25, 1.0])
def test_the_stated_percentile_of_the_stated_channel_is_put_at_the_stated_share(channel, percentile, well_share):
    sensor = preset("low_noise")
    exposure_s = auto_exposure_s(ramp(), sensor, 1e6, channel=channel, percentile=percentile, well_share=well_share)
    electrons = channel_electrons(ramp(), sensor, exposure_s)[0, int(percentile), "RGBW".index(channel)]
    assert electrons == pytest.approx(well_share * 15_000.0, rel=1e-9)


def test_the_default_is_the_99th_percentile_of_green_at_80_per_cent():
    sensor = preset("low_noise")
    expected = auto_exposure_s(ramp(), sensor, 1e6, channel="G", percentile=99.0, well_share=0.8)
    assert auto_exposure_s(ramp(), sensor, 1e6) == expected


def test_dim_light_gets_the_longest_time_and_no_light_too():
    sensor = preset("low_noise")
    assert auto_exposure_s(ramp(1e-9), sensor) == LONGEST_S
    assert auto_exposure_s(ramp(0.0), sensor, 0.5) == 0.5


@loop(
    ("arguments", "words"),
    [
        ({"longest_s": 0.0}, "longest_s: 0.0"),
        ({"longest_s": np.nan}, "longest_s: nan"),
        ({"percentile": 101.0}, "percentile: 101.0"),
        ({"well_share": 0.0}, "well_share: 0.0"),
        ({"well_share": 1.1}, "well_share: 1.1"),
        ({"channel": "Y"}, "exposure: channel: 'Y' is unknown; allowed: B, G, R, W"),
    ],
)
def test_a_rule_that_cannot_be_is_refused_in_one_line(arguments, words):
    assert words in refusal(auto_exposure_s, ramp(), preset("low_noise"), **arguments)


@loop(("rule", "channel"), [("auto", "G"), ("auto:W", "W")])
def test_light_and_dark_current_fill_the_well_together(rule, channel):
    """Share of the pixel's light and of its dark current that a well holds which a rule looks at, and the well."""
    light_e, dark_e = np.array([400.0, 1000.0, 500.0, 3000.0]), 2000.0
    split = replace(preset("split_pixel").pixel, dark_current_e_per_s=dark_e)
    plain = replace(preset("low_noise").pixel, dark_current_e_per_s=dark_e)
    quad = replace(preset("low_noise", "quad_rgbw"), pixel=plain)
    density = ChannelReading(channel, time_share=0.5, light_share=0.2)
    cameras = (
        (replace(preset("low_noise"), pixel=plain), 1.0, 1.0, 15_000.0),
        (replace(preset("low_noise"), pixel=plain, chip=Chip(channels=(density,))), 0.1, 0.5, 15_000.0),
        (replace(preset("split_pixel"), pixel=split), 1 / 1.1, 1 / 1.1, 22_000.0),
        (binned(quad, "charge"), 4.0, 4.0, 60_000.0),
    )
    for sensor, of_light, of_dark, well_e in cameras:
        frame = np.broadcast_to(light_e, (4, 4, 4))
        exposure_s = exposure_of_electrons_s(rule, frame, sensor, 1e3)
        filling_e = of_light * light_e["RGBW".index(channel)] + of_dark * dark_e
        assert exposure_s * filling_e == pytest.approx(0.8 * well_e, rel=1e-12)
        brighter_s = exposure_of_electrons_s(rule, 7 * frame, sensor, 1e3)
        assert at_level_s(exposure_s, 7.0, rule, sensor) == pytest.approx(brighter_s, rel=1e-12)
        assert exposure_of_electrons_s(rule, 0 * frame, sensor, 1e3) == pytest.approx(0.8 * well_e / of_dark / dark_e)


def test_a_mosaic_without_green_is_exposed_for_its_unit():
    sensor = preset("low_noise", "rccc")
    refusal(auto_exposure_s, ramp(), sensor, channel="G", match=r"'G' is unknown; allowed: C, R")
    assert auto_exposure_s(ramp(), sensor) == auto_exposure_s(ramp(), sensor, channel="C") > 0
    assert auto_exposure_s(ramp(), sensor) != auto_exposure_s(ramp(), sensor, channel="R")


def ideal(read_noise_e=0.0):
    """RGBW camera of 15 000 e- whose noise is the light's, the reading's and a rounding's that is nothing beside."""
    sensor = preset("low_noise")
    pixel = replace(sensor.pixel, read_noise_e=read_noise_e, dsnu_e=0.0, prnu=0.0, dark_current_e_per_s=0.0)
    return replace(sensor, pixel=pixel)


def tiles(*lights):
    """Electrons in a second of a row of 2x2 tiles, R G over B W; a light is the electrons of G."""
    tile = np.array([[0.5, 1.0], [0.5, 5.0]])
    return np.hstack([light * tile for light in lights])


def bits(*electrons, dark_e2=0.0):
    """Information of samples, in numbers."""
    return sum(0.5 * np.log2(1 + e * e / (e + dark_e2)) for e in electrons)


@loop("read_noise_e", [0.0, 30.0])
def test_information_of_a_flat_tile_in_closed_form(read_noise_e):
    sensor = ideal(read_noise_e)
    rounding = sensor.gain_e_per_dn**2 / 12
    dark_e2 = read_noise_e**2 + rounding
    found = information_bits(tiles(1000.0), sensor, 1.0)
    assert found == pytest.approx(bits(500, 500, 1000, 5000, dark_e2=dark_e2) / 4, rel=1e-9)
    # the same light three times as long fills W: its bits are gone
    found = information_bits(tiles(3000.0), sensor, 1.0)
    assert found == pytest.approx(bits(1500, 1500, 3000, dark_e2=dark_e2) / 4, rel=1e-9)


def test_dark_current_leaves_less_of_the_well_to_light():
    """10 500 e- of it leave 4500 of 15 000, which white's 5000 fill."""
    sensor = ideal()
    sensor = replace(sensor, pixel=replace(sensor.pixel, dark_current_e_per_s=1000.0))
    expected = bits(500, 500, 1000, dark_e2=10_500 + sensor.gain_e_per_dn**2 / 12) / 4
    assert information_bits(tiles(1000.0), sensor, 10.5) == pytest.approx(expected, rel=1e-9)


def test_a_pixel_that_the_chosen_gain_cannot_hold_tells_nothing():
    """A lamp in 400 dim pixels: the frame is read by the quiet gain, whose well it fills, not the other's."""
    sensor = preset("dual_gain")
    sensor = replace(sensor, chip=replace(sensor.chip, readout="switched"))
    quiet, deep = sorted(reading.full_well_e for reading in sensor.chip.readings)
    dim, lamp = np.full((20, 20), 10.0), np.full((20, 20), 10.0)
    dim[7, 7], lamp[7, 7] = 0.0, (quiet + deep) / 2
    assert information_bits(lamp, sensor, 0.01) == pytest.approx(information_bits(dim, sensor, 0.01), rel=1e-9)


def test_where_nothing_is_full_the_longer_time_wins_and_where_only_w_counts_the_shorter():
    sensor = ideal()
    assert most_informative_s(tiles(100.0), sensor, (5.0, 1.0)) == 5.0
    assert most_informative_s(tiles(100.0), sensor, (1.0, 5.0)) == 5.0
    # a flat field whose W is full at 1 s: four channels beat three, each with half a bit an octave more
    assert most_informative_s(tiles(3500.0), sensor, (1.0, 0.8)) == 0.8
    assert most_informative_s(tiles(3500.0), sensor, (1.0, 1.0)) == 1.0


@loop("read_noise_e", [0.0, 10.0, 30.0])
def test_the_share_of_full_w_at_which_the_times_are_equal_is_the_closed_forms(read_noise_e):
    # Two levels: tiles of G 6000 a second, whose W is full at 1 s, and of 60, whose W never is.
    sensor = ideal(read_noise_e)
    dark_e2 = read_noise_e**2 + sensor.gain_e_per_dn**2 / 12
    of = lambda *electrons: bits(*electrons, dark_e2=dark_e2)  # noqa: E731
    lost = of(600, 600, 1200, 6000) - of(3000, 3000, 6000)  # of a bright tile, by 1 s in place of 0.2: negative is won
    won = of(30, 30, 60, 300) - of(6, 6, 12, 60)
    equal = won / (lost + won)
    assert 0.1 < equal < 0.9
    for share, best in ((equal - 0.02, 1.0), (equal + 0.02, 0.2)):
        bright = round(200 * share)
        row = tiles(*[6000.0] * bright, *[60.0] * (200 - bright))
        assert most_informative_s(row, sensor, (1.0, 0.2)) == best


def test_rules_by_name():
    sensor, bayer = preset("low_noise"), preset("low_noise", "bayer")
    light = ramp()
    for_green, for_white = (auto_exposure_s(light, sensor, 1e6, channel=channel) for channel in "GW")
    assert exposure_by_rule_s("auto", light, sensor, 1e6) == for_green
    assert exposure_by_rule_s("auto:W", light, sensor, 1e6) == for_white < for_green / 4
    assert exposure_by_rule_s("auto:information", light, sensor, 1e6) in (for_green, for_white)
    for rule in RULES:  # G of three channels in place of four: other products of matrices over the bands
        assert exposure_by_rule_s(rule, light, bayer, 1e6) == pytest.approx(for_green, rel=any_order(NM.size))
    refusal(
        exposure_by_rule_s, "auto:w", light, sensor, match=r"exposure: 'auto:w' is unknown; .*did you mean 'auto:W'"
    )


@loop("rule", ["auto", "auto:W", "auto:information"])
def test_electrons_that_are_there_already_give_the_rules_time(rule):
    rng, sensor = np.random.default_rng(4), preset("low_noise")
    light = SpectralIrradiance(rng.random((16, 16, 40)) * 1e-3, np.arange(385.0, 780.0, 10.0), 2.2)
    per_second_e = channel_electrons(light, sensor, 1.0)
    assert exposure_of_electrons_s(rule, per_second_e, sensor) == exposure_by_rule_s(rule, light, sensor)
    # twice the light: half the time, unless the longest one is reached
    by_rule = exposure_of_electrons_s(rule, per_second_e, sensor, 1e6)
    assert exposure_of_electrons_s(rule, 2 * per_second_e, sensor, 1e6) == pytest.approx(by_rule / 2, rel=1e-12)
