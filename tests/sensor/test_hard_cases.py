"""The ends of the scale, for both forms of the readout: nothing wraps, nothing warns (warnings are errors here)."""

from dataclasses import replace

import numpy as np
import pytest
from builders import REAL_PIXEL
from loop import loop

from render.radiance import SpectralRadiance
from render.spectrum import flat
from sensor.burst import merge
from sensor.capture import capture
from sensor.cfa import MOSAICS
from sensor.chip import PixelConfig
from sensor.config import LONGEST_S, LensConfig, SensorConfig
from sensor.curves import Responses
from sensor.device import draw_device
from sensor.exposure import auto_exposure_s
from sensor.optics import form_image
from sensor.presets import names, preset
from sensor.readout import noise_variance
from sensor.response import expected_electrons

NM = np.arange(390.0, 780.0, 20.0)
EXACT = loop("exact", [False, True])


def scene(value, shape):
    values = np.zeros((NM.size, *shape), dtype=np.float32)
    values += np.float32(value)
    return SpectralRadiance(np.moveaxis(values, 0, -1), NM)


def real(sensor):
    return replace(sensor, pixel=replace(sensor.pixel, **REAL_PIXEL))


def shoot(sensor, value, shape, exact, exposure_s=0.01, seed=0):
    device = draw_device(sensor, shape, np.random.default_rng([seed, 0]))
    rng = np.random.default_rng([seed, 1])
    raw = capture(scene(value, shape), sensor, exposure_s, device, rng, exact=exact)
    assert raw.dn.dtype == (np.float32 if sensor.chip.readings else np.uint16)
    assert raw.dn.max() <= raw.white_dn
    assert np.isfinite(raw.electrons).all()
    return raw


@EXACT
@loop("name", names())
def test_without_light_a_frame_reads_black_and_half_lies_on_either_side(name, exact):
    raw = shoot(preset(name), 0.0, (128, 128), exact)
    sigma = raw.dark_noise_e
    dark_e = preset(name).pixel.dark_current_e_per_s * raw.exposure_s
    assert abs(raw.electrons.mean() - dark_e) < 4 * sigma / 128 + 1e-9  # nine presets, two forms: 1e-3
    assert raw.dn.min() >= 0
    assert not raw.saturated.any()


@EXACT
@loop("name", ["low_noise", "table1_pixel"])
def test_1e8_full_wells_saturate_every_pixel_and_nothing_wraps(name, exact):
    sensor = preset(name)
    per_radiance = expected_electrons(form_image(scene(1.0, (2, 2)), sensor), sensor, 0.01).min()
    raw = shoot(sensor, 1e8 * sensor.pixel.full_well_e / per_radiance, (64, 64), exact)
    # clipped at the well, behind it the dark noise alone: no pixel reads less than 6 standard deviations under the top
    assert raw.electrons.min() > sensor.pixel.full_well_e - 6 * raw.dark_noise_e
    assert raw.saturated.mean() > 0.999
    assert merge([raw]).saturated.mean() > 0.999


@EXACT
@loop("value", [0.0, 1.0, 1e9])
def test_an_exposure_of_0_s_collects_nothing(value, exact):
    raw = shoot(real(preset("low_noise")), value, (64, 64), exact, exposure_s=0.0)
    assert abs(raw.electrons.mean()) < 4 * raw.dark_noise_e / np.sqrt(64)  # columns share an offset
    assert not raw.saturated.any()


@EXACT
def test_a_frame_of_one_pixel_needs_a_tile_of_one(exact):
    sensor = real(preset("low_noise", "mono"))
    assert shoot(sensor, 0.01, (1, 1), exact).shape == (1, 1)


@EXACT
@loop("shape", [(5, 7), (4, 9), (33, 5)])
@loop("cfa", ["rgbw", "bayer_gbrg", "rgbw_4x4", "rccc", "mono"])
def test_odd_sizes_read_the_mosaic_that_they_hold(cfa, shape, exact):
    sensor = preset("low_noise", cfa)
    sensor = replace(sensor, pixel=replace(sensor.pixel, read_noise_e=0.0, dsnu_e=0.0, prnu=0.0))
    raw = shoot(sensor, 1e-3, shape, exact)
    tile = MOSAICS[cfa]
    expected = expected_electrons(form_image(scene(1e-3, shape), sensor), sensor, 0.01)
    for row, column in np.ndindex(shape):
        same = expected[row % len(tile), column % len(tile[0])]
        assert expected[row, column] == pytest.approx(same, rel=1e-6)
    # each pixel within 6 standard deviations of its own channel's mean: 2e-9 a pixel
    assert np.all(np.abs(raw.electrons - expected) < 6 * np.sqrt(expected + 1) + raw.gain_e_per_dn)


@EXACT
@loop("bits", [1, 16])
def test_1_bit_and_16_bits_use_their_whole_range_and_no_more(bits, exact):
    sensor = replace(preset("low_noise"), bits=bits)
    dark, bright = (shoot(sensor, value, (64, 64), exact) for value in (0.0, 1e6))
    assert abs(np.median(dark.electrons)) < 0.1 * dark.dark_noise_e  # of 4096 pixels: five standard errors
    assert bright.dn.max() == 2**bits - 1


@EXACT
def test_a_well_under_the_read_noise_still_gives_numbers(exact):
    pixel = PixelConfig(2.2, 0.9, full_well_e=5.0, read_noise_e=50.0, dsnu_e=20.0, prnu=0.5, **REAL_PIXEL)
    sensor = SensorConfig(pixel, LensConfig(2.8))
    dark, bright = (shoot(sensor, value, (64, 64), exact) for value in (0.0, 1e3))
    assert dark.dn.std() > 0
    # the converter ends at the well, so most of the noise above black is cut: less than a sigma over black is left
    assert 0 <= bright.electrons.max() <= 5.0 + 1e-9
    assert np.isfinite(merge([dark, bright]).rate_e_per_s).all()
    assert np.isfinite(noise_variance(np.full((4, 4), 5.0), sensor, 0.01)).all()


@EXACT
def test_a_response_of_zero_everywhere_reads_as_darkness_under_any_light(exact):
    blind = Responses({channel: flat(0.0) for channel in "RGBW"})
    sensor = replace(preset("low_noise"), responses=blind)
    raw = shoot(sensor, 1e9, (64, 64), exact)
    assert abs(raw.electrons.mean()) < 4 * raw.dark_noise_e / 64
    assert auto_exposure_s(form_image(scene(1.0, (4, 4)), sensor), sensor) == LONGEST_S


@EXACT
@loop("term", [*REAL_PIXEL, "read_noise_e", "dsnu_e", "prnu"])
def test_each_term_at_the_top_of_its_range_reads_in_range(term, exact):
    tops = {"column_gain_spread": 1.0, "hot_pixel_share": 1.0, "crosstalk": 0.25, "prnu": 1.0, "column_offset_e": 1e9}
    top = tops.get(term, 1e9)
    sensor = preset("low_noise")
    pixel = replace(sensor.pixel, prnu=0.0, **{term: top}) if term != "prnu" else replace(sensor.pixel, prnu=1.0)
    sensor = replace(sensor, pixel=pixel)
    shoot(sensor, 0.02, (32, 32), exact)
    assert np.isfinite(noise_variance(np.full((32, 32), 500.0), sensor, 0.01)).all()
