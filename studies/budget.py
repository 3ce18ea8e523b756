"""The error budget: what an approximation costs, in electrons, beside the sensor's own noise."""

import numpy as np
from numpy.typing import NDArray

from render.radiance import SpectralRadiance
from sensor.config import SensorConfig
from sensor.noise import noise_variance
from sensor.optics import form_image
from sensor.response import expected_electrons


def monte_carlo_share(
    expected_e: NDArray[np.float64],
    halves: tuple[SpectralRadiance, SpectralRadiance],
    sensor: SensorConfig,
    exposure_s: float,
) -> float:
    """Monte Carlo variance of the mosaic's electrons over the sensor's own noise variance, means over pixels.

    Parameters
    ----------
    expected_e : (h, w) float64
        Of the whole render.
    halves : pair of SpectralRadiance
        Its even and odd passes (`Transport.relight_halves`). Pixels in which the well is reached are left out.
    """
    even, odd = (expected_electrons(form_image(half, sensor), sensor, exposure_s) for half in halves)
    inside = expected_e < sensor.pixel.full_well_e
    if not inside.any():
        return 0.0
    monte_carlo = ((even - odd) ** 2 / 4)[inside].mean()
    return float(monte_carlo / noise_variance(expected_e, sensor, exposure_s)[inside].mean())
