"""The light for an SNR: shot noise by hand, a pixel read out many times, and where no light is enough."""

from dataclasses import replace
from math import inf, pi

import numpy as np
import pytest
from refusal import refusal

from sensor.capture import expose
from sensor.config import with_channel_readings
from sensor.device import draw_device
from sensor.photodiodes import binned
from sensor.pixel import ChannelReading
from sensor.presets import low_noise, preset, table1_output
from sensor.readings.resolve import chip_readings
from studies.metrics.truth import named_light
from studies.paper.setup import shot_noise_alone
from studies.photograph.snr import channel_e, electrons_at_snr, light_for_snr, snr, snr_at

EXPOSURE_S = 0.033


def test_shot_noise_alone_takes_the_square_of_the_snr() -> None:
    quiet = shot_noise_alone(low_noise())
    quiet = replace(quiet, pixel=replace(quiet.pixel, dark_current_e_per_s=0.0))
    step = quiet.gain_e_per_dn**2 / 12
    # e / sqrt(e + step) = 10
    assert electrons_at_snr(10.0, quiet, EXPOSURE_S) == pytest.approx(50 + np.sqrt(2500 + 100 * step), rel=1e-9)


def test_a_channel_is_asked_for_where_channels_are_read_apart_and_has_to_be_the_mosaic_s() -> None:
    electrons = np.array([100.0])
    refusal(snr, electrons, preset("white_apart"), EXPOSURE_S, match="channel: none given for a camera that reads")
    refusal(snr, electrons, low_noise(), EXPOSURE_S, "Q", match="channel: 'Q' is unknown; allowed: B, G, R, W")


def test_a_channel_that_is_read_apart_has_its_snr_at_its_light() -> None:
    apart = with_channel_readings(low_noise(), [ChannelReading(channel="W", time_share=0.25)])
    for channel in ("W", "G"):
        electrons = electrons_at_snr(10.0, apart, EXPOSURE_S, channel)
        assert snr(np.array([electrons]), apart, EXPOSURE_S, channel) == pytest.approx(10.0, rel=1e-9)


def test_a_well_that_dark_current_fills_has_no_snr() -> None:
    """Light of 60 % of the well, and dark electrons of 50 % in the exposure."""
    sensor = low_noise("bayer")
    well_e = sensor.pixel.full_well_e
    hot = replace(sensor, pixel=replace(sensor.pixel, dark_current_e_per_s=0.5 * well_e / EXPOSURE_S))
    green_e = channel_e(sensor, named_light("D65"), 1.0, EXPOSURE_S)[1]
    light = np.array([0.4, 0.6]) * well_e / green_e
    assert np.isnan(snr_at(light, hot, "D65", EXPOSURE_S)["G"]).tolist() == [False, True]
    assert np.isnan(snr_at(light, sensor, "D65", EXPOSURE_S)["G"]).tolist() == [False, False]
    assert electrons_at_snr(0.999 * snr(np.array([[0.51 * well_e]]), hot, EXPOSURE_S)[0, 0], hot, EXPOSURE_S) == inf


def test_light_and_dark_current_of_several_readings_fit_the_well_together() -> None:
    """Half the well is dark current: light of less than the other half has an SNR, more hasn't."""
    for sensor in map(preset, ("split_pixel", "staggered", "dual_gain")):
        well_e = sensor.pixel.full_well_e
        hot = replace(sensor, pixel=replace(sensor.pixel, dark_current_e_per_s=0.5 * well_e / EXPOSURE_S))
        below, beyond = (float(snr(np.array([[share * well_e]]), hot, EXPOSURE_S)[0, 0]) for share in (0.49, 0.51))
        assert electrons_at_snr(below, hot, EXPOSURE_S) == pytest.approx(0.49 * well_e, rel=1e-4)
        assert electrons_at_snr(beyond, hot, EXPOSURE_S) == inf


@pytest.mark.thorough
def test_a_ratio_is_told_up_to_the_deepest_reading_and_the_least_light_is_taken() -> None:
    """A switched camera has its SNR in the gain that it reads such light with; of two such lights the dimmer one."""
    deep = preset("dual_gain")
    wells_e = sorted(reading.full_well_e for reading in deep.chip.readings)
    green_e = channel_e(deep, named_light("D65"), 1.0, EXPOSURE_S)[1]
    light = np.array([0.5 * wells_e[0], 2.0 * wells_e[0], 1.2 * wells_e[1]]) / green_e
    assert np.isnan(snr_at(light, deep, "D65", EXPOSURE_S)["G"]).tolist() == [False, False, True]
    switched = replace(deep, chip=replace(deep.chip, readout="switched"))
    light_e = np.geomspace(1.0, wells_e[1], 4000)
    ratios = snr(light_e[None], switched, EXPOSURE_S)[0]
    falls = int(np.flatnonzero(np.diff(ratios) < 0)[0])  # where the other gain takes over, with more noise
    for ratio in (3.0, float(ratios[falls : falls + 2].mean())):
        least_e = light_e[ratios >= ratio].min()
        assert electrons_at_snr(ratio, switched, EXPOSURE_S) == pytest.approx(least_e, rel=0.003)
    assert light_e[falls + 1 :][ratios[falls + 1 :] >= ratio].min() > 1.006 * least_e, "there are two such lights"


