"""Simulate a sensor's frames on a test bench, with the statistics of EMVA Standard 1288 (release 4.0 Linear)."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from rodcone.display import brief
from rodcone.types import Floats
from sensor.capture import expose
from sensor.config import SensorConfig
from sensor.device import draw_device

# Expected photo-electrons of every pixel and the exposure time [s] in, one frame [DN] out.
Expose: TypeAlias = Callable[[float, float], NDArray[np.uint16]]


def light_bench(sensor: SensorConfig, shape: tuple[int, int], seed: int, exact: bool = False) -> Expose:
    """Return a test bench: one chip under uniform light that is given in electrons, as with a quantum efficiency of 1.

    The electrons are those of a raw image's pixel: four that bin share them. Its frames are drawn as
    `sensor.capture.expose` draws them.
    """
    device = draw_device(sensor, shape, np.random.default_rng([seed, 0]))
    rng = np.random.default_rng([seed, 1])
    share = 1 / sensor.sites**2

    def frame(light_e: float, exposure_s: float) -> NDArray[np.uint16]:
        return expose(np.full(shape, share * light_e), sensor, exposure_s, device, rng, exact=exact).dn

    return frame


@dataclass(frozen=True)
class Transfer:
    """A photon-transfer series: two frames at each level of light.

    Attributes
    ----------
    light_e : (level,) float64
        Expected photo-electrons of a pixel.
    mean_dn, variance_dn2 : (level,) float64
        Mean over both frames; temporal variance, half of the mean squared difference less the mean's own.
    """

    light_e: Floats
    mean_dn: Floats
    variance_dn2: Floats

    __repr__ = brief


@dataclass(frozen=True)
class Stack:
    """Many frames of one level.

    Attributes
    ----------
    mean_dn : (h, w) float64
        Mean over frames.
    variance_dn2 : float
        Temporal variance, mean over pixels.
    frames : int
    """

    mean_dn: NDArray[np.float64]
    variance_dn2: float
    frames: int

    __repr__ = brief

    @property
    def spatial_dn2(self) -> float:
        """Return the variance over pixels [DN^2], less the temporal variance that is left in the mean over frames."""
        return float(self.mean_dn.var() - self.variance_dn2 / self.frames)


def take_transfer(expose: Expose, light_e: Sequence[float] | Floats, exposure_s: float) -> Transfer:
    """Take two frames per level."""
    rows = []
    for level in light_e:
        first, second = (expose(float(level), exposure_s).astype(np.float64) for _ in range(2))
        means = first.mean(), second.mean()
        variance = (np.mean((first - second) ** 2) - (means[0] - means[1]) ** 2) / 2
        rows.append((level, (means[0] + means[1]) / 2, variance))
    return Transfer(*np.array(rows, dtype=np.float64).T)


def take_stack(expose: Expose, light_e: float, exposure_s: float, frames: int) -> Stack:
    """Take `frames` frames of one level, two or more."""
    total = expose(light_e, exposure_s).astype(np.float64)  # whole numbers: the sums below are exact
    squares = total**2
    for _ in range(frames - 1):
        frame = expose(light_e, exposure_s).astype(np.float64)
        total += frame
        squares += frame**2
    mean = np.asarray(total / frames)
    variance = float(np.mean((squares - total**2 / frames) / (frames - 1)))
    return Stack(mean, variance, frames)


def column_variance(image: NDArray[np.float64]) -> tuple[float, float]:
    """Estimate the variance of the offsets that the pixels of a column share, and its standard error.

    The part of the column means' variance that comes from independent pixels is subtracted.

    Parameters
    ----------
    image : (h, w) float64
        Two or more rows and columns.
    """
    height, width = image.shape
    of_means = float(image.mean(axis=0).var(ddof=1))
    of_pixels = float(image.var(axis=0, ddof=1).mean()) / height
    return of_means - of_pixels, of_means * float(np.sqrt(2 / (width - 1)))


def dark_slopes(expose: Expose, exposures_s: Sequence[float]) -> NDArray[np.float64]:
    """Fit the slope of each pixel's dark signal over exposure time [DN/s], shape (h, w), from two frames per time."""
    times = np.asarray(exposures_s, dtype=np.float64)
    centred = times - times.mean()
    sums = sum(
        weight * (expose(0.0, float(time)).astype(np.float64) + expose(0.0, float(time)))
        for weight, time in zip(centred, times, strict=True)
    )
    return np.asarray(sums / 2 / np.sum(centred**2))


def hot_pixels(slopes: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Mark pixels whose dark current is over 6 robust standard deviations above the median, shape (h, w)."""
    median = np.median(slopes)
    spread = 1.4826 * np.median(np.abs(slopes - median))  # standard deviation, as of a normal distribution
    return np.asarray(slopes > median + 6 * spread)
