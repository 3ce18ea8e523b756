"""Exposure times: auto exposure from the expected signal, and brackets around a given time."""

from collections.abc import Sequence

import numpy as np

from rodcone.errors import InputError, require_range, unknown
from sensor.cfa import channels
from sensor.config import SensorConfig
from sensor.optics import SpectralIrradiance
from sensor.response import channel_electrons

LONGEST_S = 0.066  # Parmar & Wandell 2009, Figure 5: 66 ms
RULE = "the 99th percentile of expected G at 80 % of the well, never longer than {longest:g} ms"


def auto_exposure_s(
    irradiance: SpectralIrradiance,
    sensor: SensorConfig,
    longest_s: float = LONGEST_S,
    *,
    channel: str = "G",
    percentile: float = 99.0,
    well_share: float = 0.8,
) -> float:
    """Exposure that puts a percentile of one channel's expected electrons at a share of the well [s].

    Dark current and crosstalk are left out: the rule is about light.

    Parameters
    ----------
    irradiance : SpectralIrradiance
    sensor : SensorConfig
    longest_s : float
        Longest exposure allowed; returned where there is no light [s].
    channel : str
        A channel of the mosaic.
    percentile : float
        0 to 100, over all pixels as if each had the channel's filter.
    well_share : float
        Above 0, up to 1.

    Raises
    ------
    InputError
        For a number out of range, or a channel that the mosaic doesn't have.
    """
    require_range("longest_s", longest_s, 1e-9, 1e7, "give seconds above 0")
    require_range("percentile", percentile, 0.0, 100.0, "give per cent of the pixels")
    require_range("well_share", well_share, 1e-6, 1.0, "give a fraction of the well")
    if channel not in channels(sensor.cfa):
        raise unknown("exposure: channel", channel, channels(sensor.cfa))
    per_second = channel_electrons(irradiance, sensor, 1.0)[..., channels(sensor.cfa).index(channel)]
    bright = float(np.percentile(per_second, percentile))
    return min(longest_s, well_share * sensor.pixel.full_well_e / bright) if bright > 0 else longest_s


def bracket_s(middle_s: float, stops: Sequence[float] = (-2.0, 0.0, 2.0)) -> tuple[float, ...]:
    """Exposure times around one: a stop more is twice the time [s]. A burst of n is ``bracket_s(t, [0] * n)``.

    Raises
    ------
    InputError
        For no stops at all, a time that isn't positive, or stops beyond 20 either way.
    """
    require_range("middle_s", middle_s, 1e-9, 1e7, "give seconds above 0")
    if len(stops) == 0:
        raise InputError(f"stops: {stops!r} is empty; allowed: one number a frame; give some, such as (-2, 0, 2)")
    for stop in stops:
        require_range("stops", stop, -20.0, 20.0, "give powers of two of the time")
    return tuple(middle_s * 2.0**stop for stop in stops)
