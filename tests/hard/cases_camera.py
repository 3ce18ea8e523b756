"""Hard cases of cameras: exposures, wells, noises and lenses at the ends of their ranges, odd and tiny frames."""

from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from hard.case import Case, Margin, Situation, low_noise, worst_of
from hard.chain import expected
from hard.light import at_level, cropped, even, scaled_to

from render.radiance import SpectralRadiance
from render.spectrum import flat
from sensor.cfa import MOSAICS, Tile
from sensor.config import LensConfig, SensorConfig
from sensor.curves import Responses
from sensor.device import draw_device

CHIP_SIDE = 1024  # a megapixel: its mean is known to a thousandth of the spread
CHIP_SIGMAS = 5.0  # standard errors: a false alarm of 6e-7


def _pixel(**terms: float) -> SensorConfig:
    sensor = low_noise()
    return replace(sensor, pixel=replace(sensor.pixel, **terms))


def _seen(mean_e: float, sensor: SensorConfig, exposure_s: float = 0.01, **develop: Any) -> Situation:
    """The scene at the level at which the camera's pixels expect `mean_e`."""
    return Situation(scaled_to(at_level(10.0), sensor, exposure_s, mean_e), sensor, exposure_s, develop)


def _frame(height: int, width: int) -> Situation:
    return Situation(cropped(at_level(30.0), (height, width)))


def _mosaic(cfa: Tile, bayer: str) -> Situation:
    return Situation(at_level(30.0), replace(low_noise(), cfa=cfa), bayer=MOSAICS[bayer])


def _lens(f_number: float, mean_e: float, **terms: float) -> Situation:
    return _seen(mean_e, replace(low_noise(), lens=LensConfig(f_number, **terms)))


def _blind() -> SensorConfig:
    return replace(low_noise(), responses=Responses({channel: flat(0.0) for channel in "RGBW"}))


def _no_electrons(situation: Situation) -> Margin:
    """No electron."""
    return worst_of(expected(situation).max(), 1e-12, "e⁻")


def _mean_response(situation: Situation) -> Margin:
    """A megapixel's mean response is 1."""
    device = draw_device(situation.sensor, (CHIP_SIDE, CHIP_SIDE), np.random.default_rng(3))
    error = situation.sensor.pixel.prnu / CHIP_SIDE
    return worst_of((device.photo_response.mean() - 1.0) / error, CHIP_SIGMAS, "standard errors")


def _other_memory(situation: Situation) -> Margin:
    """As from float32 in planes.

    To single precision.
    """
    same = expected(replace(situation, radiance=at_level(10.0)))
    return worst_of(expected(situation) - same, 1e-6 * same, "e⁻")


def _double_bands_last() -> SpectralRadiance:
    """float64 with the bands last in memory, read from a larger array's every other value."""
    source = at_level(10.0)
    wide = np.zeros((*source.shape, 2 * source.wavelength_nm.size))
    wide[..., ::2] = source.values
    return replace(source, values=wide[..., ::2])


DARK = {"dark_current_e_per_s": 0.1}
HOT = {"hot_pixel_share": 0.1, "hot_pixel_dark_current_e_per_s": 1e4}

EXPOSURE_CASES = (
    Case("exposure_1us", "100 000 cd/m² for 1 µs", lambda: Situation(at_level(1e5), exposure_s=1e-6)),
    Case("exposure_1us_starlight", "1e-4 cd/m² for 1 µs", lambda: Situation(at_level(1e-4), exposure_s=1e-6)),
    Case(
        "exposure_1h_dark_current",
        "an hour of 0.1 e⁻/s dark current, 1e-4 cd/m²",
        lambda: Situation(at_level(1e-4), _pixel(**DARK), 3600.0),
    ),
    Case(
        "exposure_1h_hot_pixels",
        "an hour, a tenth of the pixels leaking 10 000 e⁻/s",
        lambda: Situation(at_level(1e-4), _pixel(**HOT), 3600.0),
    ),
    Case("exposure_0s", "no time at all", lambda: Situation(at_level(100.0), exposure_s=0.0), _no_electrons),
    Case("exposure_1e7s", "the longest exposure allowed, 1e7 s", lambda: Situation(at_level(1e-9), exposure_s=1e7)),
)

