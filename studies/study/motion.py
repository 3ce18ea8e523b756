"""When a scene that moves is looked at: times within an exposure, and the time that a study's exposures lie within."""

from collections.abc import Iterable

import numpy as np

from rodcone.errors import require_whole
from rodcone.types import Floats
from sensor.config import SensorConfig, row_starts_s


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
