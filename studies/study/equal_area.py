"""Compare sensors of one size: pixels follow from each pitch; pictures are averaged to the coarsest sensor's pixels."""

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
        """Return the sensor's height and width in pixels of `pitch_um`, for the proportions of a picture.

        Both are multiples of `block`.
        """
        blocks = self.side_um / (pitch_um * block * max(picture))
        return block * max(1, round(picture[0] * blocks)), block * max(1, round(picture[1] * blocks))

    def view(self, radiance: SpectralRadiance, pitch_um: float, block: int = 1) -> SpectralRadiance:
        """Return the radiance averaged over each of the sensor's pixels; the parameters are as in `shape`."""
        return replace(radiance, values=area_average(radiance.values, self.shape(radiance.shape, pitch_um, block)))


def sensor_shapes(area: EqualArea, sensors: Sequence[str], picture: tuple[int, int]) -> dict[str, tuple[int, int]]:
    """Return the height and width of each sensor in pixels of its raw image, for a picture's proportions."""
    opened = {name: preset(name) for name in sensors}
    return {name: area.shape(picture, *site_grid(sensor)) for name, sensor in opened.items()}


def site_grid(sensor: SensorConfig) -> tuple[float, int]:
    """Return the pitch of a sensor's pixels [um], and how many along either side make a pixel of its raw image."""
    return sensor.site_pitch_um, sensor.sites


def require_pixels(area: EqualArea, sensors: Sequence[str], picture: tuple[int, int]) -> None:
    """Raise `InputError` if a render has fewer pixels than a sensor, for which it would have to be enlarged."""
    for name, shape in sensor_shapes(area, sensors, picture).items():
        if max(shape) > max(picture):
            raise InputError(
                f"render.size: {max(picture)}, and {name} has {max(shape)} pixels on {area.side_um:g} um; allowed: "
                f"{max(shape)} or more; raise it, or lower sensor_side_um"
            )


def area_average(values: NDArray[Real], shape: tuple[int, int]) -> NDArray[Real]:
    """Average a picture over each pixel of another grid on the same area; within a pixel the picture is constant.

    Parameters
    ----------
    values : (h, w, ...) floating
    shape : (int, int)
        Height and width of the other grid in pixels; it may be finer or coarser.

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
    """Divide one length into `pixels` and into `other` equal intervals; return how the second overlap the first.

    The result, shape (other, pixels), is the share of each of the `other` intervals that lies in each of the `pixels`
    intervals. Each row has the sum 1.
    """
    ends, starts = np.arange(1, pixels + 1) / pixels, np.arange(pixels) / pixels
    low, high = np.arange(other)[:, None] / other, np.arange(1, other + 1)[:, None] / other
    return np.asarray(np.maximum(np.minimum(ends, high) - np.maximum(starts, low), 0.0) * other)
