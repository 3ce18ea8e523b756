"""A hard case: a situation, what it must keep, and the margin by which it keeps it."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from render.radiance import SpectralRadiance
from sensor.cfa import BAYER, Tile
from sensor.config import SensorConfig
from sensor.presets import preset


def low_noise() -> SensorConfig:
    """Preset behind a lens that draws points as points: each term of the lens has cases of its own."""
    sensor = preset("low_noise")
    return replace(sensor, lens=replace(sensor.lens, diffraction=0.0))


@dataclass(frozen=True)
class Situation:
    """What is photographed, with what, and how it is developed.

    Attributes
    ----------
    radiance : SpectralRadiance
    sensor : SensorConfig
        With R, G, B and W in its mosaic.
    exposure_s : float
        [s].
    develop : mapping
        Keywords of `isp.interleaved.pipeline.picture_interleaved`, and fields of its `settings`.
    bayer : tuple of str
        Mosaic of the same camera's other picture.
    samples_per_pixel : int
        Of `radiance`, along each side of a pixel.
    """

    radiance: SpectralRadiance
    sensor: SensorConfig = field(default_factory=low_noise)
    exposure_s: float = 0.01
    develop: Mapping[str, Any] = field(default_factory=dict)
    bayer: Tile = BAYER
    samples_per_pixel: int = 1

    @property
    def shape(self) -> tuple[int, int]:
        """Height and width of the frame in pixels."""
        height, width = self.radiance.shape
        return height // self.samples_per_pixel, width // self.samples_per_pixel


@dataclass(frozen=True)
class Margin:
    """Worst error and the error allowed there; the invariant is kept while their ratio is 1 or less.

    Attributes
    ----------
    worst, allowed : float
        At the pixel where their ratio is largest; NaN and infinity are never kept.
    unit : str
    """

    worst: float
    allowed: float
    unit: str

    @property
    def share(self) -> float:
        """Worst error over the allowed one; 0 without error, infinite where nothing is allowed."""
        if self.worst == 0:
            return 0.0
        return float(self.worst / self.allowed) if self.allowed > 0 and np.isfinite(self.worst) else np.inf

    @property
    def kept(self) -> bool:
        """Whether the invariant is kept."""
        return self.share <= 1.0


# None where an invariant says nothing about a situation: a frame without an interior, a lens that falls off.
Measure = Callable[[Situation], Margin | None]


@dataclass(frozen=True)
class Case:
    """A hard case.

    Attributes
    ----------
    name, setup : str
        The latter in words.
    situation : callable
        Makes the situation.
    own : callable or None
        Measures what this case must keep besides the invariants of all cases.
    """

    name: str
    setup: str
    situation: Callable[[], Situation]
    own: Measure | None = None

    @property
    def promise(self) -> str:
        """What `own` measures: the first line of its docstring."""
        return (self.own.__doc__ or "").split(".\n")[0].rstrip(".") if self.own else ""


def worst_of(error: ArrayLike, allowed: ArrayLike, unit: str) -> Margin:
    """Margin at the pixel where error over allowed is largest; arrays of one shape, or one allowance for all."""
    found = np.abs(np.asarray(error, dtype=np.float64)).ravel()
    limit = np.broadcast_to(np.asarray(allowed, dtype=np.float64), np.shape(error)).ravel()
    found = np.where(np.isfinite(found), found, np.inf)
    with np.errstate(divide="ignore", invalid="ignore"):
        share = np.where(found > 0, found / limit, 0.0)
    index = int(np.argmax(share))
    return Margin(float(found[index]), float(limit[index]), unit)


def worse(*margins: Margin) -> Margin:
    """The margin with the largest share."""
    return max(margins, key=lambda margin: margin.share)