PIXEL_CASES = (
    Case("well_10", "a well of 10 e⁻, 3 e⁻ a pixel", lambda: _seen(3.0, _pixel(full_well_e=10.0))),
    Case(
        "well_10_quiet",
        "a well of 10 e⁻ without dark noise, 0.1 e⁻ a pixel",
        lambda: _seen(0.1, _pixel(full_well_e=10.0, read_noise_e=0.0, dsnu_e=0.0)),
    ),
    Case(
        "well_1e6_16bit",
        "a well of 1e6 e⁻ in 16 bits, 2e5 e⁻ a pixel",
        lambda: _seen(2e5, replace(_pixel(full_well_e=1e6), bits=16)),
    ),
    Case(
        "well_1e6_8bit",
        "a well of 1e6 e⁻ in 8 bits, 1000 e⁻ a pixel",
        lambda: _seen(1e3, replace(_pixel(full_well_e=1e6), bits=8)),
    ),
    Case("read_noise_0", "no read noise, no DSNU", lambda: _seen(20.0, _pixel(read_noise_e=0.0, dsnu_e=0.0))),
    Case("read_noise_1e4", "read noise of 1e4 e⁻, 10 e⁻ a pixel", lambda: _seen(10.0, _pixel(read_noise_e=1e4))),
    Case(
        "read_noise_1e4_bright",
        "read noise of 1e4 e⁻, a well of 1e6, 2e5 e⁻ a pixel",
        lambda: _seen(2e5, _pixel(read_noise_e=1e4, full_well_e=1e6)),
    ),
    Case("prnu_50", "PRNU of 50 %, 200 e⁻ a pixel", lambda: _seen(200.0, _pixel(prnu=0.5)), _mean_response),
    Case("prnu_20", "PRNU of 20 %, 1000 e⁻ a pixel", lambda: _seen(1e3, _pixel(prnu=0.2)), _mean_response),
    Case("dsnu_over_well", "DSNU of 20 000 e⁻ in a well of 15 000", lambda: _seen(100.0, _pixel(dsnu_e=2e4))),
    Case(
        "columns",
        "columns' gain off by 5 %, their offset by 50 e⁻",
        lambda: _seen(1e3, _pixel(column_gain_spread=0.05, column_offset_e=50.0)),
    ),
    Case("hot_pixels", "a tenth of the pixels hot", lambda: _seen(100.0, _pixel(**HOT))),
    Case("hot_30", "three pixels in ten hot", lambda: _seen(10.0, _pixel(**(HOT | {"hot_pixel_share": 0.3})))),
    Case(
        "one_hot_pixel",
        "one hot pixel, listed, in the dark",
        lambda: Situation(even(0.0), _pixel(**(HOT | {"hot_pixel_share": 2.5e-4}))),
    ),
    Case("crosstalk_25", "all charge goes to the neighbours", lambda: _seen(200.0, _pixel(crosstalk=0.25))),
    Case("bits_1", "a converter of 1 bit, 3000 e⁻ a pixel", lambda: _seen(3e3, replace(low_noise(), bits=1))),
    Case(
        "bits_16_well_100",
        "16 bits over a well of 100 e⁻: 600 DN an electron",
        lambda: _seen(5.0, replace(_pixel(full_well_e=100.0), bits=16)),
    ),
    Case(
        "black_0",
        "black level 0: half of the dark is cut",
        lambda: Situation(at_level(1e-3), replace(low_noise(), black_level_dn=0)),
    ),
    Case(
        "black_at_half",
        "black level at half of the converter's range",
        lambda: _seen(100.0, replace(low_noise(), black_level_dn=8192)),
    ),
    Case("pitch_0.5um", "pixels of 0.5 µm", lambda: Situation(at_level(100.0), _pixel(pitch_um=0.5))),
    Case("pitch_100um", "pixels of 100 µm", lambda: Situation(at_level(0.01), _pixel(pitch_um=100.0))),
    Case(
        "fill_0", "no pixel collects light", lambda: Situation(at_level(100.0), _pixel(fill_factor=0.0)), _no_electrons
    ),
    Case("blind", "responses of 0 everywhere", lambda: Situation(at_level(100.0), _blind()), _no_electrons),
    Case("f_0.5", "a lens of f/0.5", lambda: _lens(0.5, 100.0)),
    Case("f_64_diffraction", "diffraction at f/64: 16 pixels wide", lambda: _lens(64.0, 300.0, diffraction=1.0)),
    Case("falloff_120", "120° of view: 94 % lost in the corners", lambda: _lens(2.8, 300.0, horizontal_view_deg=120.0)),
    Case("glare_100", "all light is veiling glare", lambda: _lens(2.8, 300.0, veiling_glare=1.0)),
    Case("other_memory", "float64, bands last, strided", lambda: Situation(_double_bands_last()), _other_memory),
)

FRAME_CASES = (
    *(
        Case(f"frame_{height}x{width}", f"a frame of {height} × {width} pixels", partial(_frame, height, width))
        for height, width in ((2, 2), (3, 3), (2, 64), (64, 3), (5, 7), (33, 35), (61, 67))
    ),
    Case("mosaic_turned", "the mosaic begins at W, the other at GB", lambda: _mosaic(("WB", "GR"), "bayer_gbrg")),
    Case(
        "mosaic_4x4", "a tile of 4 × 4, half of it W", lambda: _mosaic(("WGWR", "GWRW", "WBWG", "BWGW"), "bayer_bggr")
    ),
)
