"""A render's error over the sensor's own noise, against two references whose noise is independent of each other.

The product of the differences from both, (d - r1)(d - r2), has the squared error of d as its expectation: the
references' own noise falls out of its mean, though not out of its quantiles.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from render.error_estimates import pooled
from render.radiance import SpectralRadiance
from sensor.config import SensorConfig
from sensor.exposure import auto_exposure_s
from sensor.optics import form_image
from sensor.readout import noise_variance
from sensor.response import channel_electrons

Image = NDArray[np.float64]


@dataclass(frozen=True)
class Yardstick:
    """Two references behind one sensor, and the sensor's own noise.

    Attributes
    ----------
    sensor : SensorConfig
    exposure_s : float
        Auto exposure of the references' mean.
    references : pair of (channel, h, w) float64
        Expected electrons.
    noise_e2 : (channel, h, w) float64
        The sensor's own noise variance at the references' mean.
    inside : (channel, h, w) bool
        Below full well, where no light is seen directly.
    """

    sensor: SensorConfig
    exposure_s: float
    references: tuple[Image, Image]
    noise_e2: Image
    inside: NDArray[np.bool_]


def electrons(radiance: SpectralRadiance, sensor: SensorConfig, exposure_s: float) -> Image:
    """Expected electrons behind every filter at every pixel, shape (channel, h, w)."""
    return np.moveaxis(channel_electrons(form_image(radiance, sensor), sensor, exposure_s), -1, 0)


def yardstick(
    references: tuple[SpectralRadiance, SpectralRadiance], lamps: NDArray[np.bool_], sensor: SensorConfig
) -> Yardstick:
    """Fix exposure, noise and pixels by two references; `lamps` (h, w) are pixels that see a light directly."""
    images = [form_image(reference, sensor) for reference in references]
    exposure_s = float(np.mean([auto_exposure_s(image, sensor) for image in images]))
    one, other = (electrons(reference, sensor, exposure_s) for reference in references)
    expected = (one + other) / 2
    noise_e2 = np.stack([noise_variance(plane, sensor, exposure_s) for plane in expected])
    return Yardstick(sensor, exposure_s, (one, other), noise_e2, (expected < sensor.pixel.full_well_e) & ~lamps)


def share_map(image_e: Image, yard: Yardstick) -> Image:
    """Squared error over the sensor's noise variance, (channel, h, w): pooled over 3x3 pixels, NaN outside."""
    one, other = yard.references
    return pooled_share((image_e - one) * (image_e - other), yard)


def pooled_share(squared_e2: Image, yard: Yardstick) -> Image:
    """Pool each pixel's own share, over the pixels inside alone: no bright error counts against a dark pixel."""
    weight = pooled(yard.inside.astype(np.float64))
    total = pooled(np.where(yard.inside, squared_e2 / yard.noise_e2, 0.0))
    return np.where(yard.inside, total / np.maximum(weight, 1 / 9), np.nan)


def mean_error(image_e: Image, yard: Yardstick) -> tuple[float, float]:
    """Return the RMS error [e-] and the mean share, over pixels and channels; 0 where noise leaves less than that."""
    one, other = yard.references
    squared_e2 = float(((image_e - one) * (image_e - other))[yard.inside].mean())
    share = float(np.nanmean(share_map(image_e, yard)))
    return float(np.sqrt(max(squared_e2, 0.0))), max(share, 0.0)
