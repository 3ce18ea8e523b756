"""The error budget: what an approximation costs, in electrons, beside the sensor's own noise."""

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter

from render.radiance import SpectralRadiance
from render.transport import Transport
from sensor.config import SensorConfig
from sensor.exposure import auto_exposure_s
from sensor.optics import camera_equation, form_image
from sensor.readout import noise_variance
from sensor.response import channel_electrons, electrons_per_irradiance, expected_electrons

# What Monte Carlo noise may add to the sensor's own noise variance before it counts as part of the result, and for how
# many of the pixels it has to hold: a few look at a lamp's rim or a caustic.
MOST_SHARE = 0.03
OF_PIXELS = 0.95


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


def pixel_share(transport: Transport, sensor: SensorConfig, luminance_cd_m2: float, longest_s: float) -> float:
    """Monte Carlo variance over the sensor's own, in electrons, that `OF_PIXELS` of the pixels stay under.

    At a mean luminance and the exposure that is chosen for it, over every channel's pixels below saturation. Bands of a
    path rise and fall together, so their standard errors are added; that is the most that the variance can be. It is
    pooled over 3x3 pixels.
    """
    radiance = transport.relight(luminance_cd_m2=luminance_cd_m2)
    irradiance = form_image(radiance, sensor)
    exposure_s = auto_exposure_s(irradiance, sensor, longest_s)
    expected_e = np.moveaxis(channel_electrons(irradiance, sensor, exposure_s), -1, 0)
    variance = uniform_filter(transport.relight_variance(luminance_cd_m2=luminance_cd_m2), size=(1, 3, 3))
    weights = electrons_per_irradiance(sensor, transport.wavelength_nm, transport.width_nm, exposure_s)
    weights = weights * camera_equation(sensor.lens)
    error_e = np.tensordot(weights, np.sqrt(np.maximum(variance, 0.0)), axes=1)
    inside = expected_e < sensor.pixel.full_well_e
    if not inside.any():
        return 0.0
    own = np.stack([noise_variance(plane, sensor, exposure_s) for plane in expected_e])
    return float(np.quantile(error_e[inside] ** 2 / own[inside], OF_PIXELS))
