"""Times within an exposure at which a scene that moves is rendered, and the longest exposure of a study."""

from collections.abc import Iterable

import numpy as np

from rodcone.errors import InputError, require_whole
from rodcone.types import Floats
from sensor.config import SensorConfig, row_starts_s
from sensor.flicker.figures import flicker_figures
from sensor.flicker.rows import reads_parts
from sensor.flicker.waveform import Waveform

MOST_SWING = 0.05  # most that a lamp's mean light may swing between the equal parts of an exposure, as a share


def moments_s(exposure_s: float, count: int) -> Floats:
    """Return the middles of `count` equal parts of an exposure that begins at time 0, shape (count,) [s].

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
    """Return when the exposure of each row of photodiodes starts [s], from the first start on; shape (rows,).

    Photodiodes that bin are exposed together.
    """
    return np.repeat(row_starts_s(sensor, rows // sensor.sites), sensor.sites)


def longest_span_s(sensors: Iterable[SensorConfig], rows: int, exposures_s: Iterable[float]) -> float:
    """Return the longest time from the first row's start to the last row's end, over all sensors and exposures [s]."""
    readouts_s = [float(site_starts_s(sensor, rows).max()) for sensor in sensors]
    return max(readouts_s) + max(exposures_s)


def check_moving(sensor: SensorConfig, lamps: Iterable[Waveform], whole_s: float, count: int) -> None:
    """Check that renders at several times of an exposure may simply be averaged, because all parts of it count alike.

    Parameters
    ----------
    sensor : SensorConfig
    lamps : iterable of Waveform
        Waveforms of lamps that flicker.
    whole_s : float
        Time from the first row's start to the last row's end.
    count : int
        Number of the times.

    Raises
    ------
    InputError
        For a camera that reads some charge after only a part of the exposure, and for lamps whose mean light over each
        of `count` equal parts of the exposure swings by more than `MOST_SWING`.
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
