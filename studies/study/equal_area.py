"""Sensors of one size: pixels by pitch, and pictures averaged to the pixels of the coarsest sensor."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from render.radiance import SpectralRadiance
from rodcone.errors import InputError
from sensor.config import SensorConfig
from sensor.presets import preset

Real = TypeVar("Real", bound=np.floating)


@dataclass(frozen=True)
class EqualArea:
    """Size that all sensors of a study have.

    Attributes
    ----------
    side_um : float
        Longer side of every sensor.
    coarsest_um : float
        Largest pitch among the sensors; for a sensor that bins, the pitch of its raw image. Pictures are compared at
        pixels of this pitch, so that none is interpolated.
    """

    side_um: float
    coarsest_um: float

    def shape(self, picture: tuple[int, int], pitch_um: float, block: int = 1) -> tuple[int, int]:
        """Return height and width in pixels of a pitch, in a picture's proportions and in whole blocks of pixels."""
        blocks = self.side_um / (pitch_um * block * max(picture))
        return block * max(1, round(picture[0] * blocks)), block * max(1, round(picture[1] * blocks))

    def view(self, radiance: SpectralRadiance, pitch_um: float, block: int = 1) -> SpectralRadiance:
        """Return the radiance averaged over the pixels of a pitch, in whole blocks."""
        return replace(radiance, values=area_average(radiance.values, self.shape(radiance.shape, pitch_um, block)))


def sensor_shapes(area: EqualArea, sensors: Sequence[str], picture: tuple[int, int]) -> dict[str, tuple[int, int]]:
    """Return the height and width of each sensor in pixels, for a picture's proportions."""
    opened = {name: preset(name) for name in sensors}
    return {name: area.shape(picture, *site_grid(sensor)) for name, sensor in opened.items()}


def site_grid(sensor: SensorConfig) -> tuple[float, int]:
    """Return the pitch of a sensor's pixels [um], and how many along either side make a pixel of its raw image."""
    return sensor.site_pitch_um, sensor.sites


def require_pixels(area: EqualArea, sensors: Sequence[str], picture: tuple[int, int]) -> None:
    """Raise `InputError` for a render of fewer pixels than a sensor has: it would be enlarged."""
    for name, shape in sensor_shapes(area, sensors, picture).items():
        if max(shape) > max(picture):
            raise InputError(
                f"render.size: {max(picture)}, and {name} has {max(shape)} pixels on {area.side_um:g} um; allowed: "
                f"{max(shape)} or more; raise it, or lower sensor_side_um"
            )


def area_average(values: NDArray[Real], shape: tuple[int, int]) -> NDArray[Real]:
    """Average a picture over each pixel of another grid on the same area, with pixels as even squares.

    Parameters
    ----------
    values : (h, w, ...) floating
    shape : (int, int)
        Height and width of the other grid, finer or coarser.

    Returns
    -------
    (shape[0], shape[1], ...) array of the same type
        The picture's mean is kept.
    """
    rows, columns = (
        _overlaps(pixels, other).astype(values.dtype) for pixels, other in zip(values.shape, shape, strict=False)
    )
    along = np.tensordot(rows, values, axes=1)
    return np.ascontiguousarray(np.moveaxis(np.tensordot(columns, along, axes=(1, 1)), 0, 1))


def in_pixels(radiance: SpectralRadiance, samples: int) -> SpectralRadiance:
    """Average the radiance over whole pixels of `samples` samples along each side."""
    if samples == 1:
        return radiance
    height, width = radiance.shape
    return replace(radiance, values=area_average(radiance.values, (height // samples, width // samples)))


def _overlaps(pixels: int, other: int) -> NDArray[np.float64]:
    """Return the share of each of `pixels` intervals in each of `other` on the same length, shape (other, pixels).

    Each row has the sum 1.
    """
    ends, starts = np.arange(1, pixels + 1) / pixels, np.arange(pixels) / pixels
    low, high = np.arange(other)[:, None] / other, np.arange(1, other + 1)[:, None] / other
    return np.asarray(np.maximum(np.minimum(ends, high) - np.maximum(starts, low), 0.0) * other)
