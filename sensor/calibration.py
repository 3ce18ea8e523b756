"""A camera's calibration of colour and noise, which its maker measures once, and which its raw files hold."""

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from math import hypot
from typing import Annotated, Any

import numpy as np

from rodcone.display import brief
from rodcone.doors import method
from rodcone.errors import InputError, require_fields
from rodcone.types import Floats
from sensor.noise_law import NoiseLaw


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
        """Return the calibration of the channels with these indices; ``R, G, B`` have to stay in front."""
        kept = list(index)
        return replace(
            self,
            neutral=self.neutral[kept],
            xyz_to_camera_a=self.xyz_to_camera_a[kept],
            xyz_to_camera_d65=self.xyz_to_camera_d65[kept],
            camera_to_xyz_a=self.camera_to_xyz_a[:, kept],
            camera_to_xyz_d65=self.camera_to_xyz_d65[:, kept],
        )


def _numbers(name: str, values: object, shape: tuple[int, ...]) -> Floats:
    """Convert values to an array of finite numbers of `shape`; raise `InputError` if that isn't possible."""
    try:
        array = np.array(values, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):  # lists of unequal length, texts, whole numbers beyond a float
        array = np.empty(0)
    if array.shape != shape or not np.all(np.isfinite(array)):
        raise InputError(f"{name}: shape {array.shape} is not allowed; give {shape} of finite numbers")
    return array


@dataclass(frozen=True)
class NoiseStep:
    """Noise of samples above a level of light: the terms of a `sensor.noise_law.NoiseLaw`, as a raw file holds them.

    Attributes
    ----------
    from_e : float
        Electrons above black from which on the step holds.
    shot : float
        Variance of a sample's shot noise over its electrons. It is above 1 if not all charges of a pixel count.
    read_noise_e, dsnu_e, prnu : float
        As in `RawImage`.
    """

    from_e: Annotated[float, (0.0, 1e12, "give electrons")]
    shot: Annotated[float, (1e-6, 1e21, "give a factor")]
    read_noise_e: Annotated[float, (0.0, 1e12, "give electrons, 0 for none")]
    dsnu_e: Annotated[float, (0.0, 1e12, "give electrons, 0 for none")]
    prnu: Annotated[float, (0.0, 1.0, "give a fraction: 1.7 % is 0.017")]

    __repr__ = brief

    def __post_init__(self) -> None:
        require_fields(self, "noise_steps: ")

    @property
    def law(self) -> NoiseLaw:
        """Return the law of a sample's variance by its mean from `from_e` on, without the columns' gain noise."""
        return NoiseLaw(self.shot, self.read_noise_e, self.dsnu_e, self.prnu)


@dataclass(frozen=True)
class ChannelNoise:
    """Noise and full well of a channel whose pixels are read in a way of their own, in the raw image's electrons.

    Attributes
    ----------
    channel : str
    full_well_e : float
        Electrons at which its samples are full.
    shot, read_noise_e, dsnu_e, prnu : float
        As in `NoiseStep`; ``shot`` is 1 over the share of time and light that the channel's pixels collect.
    dark_current_e : float
        As in `RawImage`.
    light_share : float
        Share of the light that a neutral density in front of its pixels lets through.
    """

    channel: str
    full_well_e: Annotated[float, (1e-18, 1e20, "give electrons")]
    shot: Annotated[float, (1e-6, 1e21, "give a factor")]
    read_noise_e: Annotated[float, (0.0, 1e20, "give electrons, 0 for none")]
    dsnu_e: Annotated[float, (0.0, 1e20, "give electrons, 0 for none")]
    prnu: Annotated[float, (0.0, 1.0, "give a fraction: 1.7 % is 0.017")]
    dark_current_e: Annotated[float, (0.0, 1e20, "give electrons, 0 for none")] = 0.0
    light_share: Annotated[float, (1e-6, 1.0, "give what the density lets through, 1 for none")] = 1.0

    __repr__ = brief

    def __post_init__(self) -> None:
        require_fields(self, "channel_noise: ")

    @property
    def law(self) -> NoiseLaw:
        """Return the law of a sample's variance by its mean, without the noise of the columns' gains."""
        return NoiseLaw(self.shot, self.read_noise_e, self.dsnu_e, self.prnu)

    @property
    def dark_noise_e(self) -> float:
        """Return the standard deviation of a dark sample [e-]."""
        return hypot(self.read_noise_e, self.dsnu_e)
