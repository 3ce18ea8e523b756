"""Exposure times: automatic by a stated rule, and bracketed."""

import numpy as np
import pytest

from rodcone.errors import InputError
from sensor.exposure import LONGEST_S, auto_exposure_s, bracket_s
from sensor.optics import SpectralIrradiance
from sensor.presets import preset
from sensor.response import channel_electrons

NM = np.arange(385.0, 780.0, 10.0)


def ramp(peak=1.0):
    """Irradiance that rises evenly over 101 pixels, so that percentiles are whole pixels."""
    values = np.linspace(0, peak, 101)[None, :, None] * np.ones((2, 1, NM.size))
    return SpectralIrradiance(values, NM, 2.2)


@pytest.mark.parametrize("channel", ["R", "G", "B", "W"])
@pytest.mark.parametrize("percentile", [50.0, 99.0, 100.0])
@pytest.mark.parametrize("well_share", [0.25, 1.0])
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


def test_twice_the_light_halves_the_time():
    sensor = preset("low_noise")
    assert auto_exposure_s(ramp(2.0), sensor, 1e6) == pytest.approx(auto_exposure_s(ramp(), sensor, 1e6) / 2, rel=1e-12)


@pytest.mark.parametrize(
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
    with pytest.raises(InputError) as error:
        auto_exposure_s(ramp(), preset("low_noise"), **arguments)
    assert words in str(error.value)
    assert "\n" not in str(error.value)


def test_a_mosaic_without_green_asks_for_another_channel():
    with pytest.raises(InputError, match=r"'G' is unknown; allowed: C, R"):
        auto_exposure_s(ramp(), preset("low_noise", "rccc"))
    assert auto_exposure_s(ramp(), preset("low_noise", "rccc"), channel="C") > 0


def test_a_stop_is_twice_the_time_and_a_burst_a_bracket_of_none():
    assert bracket_s(0.01) == (0.0025, 0.01, 0.04)
    assert bracket_s(0.01, [0] * 3) == (0.01, 0.01, 0.01)
    assert bracket_s(0.01, [0.5])[0] == pytest.approx(0.01 * np.sqrt(2), rel=1e-15)


@pytest.mark.parametrize(
    ("middle_s", "stops", "words"),
    [(0.0, (0,), "middle_s: 0.0"), (0.01, (), "stops: () is empty"), (0.01, (99,), "stops: 99")],
)
def test_a_bracket_that_cannot_be_is_refused(middle_s, stops, words):
    with pytest.raises(InputError) as error:
        bracket_s(middle_s, stops)
    assert words in str(error.value)
