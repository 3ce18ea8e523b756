"""Exposure row by row: when each row of a frame is exposed, and how much light of flickering lamps it collects.

A lens and a mosaic are linear, and a lamp's flicker is the same for all that it lights. So a frame under lamps that
flicker is a sum over lamps of their parts of the steady frame, in which each row is multiplied by the lamp's mean light
while that row is exposed. Nothing is rendered again.
"""

from collections.abc import Iterable
from math import floor

import numpy as np
from numpy.typing import NDArray

from rodcone.errors import InputError
from rodcone.types import Floats, Mosaic
from sensor.config import SensorConfig, row_starts_s
from sensor.flicker.waveform import Waveform


def check_flicker(sensor: SensorConfig, held: bool = False) -> None:
    """Raise `InputError` for a camera for which flicker isn't modelled; with `held` a camera that shakes is allowed."""
    if reads_parts(sensor):
        raise InputError(
            "flicker: the camera reads some charge after a part of the time, which sees another part of the lamp's "
            "period; allowed: readings of the whole time; leave flicker out, or give every reading the whole time"
        )
    if sensor.lens.shake_um and not held:
        raise InputError(
            f"flicker: with shake_um {sensor.lens.shake_um:g}, whose blur follows the lamp's light; allowed here: 0; "
            "leave one of them out, or take single pictures by rodcone capture"
        )


def reads_parts(sensor: SensorConfig) -> bool:
    """Return whether a camera reads some charge after only a part of the exposure time."""
    times = [x.time_share for x in sensor.chip.readings] + [x.time_share for x in sensor.chip.channels]
    return min(times, default=1.0) < 1 or any(x.metered for x in sensor.chip.channels)


def row_weights(waveform: Waveform, sensor: SensorConfig, rows: int, exposure_s: float, start_s: float = 0.0) -> Floats:
    """Return the light that a lamp gives each row of photodiodes in its exposure, over the lamp's mean; shape (rows,).

    Parameters
    ----------
    waveform : Waveform
    sensor : SensorConfig
        Its `row_time_us` is the delay between the starts of two rows; photodiodes that bin are exposed together.
    rows : int
        Number of rows of photodiodes.
    exposure_s : float
    start_s : float
        Time at which the exposure of the first row starts, by the lamp's clock.
    """
    if exposure_s == 0:
        return np.ones(rows)
    starts = row_starts_s(sensor, rows // sensor.sites)
    return np.repeat(waveform.mean(start_s + starts, exposure_s), sensor.sites)


def flickering(
    steady_e: Mosaic,
    parts: Iterable[tuple[Waveform, Mosaic]],
    sensor: SensorConfig,
    exposure_s: float,
    start_s: float = 0.0,
) -> NDArray[np.float64]:
    """Return the expected electrons of one exposure under lamps that flicker, shape (h, w).

    Parameters
    ----------
    steady_e : (h, w) float64
        Expected electrons if every lamp gave its mean all the time.
    parts : iterable of (Waveform, (h, w) float64)
        Each lamp that flickers, and its part of `steady_e`.
    sensor, exposure_s, start_s
        As in `row_weights`.
    """
    result = np.array(steady_e, np.float64)
    for waveform, part_e in parts:
        weights = row_weights(waveform, sensor, result.shape[0], exposure_s, start_s)
        result += (weights - 1)[:, None] * part_e
    return np.maximum(result, 0.0)  # the parts are images of their own, whose rounding differs


def steady_exposure_s(waveforms: Iterable[Waveform], exposure_s: float) -> float:
    """Cut an exposure [s] to whole periods of the slowest lamp; leave one that is shorter than a period.

    Every row then collects the same light of that lamp; cameras call this anti-banding. Faster lamps still make bands
    if their periods don't divide the slowest lamp's.
    """
    slowest_s = max((x.period_s for x in waveforms), default=0.0)
    periods = floor(exposure_s / slowest_s + 1e-9) if slowest_s else 0
    return periods * slowest_s if periods else exposure_s
