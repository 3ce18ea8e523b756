"""One chip: its fixed patterns, which stay the same over exposures."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sensor.cfa import check_covers
from sensor.config import SensorConfig
from sensor.random import Term, draw_key, normals


@dataclass(frozen=True)
class Device:
    """Fixed patterns of a chip.

    Attributes
    ----------
    photo_response : (h, w) float64
        Relative gain of each pixel's photo-electrons, mean 1 and standard deviation PRNU; not negative.
    dark_offset_e : (h, w) float64
        Fixed offset of each pixel [e-], mean 0 and standard deviation DSNU.
    """

    photo_response: NDArray[np.float64]
    dark_offset_e: NDArray[np.float64]

    @property
    def shape(self) -> tuple[int, int]:
        """Height and width in pixels."""
        return self.photo_response.shape[0], self.photo_response.shape[1]


def draw_device(sensor: SensorConfig, shape: tuple[int, int], rng: np.random.Generator) -> Device:
    """Make a chip of `shape` pixels; one key from `rng` decides all of it.

    Raises
    ------
    InputError
        Where the shape doesn't hold a tile of the mosaic, or `rng` isn't a Generator.
    """
    check_covers(sensor.cfa, tuple(shape))
    key = draw_key(rng)
    response = 1.0 + sensor.pixel.prnu * normals(key, Term.PRNU, shape)
    return Device(np.maximum(response, 0.0), sensor.pixel.dsnu_e * normals(key, Term.DSNU, shape))
