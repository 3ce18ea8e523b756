"""When a scene that moves is looked at: times within an exposure, and the time that a study's exposures lie within."""

from collections.abc import Iterable

import numpy as np

from rodcone.errors import InputError, require_whole
from rodcone.types import Floats
from sensor.config import SensorConfig, row_starts_s
from sensor.flicker.figures import flicker_figures
from sensor.flicker.rows import reads_parts
from sensor.flicker.waveform import Waveform

MOST_SWING = 0.05  # of a lamp's light between parts of an exposure that count alike


def moments_s(exposure_s: float, count: int) -> Floats:
    """Give the middles of `count` equal parts of an exposure that begins at 0, shape (count,) [s].

    Parameters
    ----------
    exposure_s : float
    count : int

    Raises
    ------
    InputError
        For a count that isn't a whole number, 1 or more.

    Examples
    --------
    >>> import rodcone
    >>> rodcone.moments_s(0.1, 2).tolist()
    [0.025, 0.07500000000000001]
    """
    require_whole("count", count, 1, 1 << 16, "give times within the exposure")
    return np.asarray((np.arange(count) + 0.5) * (exposure_s / count))


def site_starts_s(sensor: SensorConfig, rows: int) -> Floats:
    """Give when the exposure of each row of photodiodes starts [s], after the first one's; shape (rows,).

    Photodiodes that bin are exposed together.
    """
    return np.repeat(row_starts_s(sensor, rows // sensor.sites), sensor.sites)


def longest_span_s(sensors: Iterable[SensorConfig], rows: int, exposures_s: Iterable[float]) -> float:
    """Give the longest time from the first row's start to the last row's end, of any sensor and exposure [s]."""
    readouts_s = [float(site_starts_s(sensor, rows).max()) for sensor in sensors]
    return max(readouts_s) + max(exposures_s)


def check_moving(sensor: SensorConfig, lamps: Iterable[Waveform], whole_s: float, count: int) -> None:
    """Check that the times at which a scene that moves is looked at may count by their number alone.

    Parameters
    ----------
    sensor : SensorConfig
    lamps : iterable of Waveform
        That flicker.
    whole_s : float
        From the first row's start to the last row's end.
    count : int
        Of the times.

    Raises
    ------
    InputError
        For a camera that reads some charge after a part of the exposure, and for lamps whose light isn't steady over
        the part of it for which one time stands.
    """
    if reads_parts(sensor):
        raise InputError(
            "moments: the camera reads some charge after a part of the time, which sees less of the motion; allowed: "
            "readings of the whole time; leave moments out, or give every reading the whole time"
        )
    part_s = whole_s / count
    for lamp in lamps if whole_s else ():
        swing = flicker_figures(lamp, part_s).modulation_index
        if swing > MOST_SWING:
            period_s = 1 / lamp.frequency_hz
            raise InputError(
                f"flicker: beside moments = {count} each stands for {1e3 * part_s:.3g} ms, in which a lamp of "
                f"{lamp.frequency_hz:g} Hz swings by {swing:.0%}; allowed: {MOST_SWING:.0%}, because all count alike; "
                f"give each whole periods: fewer moments, or an exposure of {1e3 * count * period_s:.3g} ms"
            )
