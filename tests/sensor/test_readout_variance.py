"""The noise variance against closed forms and against chips drawn and read out."""

from dataclasses import replace

import numpy as np
import pytest
from loop import loop

from sensor.chip import PixelConfig
from sensor.config import LensConfig, SensorConfig
from sensor.readout import noise_sources, noise_variance, spread_charge

QUIET = PixelConfig(2.2, 0.9, full_well_e=60_000.0, read_noise_e=0.0, dsnu_e=0.0, prnu=0.0)


def camera(**pixel):
    return SensorConfig(replace(QUIET, **pixel), LensConfig(2.8), bits=16)


def variance(light_e, exposure_s=0.1, **pixel):
    sensor = camera(**pixel)
    total = noise_variance(np.full((2, 2), light_e), sensor, exposure_s)[0, 0]
    assert sum(sigma**2 for sigma in noise_sources(light_e, sensor, exposure_s).values()) == pytest.approx(total, 1e-12)
    return total - sensor.gain_e_per_dn**2 / 12


@loop(
    ("pixel", "expected"),
    [
        ({}, 100.0),
        ({"read_noise_e": 3.0}, 109.0),
        ({"dsnu_e": 4.0}, 116.0),
        ({"column_offset_e": 5.0}, 125.0),
        ({"prnu": 0.02}, 100.0 + 4.0),
        ({"dark_current_e_per_s": 70.0}, 107.0),
        # 7 e- in a tenth of the pixels: Poisson of the mean, and the spread of the means
        ({"hot_pixel_share": 0.1, "hot_pixel_dark_current_e_per_s": 70.0}, 100.0 + 0.7 + 0.09 * 49),
        ({"column_gain_spread": 0.03}, 100.0 + 0.0009 * (100.0 + 100.0**2)),
        ({"crosstalk": 0.1}, 100.0),
        ({"hot_pixel_share": 0.1}, 100.0),
        ({"hot_pixel_dark_current_e_per_s": 70.0}, 100.0),
        (
            {"dark_current_e_per_s": 70.0, "column_gain_spread": 0.03}
            | {"hot_pixel_share": 0.1, "hot_pixel_dark_current_e_per_s": 50.0},
            107.5 + 0.09 * 25 + 0.0009 * (107.5 + 0.09 * 25 + 107.5**2),
        ),
    ],
)
def test_each_term_alone_in_closed_form(pixel, expected):
    assert variance(100.0, **pixel) == pytest.approx(expected, rel=1e-12)


def test_quantisation_is_gain_squared_over_12_and_the_shape_is_the_light_s():
    light = np.array([[0.0, 1.0, 5.0], [2.0, 3.0, 4.0]])
    sensor = camera()
    np.testing.assert_allclose(noise_variance(light, sensor, 0.1), light + sensor.gain_e_per_dn**2 / 12, rtol=1e-14)


def test_crosstalk_spreads_the_shot_noise_as_it_spreads_the_charge():
    light = np.zeros((5, 5))
    light[2, 2] = 100.0
    sensor = camera(crosstalk=0.1)
    expected = spread_charge(light, 0.1) + sensor.gain_e_per_dn**2 / 12
    np.testing.assert_allclose(noise_variance(light, sensor, 0.1), expected, rtol=1e-14)
