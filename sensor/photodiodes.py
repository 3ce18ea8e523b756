"""Binning: 2x2 photodiodes of one channel make one pixel of the raw image.

When they bin in charge, the four photodiodes empty into the floating diffusion that they share, which clips at its own
well. Column amplifier, read noise and converter then act once, and the converter's range is the well of the sum. Dark
offsets (DSNU) are those of the photodiodes, because correlated double sampling removes the amplifier's own; so four of
them add, but the column's offset comes once. When they bin in digital numbers, each photodiode is read by itself, and
four readings are summed: with 2 bits more, four times the black and the white level, four read noises and four
roundings.
"""

from dataclasses import replace
from math import hypot, inf, lcm, sqrt
from typing import Annotated, TypeAlias

import numpy as np

from rodcone.errors import InputError, require_name
from sensor.cfa import Tile, channel_map
from sensor.config import SensorConfig
from sensor.pixel import BINNINGS, CHARGE, DIGITAL, Binning

Gain: TypeAlias = Annotated[float, (1.0, 1024.0, "give a factor, 1 where a full well reads the converter's top")]
MOST_BITS_SUMMED = 14  # most bits of a converter of whose readings four are summed: a raw image holds 16


def binned(sensor: SensorConfig, way: str) -> SensorConfig:
    """Return the camera whose pixels are 2x2 photodiodes; `sensor` describes the photodiodes when read one by one.

    The numbers of the binned pixel follow from those of four photodiodes. Mean and variance of an evenly lit pixel are
    exact below the full well, with one exception: in digital binning the noise of the column gains misses half the
    square of their spread times the shot noise. There the read noise includes three of the four roundings, because a
    raw image's noise counts one itself. The share s of hot pixels and their dark current give the sum's mean and
    variance (a sum that includes a hot pixel is 1.5 s less hot than that). Crosstalk is the charge that leaves the four
    together.

    Raises
    ------
    InputError
        For another way than "charge" and "digital", a mosaic whose 2x2 pixels aren't of one channel, several readings,
        or a sum of more bits than a raw image holds.

    Examples
    --------
    >>> import rodcone
    >>> sensor = rodcone.preset("low_noise", "quad_bayer")
    >>> rodcone.binned(sensor, "digital").sites
    2
    """
    require_name("binning", way, BINNINGS)
    pixel = sensor.pixel
    share = sensor.pixel.hot_pixel_share
    tile = binned_tile(sensor.cfa)
    if way == DIGITAL and sensor.bits > MOST_BITS_SUMMED:
        raise InputError(
            f"bits: {sensor.bits} with binning {DIGITAL!r}: four readings sum to two bits more than a raw file's "
            f"16; allowed: up to {MOST_BITS_SUMMED}; give fewer bits, or binning {CHARGE!r}"
        )
    settings = sensor.bits, sensor.black_level_dn, sensor.white_level_dn, sensor.converter_noise_dn
    chip = replace(sensor.chip, binning=Binning(way, pixel, *settings))
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
    if way == CHARGE:
        four = replace(four, full_well_e=min(4 * pixel.full_well_e, pixel.binned_well_e or inf))
        return replace(sensor, pixel=four, cfa=tile, chip=chip)
    four = replace(
        four,
        # Two rows, whose noise two photodiodes have together; 3 of 4 roundings: 3/12 of a DN^2.
        read_noise_e=hypot(2 * pixel.read_noise_e, 2 * pixel.row_noise_e, sensor.gain_e_per_dn / 2),
        row_noise_e=sqrt(8) * pixel.row_noise_e,
        ramp_step_e=4 * pixel.ramp_step_e,  # black of the sum: each of four readings is raised by half a step
        telegraph_e=2 * pixel.telegraph_e,  # four readings' variances add; the tails of their sum are shorter
        column_gain_spread=pixel.column_gain_spread / sqrt(2),  # two readings in each of two columns
        column_offset_e=sqrt(8) * pixel.column_offset_e,
    )
    return replace(
        sensor,
        pixel=four,
        cfa=tile,
        bits=sensor.bits + 2,
        black_level_dn=4 * sensor.black_dn,
        white_level_dn=4 * sensor.white_dn,
        converter_noise_dn=2 * sensor.converter_noise_dn,
        chip=chip,
    )


def with_gain(sensor: SensorConfig, gain: Gain) -> SensorConfig:
    """Return the camera at a fixed gain; converter, black level and noise follow it, and auto exposure keeps it.

    Parameters
    ----------
    gain : float
        Over that at which a full well reads the converter's top; 1 or more.

    Raises
    ------
    InputError
        For a gain out of range, or a camera of several readings, which have gains of their own.

    Examples
    --------
    >>> import rodcone
    >>> sensor = rodcone.preset("low_noise")
    >>> rodcone.with_gain(sensor, 4.0).gain
    4.0
    """
    binning = sensor.chip.binning
    one = replace(sensor.photosites, gain=gain, gain_limit=1.0)
    return binned(one, binning.way) if binning else one


def binned_tile(tile: Tile) -> Tile:
    """Merge each 2x2 block of one colour into one pixel; the inverse of `quad`.

    Raises
    ------
    InputError
        Where 2x2 pixels, counted from the first, aren't of one channel.
    """
    cells = channel_map(tile, (lcm(len(tile), 2), lcm(len(tile[0]), 2)))
    first = cells[::2, ::2]
    if np.any(cells != first.repeat(2, 0).repeat(2, 1)):
        raise InputError(
            f"binning: 2x2 pixels of the mosaic {tile} aren't of one channel; allowed: mosaics such as quad_bayer, "
            "quad_rgbw and mono; give one, or leave binning out"
        )
    return tuple("".join(row) for row in first)


def check_chip(sensor: SensorConfig) -> None:
    """Raise `InputError` for a camera whose pixel or converter was changed without its photodiodes."""
    binning = sensor.chip.binning
    if binning and _converted(binned(sensor.photosites, binning.way)) != _converted(sensor):
        raise InputError(
            "pixel: it isn't four of the chip's photodiodes; allowed: as rodcone.binned makes it; change the "
            "photodiodes instead"
        )


def _converted(sensor: SensorConfig) -> tuple[object, ...]:
    return sensor.pixel, sensor.bits, sensor.black_dn, sensor.white_dn, sensor.converter_noise_dn
