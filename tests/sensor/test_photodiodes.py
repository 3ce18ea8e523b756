"""Binning of 2x2 pixels against closed forms, and against chips drawn and read out."""

from dataclasses import replace

import numpy as np
import pytest
from loop import loop
from refusal import refusal

from render.radiance import SpectralRadiance
from rodcone.errors import InputError
from rodcone.jit import backend
from sensor.capture import expose
from sensor.cfa import BAYER, MOSAICS, RGBW, block_sums, quad, tile_of
from sensor.config import LensConfig, SensorConfig
from sensor.config_file import read_sensor
from sensor.curves import built_in
from sensor.device import draw_device
from sensor.optics import form_image
from sensor.photodiodes import binned, binned_tile
from sensor.pixel import PixelConfig
from sensor.presets import vary
from sensor.readout import noise_sources, noise_variance
from sensor.shake import shaken

QUIET = PixelConfig(1.0, 0.9, full_well_e=8000.0, read_noise_e=0.0, dsnu_e=0.0, prnu=0.0)
BOTH = loop("binning", ["charge", "digital"])


def camera(binning, cfa="quad_bayer", bits=14, black_level_dn=64, **pixel):
    photodiodes = SensorConfig(
        replace(QUIET, **pixel), LensConfig(2.8), cfa=tile_of(cfa), bits=bits, black_level_dn=black_level_dn
    )
    return photodiodes if binning == "" else binned(photodiodes, binning)


def even_frame(sensor, photo_e, shape=(64, 64), exposure_s=0.1, seed=1, exact=True):
    """Raw image of a field that is even, `photo_e` electrons a photodiode."""
    device = draw_device(sensor, shape, np.random.default_rng(seed))
    rng = np.random.default_rng(seed + 1)
    return expose(np.full(shape, float(photo_e)), sensor, exposure_s, device, rng, exact=exact)


# Mosaics


def test_quad_mosaics_are_the_plain_ones_with_2x2_pixels_for_each():
    assert MOSAICS["quad_bayer"] == ("RRGG", "RRGG", "GGBB", "GGBB")
    assert MOSAICS["quad_rgbw"] == ("RRGG", "RRGG", "BBWW", "BBWW")


@loop("tile", [BAYER, RGBW, ("W",), ("RC", "CB"), MOSAICS["rgbw_4x4"]])
def test_binning_undoes_quad(tile):
    assert binned_tile(quad(tile)) == tile


@loop("cfa", ["bayer", "rgbw", "rgbw_4x4", "rccb"])
def test_a_mosaic_whose_2x2_pixels_differ_is_refused_in_one_line(cfa):
    refusal(
        binned,
        SensorConfig(QUIET, LensConfig(2.8), cfa=tile_of(cfa), responses=built_in()),
        "charge",
        match=r"binning: 2x2 pixels of the mosaic .* aren't of one channel; allowed",
    )


@BOTH
def test_a_processor_s_mosaic_is_the_raw_image_s(binning):
    assert vary(camera(binning), "rgbw").photosites.cfa == MOSAICS["quad_rgbw"]
    assert vary(camera(binning), "bayer").cfa == BAYER
    assert vary(camera(binning), "rgbw_nd").cfa == RGBW


# The raw image


@BOTH
@loop("exact", [True, False])
def test_the_raw_image_has_half_the_size_the_plain_mosaic_and_its_levels(binning, exact):
    if not exact and backend() == "numpy":
        pytest.skip("Dr.Jit has no backend here")
    raw = even_frame(camera(binning), 100.0, (24, 40), exact=exact)
    assert raw.shape == (12, 20)
    assert raw.cfa == BAYER
    scale = 4 if binning == "digital" else 1
    assert (raw.black_dn, raw.white_dn) == (scale * 64, scale * (2**14 - 1))
    assert raw.full_well_e == pytest.approx(4 * 8000.0, rel=1e-12)


