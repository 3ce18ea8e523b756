"""A camera's colour calibration: what its maker measures once, and a raw file carries to whoever develops it."""

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from render.spectrum import Floats
from rodcone.brief import brief
from rodcone.doors import method
from rodcone.errors import InputError


@dataclass(frozen=True)
class ColourCalibration:
    """Colour of a camera under illuminants A and D65, and under the light of the exposure.

    Channels stand in the order of `sensor.cfa.channels`; ``R, G, B`` come first. Where there is no green,
    `sensor.cfa.unit_channel` is in its place.

    Attributes
    ----------
    neutral : (channel,) float64
        Relative response to a spectrally flat surface under the light of the exposure, green 1: the as-shot neutral.
    to_srgb : (3, 3) float64
        From R, G, B (the first three channels) balanced by `neutral` to linear sRGB, adapted from that light to D65;
        rows sum to 1. (3, channel) for one or two channels, from which grey is made.
    xyz_to_camera_a, xyz_to_camera_d65 : (channel, 3) float64
        From XYZ under the illuminant to the camera's channels, green 1 for its white: DNG's ColorMatrix1 and 2.
    camera_to_xyz_a, camera_to_xyz_d65 : (3, channel) float64
        From channels balanced under the illuminant to XYZ adapted to D50: DNG's ForwardMatrix1 and 2.

    Raises
    ------
    InputError
        For a shape that doesn't fit, a number that isn't finite, or a neutral that isn't positive.
    """

    neutral: Floats
    to_srgb: Floats
    xyz_to_camera_a: Floats
    xyz_to_camera_d65: Floats
    camera_to_xyz_a: Floats
    camera_to_xyz_d65: Floats

    __repr__ = brief

    def __post_init__(self) -> None:
        neutral: Any = self.neutral  # from a file it may be anything, a list of lists of unequal length too
        count = len(neutral) if isinstance(neutral, Sequence) else np.size(neutral)
        shapes = [(count,), (3, min(count, 3)), (count, 3), (count, 3), (3, count), (3, count)]
        for field, shape in zip(fields(self), shapes, strict=True):
            object.__setattr__(self, field.name, _numbers(field.name, getattr(self, field.name), shape))
        if count < 1 or not np.all(self.neutral > 0):
            raise InputError(
                f"neutral: {self.neutral.tolist()!r} is not allowed; give a positive response of each channel"
            )

    @method
    def part(self, index: Sequence[int]) -> "ColourCalibration":
        """Calibration of some of the channels; ``R, G, B`` have to stay in front."""
        kept = list(index)
        return replace(
            self,
            neutral=self.neutral[kept],
            xyz_to_camera_a=self.xyz_to_camera_a[kept],
            xyz_to_camera_d65=self.xyz_to_camera_d65[kept],
            camera_to_xyz_a=self.camera_to_xyz_a[:, kept],
            camera_to_xyz_d65=self.camera_to_xyz_d65[:, kept],
        )


def _numbers(name: str, values: Any, shape: tuple[int, ...]) -> Floats:
    """Array of finite numbers of `shape`, or `InputError`."""
    try:
        array = np.array(values, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):  # lists of unequal length, texts, whole numbers beyond a float
        array = np.empty(0)
    if array.shape != shape or not np.all(np.isfinite(array)):
        raise InputError(f"{name}: shape {array.shape} is not allowed; give {shape} of finite numbers")
    return array
