"""One chip: its fixed patterns, which stay the same over exposures."""

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
import scipy
from numpy.typing import NDArray

from rodcone.display import brief
from sensor.cfa import block_sums
from sensor.config import SensorConfig, check_frame
from sensor.photodiodes import check_chip
from sensor.random import NoiseTerm, draw_key, normals
from sensor.readings.resolve import by_site, chip_readings, several

_MOST_KEPT = 1 << 18  # draws of chips with at most this many pixels are cached, 2 MB each


@dataclass(frozen=True)
class Device:
    """Fixed patterns of a chip.

    Attributes
    ----------
    photo_response : (h, w) float64
        Relative gain of each pixel's photo-electrons, mean 1 and standard deviation PRNU; not negative.
    dark_offset_e : (h, w) float64
        Fixed offset of each reading [e-], mean 0: DSNU and its column's offset. (h / 2, w / 2) where 2x2 pixels are
        read as one: binned in charge.
    column_gain : (w,) float64, optional
        Relative gain of each column's amplifier, mean 1; not negative. None where all are 1. (w / 2,) as above.
    hot : (h, w) bool, optional
        Map of hot pixels, like the defect map in a camera's calibration. None if no pixel is hot.
    telegraph_e : (h, w) float64, optional
        Height of each pixel's random telegraph noise [e-], 0 where it has no trap. None where no pixel has one.
        (h / 2, w / 2) as above.
    readings : tuple of Device
        For a sensor with several readings, the patterns of each: PRNU and hot pixels of its photodiode, its own
        offsets, and the column amplifiers, which all readings share.
    """

    photo_response: NDArray[np.float64]
    dark_offset_e: NDArray[np.float64]
    column_gain: NDArray[np.float64] | None = None
    hot: NDArray[np.bool_] | None = None
    telegraph_e: NDArray[np.float64] | None = None
    readings: tuple["Device", ...] = ()

    __repr__ = brief

    @property
    def shape(self) -> tuple[int, int]:
        """Return the height and width in pixels."""
        return self.photo_response.shape[0], self.photo_response.shape[1]


def draw_device(sensor: SensorConfig, shape: tuple[int, int], rng: np.random.Generator) -> Device:
    """Make a chip of `shape` pixels; one key from `rng` decides all of it.

    Raises
    ------
    InputError
        Where the shape doesn't hold a tile of the mosaic, is odd for a sensor that bins, or `rng` isn't a Generator.

    Examples
    --------
    >>> import numpy as np
    >>> import rodcone
    >>> sensor = rodcone.low_noise()
    >>> rodcone.draw_device(sensor, (4, 6), np.random.default_rng(1)).photo_response.shape
    (4, 6)
    """
    check_frame(sensor, shape)
    check_chip(sensor)
    in_charge = sensor.in_charge
    key = draw_key(rng)
    one_row = (1, shape[1] // 2 if in_charge else shape[1])
    pixel = sensor.photosites.pixel
    draws = _normals_kept if shape[0] * shape[1] <= _MOST_KEPT else normals

    def drawn(dsnu_e: float | NDArray[np.float64], photodiode: int, reading: int) -> Device:
        response = np.maximum(1.0 + pixel.prnu * draws(key, NoiseTerm.PRNU, shape, photodiode), 0.0)
        offset_e = dsnu_e * draws(key, NoiseTerm.DSNU, shape, reading)
        offset_e = block_sums(offset_e) if in_charge else offset_e
        column_gain = hot = telegraph_e = None
        if pixel.column_offset_e:
            offset_e += pixel.column_offset_e * normals(key, NoiseTerm.COLUMN_OFFSET, one_row)
        if pixel.column_gain_spread:
            spread = pixel.column_gain_spread * normals(key, NoiseTerm.COLUMN_GAIN, one_row)[0]
            column_gain = np.maximum(1.0 + spread, 0.0)
        if pixel.hot_pixel_share:
            hot = normals(key, NoiseTerm.HOT, shape, photodiode) < scipy.special.ndtri(pixel.hot_pixel_share)
        if pixel.telegraph_noise_e:
            rank = scipy.special.ndtr(normals(key, NoiseTerm.TELEGRAPH, offset_e.shape, photodiode))
            # A uniform number below the share, divided by the share, is uniform too; its logarithm is exponential.
            telegraph_e = pixel.telegraph_e * np.maximum(-np.log(rank / pixel.telegraph_share), 0.0)
        return Device(response, offset_e, column_gain=column_gain, hot=hot, telegraph_e=telegraph_e)

    readings = chip_readings(sensor.photosites, exposure_s=0.0)
    if not several(readings):
        return drawn(by_site([x.sensor.pixel.dsnu_e for x in readings], readings, shape), 0, 0)
    photodiodes = list(dict.fromkeys(x.photodiode for x in readings))
    every = [drawn(x.sensor.pixel.dsnu_e, photodiodes.index(x.photodiode), n) for n, x in enumerate(readings)]
    return replace(every[0], readings=tuple(every))


@lru_cache(maxsize=8)
def _normals_kept(key: int, term: NoiseTerm, shape: tuple[int, int], number: int) -> NDArray[np.float64]:
    """Draw `normals` and cache them.

    A chip of which only PRNU or DSNU changes needs the same draws again, and they take most of a small chip's time.
    """
    draws = normals(key, term, shape, number)
    draws.flags.writeable = False
    return draws