@BOTH
def test_a_sum_holds_the_light_of_its_own_four_pixels(binning):
    """No noise but Poisson's: each block's mean over exposures is the sum of its four means."""
    sensor, light = camera(binning, black_level_dn=0), np.arange(1.0, 65.0).reshape(8, 8) * 10
    device = draw_device(sensor, (8, 8), np.random.default_rng(0))
    rng, n = np.random.default_rng(1), 400
    mean = sum(expose(light, sensor, 0.1, device, rng, exact=True).electrons for _ in range(n)) / n
    error = np.sqrt(block_sums(light) / n)
    assert np.all(np.abs(mean - block_sums(light)) < 5 * error)  # 16 blocks: false-alarm rate 9e-6


@BOTH
def test_a_block_with_a_hot_pixel_is_listed_as_defective(binning):
    sensor = camera(binning, hot_pixel_share=0.02)
    device = draw_device(sensor, (64, 64), np.random.default_rng(1))
    raw = even_frame(sensor, 10.0)
    np.testing.assert_array_equal(raw.defects, np.unique(np.argwhere(device.hot) // 2, axis=0))


# Wells


@BOTH
def test_each_pixel_clips_at_its_own_well_first(binning):
    """One lamp in a block: it gives its one well, however bright, and its dim neighbours what they hold."""
    sensor, light = camera(binning), np.zeros((4, 4))
    light[0, 1] = 1e6
    device = draw_device(sensor, (4, 4), np.random.default_rng(0))
    raw = expose(light, sensor, 0.1, device, np.random.default_rng(0), exact=True)
    np.testing.assert_allclose(raw.electrons, [[8000.0, 0.0], [0.0, 0.0]], atol=4 * raw.gain_e_per_dn)


def test_the_floating_diffusion_clips_the_sum_in_charge_and_nothing_else():
    limited, digital = (even_frame(camera(b, binned_well_e=20_000.0), 7000.0) for b in ("charge", "digital"))
    assert limited.full_well_e == pytest.approx(20_000.0)
    assert limited.saturated.all()
    assert digital.full_well_e == pytest.approx(32_000.0)
    assert not digital.saturated.any()
    assert digital.electrons.mean() == pytest.approx(28_000.0, rel=1e-3)


# Noise


@loop(
    ("pixel", "charge", "digital"),
    [
        ({}, 0.0, 0.0),
        ({"read_noise_e": 3.0}, 9.0, 36.0),  # one read, or four
        ({"dsnu_e": 4.0}, 64.0, 64.0),  # of four photodiodes
        ({"column_offset_e": 5.0}, 25.0, 200.0),  # one amplifier, or twice each of two columns'
        ({"prnu": 0.02}, 4 * 0.0004 * 100.0**2, 4 * 0.0004 * 100.0**2),
        ({"dark_current_e_per_s": 70.0}, 28.0, 28.0),
        ({"hot_pixel_share": 0.1, "hot_pixel_dark_current_e_per_s": 70.0}, 20.44, 20.44),  # 4 * (0.7 + 0.09 * 49)
        # the sum through one amplifier; or through each of two what its two pixels hold, 2 x 0.0009 x (200 + 200^2),
        # of which `binned` leaves half of 0.0009 of the shot noise out
        ({"column_gain_spread": 0.03}, 0.0009 * (400.0 + 400.0**2), 2 * 0.0009 * (200.0 / 2 + 200.0**2)),
        ({"crosstalk": 0.1}, 0.0, 0.0),
    ],
)
def test_each_term_alone_in_closed_form(pixel, charge, digital):
    """100 e- a photodiode in 0.1 s, beside 400 of shot noise and the roundings: one of the sum's gain, or four."""
    for binning, expected in (("charge", charge), ("digital", digital)):
        sensor = camera(binning, **pixel)
        gain = (32_000.0 if binning == "charge" else 8000.0) / (16_383 - 64)
        roundings = gain**2 / 12 * (1 if binning == "charge" else 4)
        found = noise_variance(np.full((2, 2), 400.0), sensor, 0.1)
        np.testing.assert_allclose(found, 400.0 + expected + roundings, rtol=1e-12)
        assert sum(x**2 for x in noise_sources(400.0, sensor, 0.1).values()) == pytest.approx(found[0, 0], rel=1e-12)


@loop(("binning", "bits"), [("charge", 12), ("digital", 10)])  # roundings of 6 % and 19 % of it
def test_the_raw_image_states_its_own_dark_noise(binning, bits):
    """Read noise, DSNU and all roundings: what weighs frames, finds saturation and goes into a negative's profile."""
    raw = even_frame(camera(binning, read_noise_e=3.0, dsnu_e=4.0, bits=bits), 0.0, (512, 512))
    # of a variance of normal values, within 4.5 standard errors: false-alarm rate 7e-6
    assert raw.electrons.var() == pytest.approx(raw.dark_noise_e**2, rel=4.5 * np.sqrt(2 / raw.dn.size))


@BOTH
@loop("change", [{"prnu": 0.3}, {"read_noise_e": 9.0}])
def test_a_pixel_changed_without_its_photodiodes_is_no_chip(binning, change):
    sensor = camera(binning)
    with pytest.raises(InputError, match=r"pixel: it isn't four of the chip's photodiodes; allowed"):
        draw_device(replace(sensor, pixel=replace(sensor.pixel, **change)), (8, 8), np.random.default_rng(0))


# Hostile input


@BOTH
@loop("shape", [(33, 40), (40, 33), (5, 5)])
def test_an_odd_size_is_refused_in_one_line(binning, shape):
    refusal(
        draw_device,
        camera(binning),
        shape,
        np.random.default_rng(0),
        match=r"size: \d+ x \d+ pixels with binning .* even height and width; give ",
    )


@loop("binning", ["", "analog", "Charge", 2, None, False, ["charge"]])
def test_another_binning_is_refused(binning):
    refusal(binned, camera(""), binning, match=r"binning: .*allowed: charge, digital")


def test_a_sum_beyond_16_bits_is_refused():
    refusal(camera, "digital", bits=15, match=r"bits: 15 with binning 'digital'.*up to 14")
    assert camera("charge", bits=16).chip.in_charge


@loop("binned_well_e", [-1.0, 7999.0, np.nan, 1e13])
def test_a_floating_diffusion_under_one_well_is_refused(binned_well_e):
    refusal(camera, "charge", binned_well_e=binned_well_e, match="binned_well_e")


PRESET = """
cfa = "{cfa}"
binning = {binning}
[pixel]
pitch_um = 1.0
fill_factor = 0.9
full_well_e = 8000
read_noise_e = 2.0
dsnu_e = 1.0
prnu = 0.01
binned_well_e = 20000
[lens]
f_number = 2.0
"""


def test_a_sensor_file_names_binning_and_its_well(tmp_path):
    path = tmp_path / "quad.toml"
    path.write_text(PRESET.format(cfa="quad_rgbw", binning='"charge"'))
    sensor = read_sensor(path)
    assert (sensor.chip.in_charge, sensor.pixel.full_well_e, sensor.cfa) == (True, 20_000.0, RGBW)


@loop(
    ("cfa", "binning"),
    [("quad_bayer", '"analog"'), ("quad_bayer", "true"), ("quad_bayer", "false"), ("bayer", '"charge"')],
)
def test_a_wrong_sensor_file_is_refused_by_name(tmp_path, cfa, binning):
    path = tmp_path / "quad.toml"
    path.write_text(PRESET.format(cfa=cfa, binning=binning))
    refusal(read_sensor, path, match=r"sensor file '.*quad.toml': binning: ")


@BOTH
def test_the_lens_blurs_a_binned_cameras_photodiodes_not_its_pixels(binning):
    """Point images have their size on the sensor: in photodiodes as behind the same chip read without binning."""
    lens = LensConfig(4.0, diffraction=1.0, defocus_um=6.0, veiling_glare=0.02)
    nm, point = np.arange(405.0, 700.0, 50.0), np.zeros((32, 32, 6))
    point[15, 16] = 1.0
    radiance = SpectralRadiance(point, nm)
    plain = replace(camera(""), lens=lens)
    summed = replace(camera(binning), lens=lens)
    np.testing.assert_allclose(form_image(radiance, summed).values, form_image(radiance, plain).values, rtol=1e-12)
    held = replace(lens, shake_um=3.0)
    light = np.zeros((32, 32, 3))
    light[15, 16] = 1e4
    moved = [shaken(light, replace(x, lens=held), 0.1, np.random.default_rng(3)) for x in (plain, summed)]
    np.testing.assert_allclose(moved[0], moved[1], atol=1e-9)
