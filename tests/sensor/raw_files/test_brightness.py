"""The brightness at which an exposure is shown: a known grey, the percentile, and noise that hardly raises it."""

from dataclasses import replace

import numpy as np
import pytest
from loop import loop
from refusal import refusal

from render.illuminants import illuminant
from sensor.capture import expose
from sensor.cfa import mask
from sensor.device import draw_device
from sensor.presets import low_noise
from sensor.raw import RawImage
from sensor.raw_files.brightness import MOST_NOISE, stops_to_white
from sensor.readout import as_raw
from studies.photograph.camera import calibrate

SHAPE = (64, 80)
D65 = illuminant("D65")


def grey(cfa: str, share: np.ndarray | float) -> RawImage:
    """Noise-free frame of a grey that fills this share of green's well, as floats."""
    sensor = low_noise(cfa)
    colour = calibrate(sensor, D65)
    electrons = np.zeros(SHAPE)
    for name, neutral in zip(sensor.channels, colour.neutral, strict=True):
        at = mask(sensor.cfa, name, SHAPE)
        electrons[at] = (neutral * share * sensor.pixel.full_well_e * np.ones(SHAPE))[at]
    raw = as_raw(np.zeros(SHAPE, np.uint16), sensor, 0.01, "numpy")
    return replace(raw, dn=electrons / raw.gain_e_per_dn + raw.black_dn, colour=colour)


@loop("cfa", ["bayer", "bayer_gbrg", "rgbw", "rgbw_4x4", "quad_bayer", "quad_rgbw", "mono", "rccc"])
def test_a_grey_at_a_share_of_the_well_is_shown_at_nine_tenths_of_white(cfa: str) -> None:
    for share in (0.5, 0.02):
        assert stops_to_white(grey(cfa, share)) == pytest.approx(np.log2(0.9 / share), abs=1e-6)


def test_what_covers_over_a_hundredth_of_the_frame_is_white() -> None:
    for columns, white in ((2, 0.64), (0, 0.01)):  # 2 of 80 columns
        share = np.full(SHAPE, 0.01)
        share[:, :columns] = 0.64
        assert stops_to_white(grey("bayer", share)) == pytest.approx(np.log2(0.9 / white), abs=1e-6)


def test_a_spot_over_a_hundredth_of_the_frame_is_white_wherever_it_lies() -> None:
    for size, white in (((8, 8), 0.64), ((2, 40), 0.64), ((2, 20), 0.01)):  # 64, 80 and 40 of 5120 pixels
        for row, column in ((0, 0), (20, 38), (64 - size[0], 80 - size[1])):
            share = np.full(SHAPE, 0.01)
            share[row : row + size[0], column : column + size[1]] = 0.64
            assert stops_to_white(grey("bayer", share)) == pytest.approx(np.log2(0.9 / white), abs=1e-6)


@loop("cfa", ["bayer", "rgbw"])
def test_noise_raises_the_percentile_of_a_flat_frame_by_half_a_stop_at_most(cfa: str) -> None:
    # The 99th percentile of a normal variable lies 2.33 standard deviations over its mean, and these are at most
    # `MOST_NOISE` of white, which is the percentile over 0.9: P = L + 2.33 MOST_NOISE P / 0.9.
    sensor, shape, level_e = low_noise(cfa), (256, 256), 2.0
    colour = calibrate(sensor, D65)
    expected_e = np.zeros(shape)
    for name, neutral in zip(sensor.channels, colour.neutral, strict=True):
        expected_e[mask(sensor.cfa, name, shape)] = neutral * level_e
    device = draw_device(sensor, shape, np.random.default_rng(1))
    raw = expose(expected_e, sensor, 0.01, device, np.random.default_rng(2))
    exact = np.log2(0.9 * sensor.pixel.full_well_e / level_e)
    found = stops_to_white(replace(raw, colour=colour))
    assert np.log2(1 - 2.4 * MOST_NOISE / 0.9) < found - exact < 0.0


def test_a_dark_frame_stays_as_it_is() -> None:
    assert stops_to_white(grey("bayer", 0.0)) == 0.0


def test_without_colours_there_is_no_luminance() -> None:
    refusal(stops_to_white, replace(grey("bayer", 0.5), colour=None), match="raw: it holds no colour calibration")
