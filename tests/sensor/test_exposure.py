"""Exposure times: automatic by a stated rule, and bracketed."""

from dataclasses import replace

import numpy as np
import pytest
from builders import any_order
from loop import loop
from refusal import refusal

from sensor.cfa import mask
from sensor.config import LONGEST_S
from sensor.exposure import (
    at_level_s,
    auto_exposure_s,
    best_exposure,
    exposure_by_rule_s,
    exposure_of_electrons_s,
    picture_error,
)
from sensor.optics import SpectralIrradiance
from sensor.photodiodes import binned
from sensor.pixel import ChannelReading, Chip
from sensor.presets import preset
from sensor.response import behind_filters, channel_electrons

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


def left(prior, variance_e2, electrons, samples=1):
    """Variance that so many samples leave of a relative deviation: the inverse of the sum of precisions."""
    return 1 / (1 / prior**2 + samples * electrons**2 / variance_e2)


@loop("read_noise_e", [0.0, 30.0])
def test_error_of_a_flat_field_in_closed_form(read_noise_e):
    """All sites are the brightest: each weighs 1. R, G, B tell the colour by the samples of four tiles."""
    sensor = ideal(read_noise_e)
    dark_e2 = read_noise_e**2 + sensor.gain_e_per_dn**2 / 12
    found = picture_error(tiles(1000.0), sensor, 1.0)
    colour = np.mean([left(0.2, e + dark_e2, e, samples=4) for e in (500.0, 500.0, 1000.0)])
    detail = np.mean([left(0.3, e + dark_e2, e) for e in (500.0, 500.0, 1000.0, 5000.0)])
    assert found == pytest.approx((colour + detail) / 2.4**2, rel=1e-6)
    # Ten times the light fills W, whose detail is lost whole, and nothing else.
    e = np.array([5000.0, 5000.0, 10_000.0])
    known = np.mean(left(0.2, e + dark_e2, e, samples=4)) + left(0.3, e + dark_e2, e).sum() / 4
    assert picture_error(tiles(10_000.0), sensor, 1.0) == pytest.approx((known + 0.3**2 / 4) / 2.4**2, rel=1e-4)


def test_dark_current_leaves_less_of_the_well_to_light():
    """10 500 e- of it leave 4500 of 15 000, which white's 5000 fill: its detail is lost whole."""
    sensor = ideal()
    hot = replace(sensor, pixel=replace(sensor.pixel, dark_current_e_per_s=1000.0))
    dark_e2, e = 10_500 + sensor.gain_e_per_dn**2 / 12, np.array([500.0, 500.0, 1000.0])
    known = np.mean(left(0.2, e + dark_e2, e, samples=4)) + left(0.3, e + dark_e2, e).sum() / 4
    assert picture_error(tiles(1000.0), hot, 10.5) == pytest.approx((known + 0.3**2 / 4) / 2.4**2, rel=1e-3)


def test_a_pixel_that_the_chosen_gain_cannot_hold_tells_nothing():
    """A lamp in 400 dim pixels: the frame is read by the quiet gain, whose well it fills, not the other's."""
    sensor = preset("dual_gain")
    sensor = replace(sensor, chip=replace(sensor.chip, readout="switched"))
    quiet, deep = sorted(reading.full_well_e for reading in sensor.chip.readings)
    lamp, more = np.full((20, 20), 10.0), np.full((20, 20), 10.0)
    lamp[7, 7], more[7, 7] = (quiet + deep) / 2, 0.9 * deep
    assert picture_error(lamp, sensor, 0.01) == pytest.approx(picture_error(more, sensor, 0.01), rel=0.02)


def test_where_nothing_is_full_the_longest_time_wins_and_a_flat_field_fills_no_channel():
    sensor = ideal()
    assert best_exposure(tiles(1.0), sensor, 12_000.0, longest_s=5.0)[0] == 5.0
    time_s = best_exposure(tiles(3500.0), sensor, 12_000.0 / 3500.0, 1e6)[0]
    assert 0.4 < 5 * 3500.0 * time_s / 15_000.0 < 1.0  # of white's well


def test_a_red_picture_fills_no_channel_of_either_mosaic():
    """Red surfaces beside a grey card, by the mosaic's own time: where green decides, red is full in most of them."""
    rng = np.random.default_rng(5)
    red = np.array([5.0, 1.0, 0.5, 8.0]) * rng.uniform(100.0, 1000.0, (64, 64, 1))
    for cfa in ("bayer", "rgbw"):
        sensor = preset("low_noise", cfa)
        per_second_e = red[..., [list("RGBW").index(name) for name in sensor.channels]]
        shares = {}
        for rule in ("auto", "auto:information"):
            time_s = exposure_of_electrons_s(rule, per_second_e, sensor, 1e6)
            full = behind_filters(per_second_e, sensor) * time_s > sensor.pixel.full_well_e
            shares[rule] = full[mask(sensor.cfa, "R", full.shape)].mean()
        assert shares["auto"] > 0.5
        assert shares["auto:information"] < 0.01


def test_the_time_is_the_rung_of_least_error():
    rng, sensor = np.random.default_rng(8), preset("low_noise")
    for spread in (0.3, 1.0, 2.0):
        frame = tiles(*np.exp(rng.normal(5.0, spread, 300)))
        green_s = 12_000.0 / np.percentile(frame, 99)
        found = best_exposure(frame, sensor, green_s, 1e6)[0]
        rungs = green_s * 2.0 ** (-np.arange(-6, 19) / 3)
        errors = [picture_error(frame * time_s, sensor, time_s) for time_s in rungs]
        assert found == pytest.approx(rungs[np.argmin(errors)], rel=1e-12)


def test_rules_by_name():
    sensor, bayer = preset("low_noise"), preset("low_noise", "bayer")
    light = ramp()
    for_green, for_white = (auto_exposure_s(light, sensor, 1e6, channel=channel) for channel in "GW")
    assert exposure_by_rule_s("auto", light, sensor, 1e6) == for_green
    assert exposure_by_rule_s("auto:W", light, sensor, 1e6) == for_white < for_green / 4
    assert for_white / 2 < exposure_by_rule_s("auto:information", light, sensor, 1e6) < for_green / 2
    for rule in ("auto", "auto:W"):  # G of three channels in place of four: other products of matrices over the bands
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