def test_beyond_fixed_patterns_or_the_well_no_light_is_enough() -> None:
    sensor = low_noise()
    assert electrons_at_snr(1.01 / sensor.pixel.prnu, sensor, EXPOSURE_S) == inf
    assert electrons_at_snr(1.01 * sensor.pixel.full_well_e**0.5, shot_noise_alone(sensor), EXPOSURE_S) == inf


def test_a_short_exposure_takes_as_much_more_light() -> None:
    """A ten-thousandth of the time, in which 1 cd/m^2 gives less than an electron, needs 10 000 times the light."""
    sensor = table1_output()
    sensor = replace(sensor, pixel=replace(sensor.pixel, dark_current_e_per_s=0.0, hot_pixel_share=0.0))
    assert channel_e(sensor, named_light("A"), 1.0, 1e-6).max() < 1.0
    for long, short in zip(*(light_for_snr(10.0, sensor, "A", time_s) for time_s in (1e-2, 1e-6)), strict=True):
        assert short.electrons == pytest.approx(long.electrons, rel=1e-9)
        assert short.luminance_cd_m2 == pytest.approx(1e4 * long.luminance_cd_m2, rel=1e-9)


def test_light_and_electrons_belong_together() -> None:
    sensor = table1_output()
    found = {each.channel: each for each in light_for_snr(10.0, sensor, "A", EXPOSURE_S)}
    assert list(found) == ["R", "G", "B", "W"]
    electrons = channel_e(sensor, named_light("A"), found["G"].luminance_cd_m2, EXPOSURE_S)
    assert electrons[1] == pytest.approx(found["G"].electrons, rel=1e-3)
    assert found["W"].illuminance_lux == pytest.approx(found["W"].luminance_cd_m2 * pi / 0.18)
    assert found["W"].luminance_cd_m2 < found["G"].luminance_cd_m2
    drawn = snr_at(np.array([found["G"].luminance_cd_m2, 1e7]), sensor, "A", EXPOSURE_S)["G"]
    assert drawn[0] == pytest.approx(10.0, rel=1e-6)
    assert np.isnan(drawn[1])


@pytest.mark.sample(1)
@pytest.mark.parametrize("binning", ["charge", "digital"])
def test_four_pixels_that_bin_take_a_quarter_of_the_light_and_their_read_noise_once_or_twice(binning) -> None:
    """Without fixed patterns and dark current: e^2 / (e + dark^2) = SNR^2, of the sum's own electrons."""
    sensor = low_noise("quad_bayer")
    quiet = replace(
        sensor.pixel, prnu=0.0, dsnu_e=0.0, dark_current_e_per_s=0.0, read_noise_e=10.0, column_gain_spread=0.0
    )
    plain = replace(sensor, pixel=quiet)
    quad = binned(plain, binning)
    roundings_e2 = 4 * plain.gain_e_per_dn**2 / 12 if binning == "digital" else quad.gain_e_per_dn**2 / 12
    dark_e2 = (4 if binning == "digital" else 1) * 100.0 + roundings_e2
    one, four = (next(x for x in light_for_snr(5.0, s, "D65", EXPOSURE_S) if x.channel == "G") for s in (plain, quad))
    assert four.electrons == pytest.approx(12.5 + np.sqrt(12.5**2 + 25 * dark_e2), rel=1e-9)
    assert four.luminance_cd_m2 / one.luminance_cd_m2 == pytest.approx(four.electrons / (4 * one.electrons), rel=1e-9)
    read = []
    for chip in range(60):
        device = draw_device(quad, (40, 40), np.random.default_rng([chip, 0]))
        light_e = np.full((40, 40), four.electrons / 4)
        read.append(expose(light_e, quad, EXPOSURE_S, device, np.random.default_rng([chip, 1]), exact=True).electrons)
    # 24 000 sums: a deviation's standard error is 0.46 %; within 4.5, false-alarm rate 7e-6
    assert four.electrons / np.std(read) == pytest.approx(5.0, rel=4.5 * 0.0046)


def test_a_camera_that_switches_its_gain_takes_each_light_as_a_frame_of_its_own() -> None:
    """Dim and bright light, of one frame read with one gain: the dim one's noise would be the low gain's."""
    sensor = preset("dual_gain")
    sensor = replace(sensor, chip=replace(sensor.chip, readout="switched"))
    light_e = np.array([[10.0, 8e3]])
    for number, (index, together) in enumerate(zip((0, 1), snr(light_e, sensor, EXPOSURE_S)[0], strict=True)):
        alone = chip_readings(sensor, EXPOSURE_S)[index].sensor
        assert together == pytest.approx(float(snr(light_e[:, [number]], alone, EXPOSURE_S)[0, 0]), rel=1e-12)


def test_no_light_reaches_an_snr_that_lies_beyond_the_well_beside_dark_current() -> None:
    """Dark current takes 10 000 of 15 000 e-: 5000 e- of light have an SNR of 38, 8000 would have 51."""
    sensor = low_noise("bayer")
    hot = replace(sensor, pixel=replace(sensor.pixel, dark_current_e_per_s=1e5))
    assert 3000 < electrons_at_snr(33.0, hot, 0.1, "G") < 5000
    assert electrons_at_snr(45.0, hot, 0.1, "G") == float("inf")
