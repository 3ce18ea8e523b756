"""Binning: 2x2 pixels of one channel become one pixel of the raw image.

In charge the four photodiodes empty into the floating diffusion that they share, which clips at its own well; column
amplifier, read noise and converter come once, and the converter spans the well of the sum. Dark offsets are those of
the photodiodes (DSNU: correlated double sampling takes the amplifier's own off), so four of them add; the column's
offset comes once. In digital numbers each pixel is read by itself, and four readings are summed: 2 bits more, four
times the black and the white level, four read noises and four roundings.
"""

from dataclasses import replace
from math import hypot, inf, sqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rodcone.errors import InputError
from sensor.cfa import binned_tile
from sensor.config import CHARGE, SensorConfig


def as_read(sensor: SensorConfig) -> SensorConfig:
    """Camera whose pixels are those of the raw image: for one that bins, of 2x2 pixels each; else the camera itself.

    Its numbers are those of four pixels: mean and variance of an evenly lit pixel are exact below the well, but that
    column gains in digital numbers miss half of their spread's square of the shot noise. Its read noise there holds
    three of the four roundings, for the noise of a raw image counts one. Its share s of hot pixels and their dark
    current give the sum's mean and variance (a sum that holds a hot pixel is 1.5 s less hot than that). Its crosstalk
    is what leaves the four.
    """
    if not sensor.binning:
        return sensor
    pixel, share = sensor.pixel, sensor.pixel.hot_pixel_share
    four = replace(
        pixel,
        pitch_um=2 * pixel.pitch_um,
        full_well_e=4 * pixel.full_well_e,
        dsnu_e=2 * pixel.dsnu_e,
        prnu=pixel.prnu / 2,
        dark_current_e_per_s=4 * pixel.dark_current_e_per_s,
        hot_pixel_share=4 * share / (1 + 3 * share),
        hot_pixel_dark_current_e_per_s=(1 + 3 * share) * pixel.hot_pixel_dark_current_e_per_s,
        crosstalk=pixel.crosstalk / 2,
        binned_well_e=0.0,
    )
    tile = binned_tile(sensor.cfa)
    if sensor.binning == CHARGE:
        four = replace(four, full_well_e=min(4 * pixel.full_well_e, pixel.binned_well_e or inf))
        return replace(sensor, pixel=four, cfa=tile, binning="")
    four = replace(
        four,
        read_noise_e=hypot(2 * pixel.read_noise_e, sensor.gain_e_per_dn / 2),  # 3 of 4 roundings: 3/12 of a DN^2
        column_gain_spread=pixel.column_gain_spread / sqrt(2),  # of two columns, two readings of each
        column_offset_e=sqrt(8) * pixel.column_offset_e,
    )
    return replace(
        sensor,
        pixel=four,
        cfa=tile,
        binning="",
        bits=sensor.bits + 2,
        black_level_dn=4 * sensor.black_dn,
        white_level_dn=4 * sensor.white_dn,
    )


def of_read_pixels(values: NDArray[Any], sensor: SensorConfig) -> NDArray[Any]:
    """What the raw image's pixels hold together, shape (..., h, w): sums over 2x2 where the sensor bins.

    Raises
    ------
    InputError
        As `check_blocks`: a picture from a file may have any size.
    """
    check_blocks(sensor, values.shape[-2:])
    return block_sums(values) if sensor.binning else values


def block_sums(values: NDArray[Any]) -> NDArray[Any]:
    """Sums over 2x2, shape (..., h, w) to (..., h / 2, w / 2)."""
    rows = values[..., ::2, :] + values[..., 1::2, :]
    return np.asarray(rows[..., ::2] + rows[..., 1::2])


def check_blocks(sensor: SensorConfig, shape: tuple[int, ...]) -> None:
    """Raise `InputError` for a sensor that bins whose height or width is odd."""
    if sensor.binning and any(side % 2 for side in shape):
        even = " x ".join(str(side + side % 2) for side in shape)
        raise InputError(
            f"size: {' x '.join(map(str, shape))} pixels with binning {sensor.binning!r}; allowed: even height and "
            f"width; give {even}"
        )
