"""Monte Carlo noise of a render beside the sensor's own noise, in electrons."""

import numpy as np
from numpy.typing import NDArray

from render.denoised.relight import measured_error
from render.transport import Transport
from sensor.config import SensorConfig
from sensor.exposure import auto_exposure_s
from sensor.optics import camera_equation, form_image
from sensor.readout import noise_variance
from sensor.response import channel_electrons, electrons_per_irradiance

# What Monte Carlo noise may add to the sensor's own noise variance before it counts as part of the result, and for how
# many of the pixels it has to hold: a few look at a lamp's rim or a caustic.
MOST_SHARE = 0.03
OF_PIXELS = 0.95


def monte_carlo_share(
    error_e: NDArray[np.floating],
    expected_e: NDArray[np.float64],
    sensor: SensorConfig,
    exposure_s: float,
    *,
    of_pixels: float | None = None,
) -> float:
    """Monte Carlo variance of a frame's electrons over the sensor's own noise variance; 0 where the well is full.

    Parameters
    ----------
    error_e : (..., h, w) array
        Monte Carlo error [e-]: one draw of it, such as half the difference of its halves, or its standard
        deviation.
    expected_e : (..., h, w) float64
        Of the whole render [e-]. Pixels that reach the well are left out.
    sensor : SensorConfig
    exposure_s : float
        For the dark current [s].
    of_pixels : float, optional
        The share that so many of the pixels (0 to 1) stay under; left out, mean variance over mean variance.
    """
    inside = expected_e < sensor.pixel.full_well_e
    if not inside.any():
        return 0.0
    monte_carlo = error_e[inside] ** 2
    planes = expected_e.reshape(-1, *expected_e.shape[-2:])  # the noise of crosstalk needs neighbours of one plane
    own = np.stack([noise_variance(plane, sensor, exposure_s) for plane in planes]).reshape(expected_e.shape)[inside]
    if of_pixels is None:
        return float(monte_carlo.mean() / own.mean())
    return float(np.quantile(monte_carlo / own, of_pixels))


def charged_share(
    errors_e: NDArray[np.floating], expected_e: NDArray[np.float64], sensor: SensorConfig, exposure_s: float
) -> float:
    """Monte Carlo variance that a frame is charged, over the sensor's own noise variance; 0 where the well is full.

    Parameters
    ----------
    errors_e : (1 or 2, h, w) array
        One draw of the unbiased light's error [e-]; or what denoised light differs by from two folds: the mean of their
        product is its whole squared error, and its upper limit is charged (`render.denoised.relight`).
    expected_e : (h, w) float64
    sensor, exposure_s
        As of `monte_carlo_share`.
    """
    if len(errors_e) == 1:
        return monte_carlo_share(errors_e[0], expected_e, sensor, exposure_s)
    inside = expected_e < sensor.pixel.full_well_e
    if not inside.any():
        return 0.0
    own = noise_variance(expected_e, sensor, exposure_s)[inside].sum() / inside.size
    return measured_error(errors_e[0], errors_e[1], inside / own).upper


def render_share(
    transport: Transport,
    sensor: SensorConfig,
    luminance_cd_m2: float,
    longest_s: float,
    exposure_s: float | None = None,
) -> float:
    """Monte Carlo share that `OF_PIXELS` of the pixels stay under at a mean luminance, over every channel.

    Bands of a path rise and fall together, so their standard errors are added; that is the most that the variance can
    be. It is pooled over 3x3 pixels.

    Parameters
    ----------
    transport : Transport
    sensor : SensorConfig
    luminance_cd_m2 : float
    longest_s : float
        Of the auto exposure [s].
    exposure_s : float, optional
        Left out, the auto exposure.
    """
    irradiance = form_image(transport.relight(luminance_cd_m2=luminance_cd_m2), sensor)
    time_s = auto_exposure_s(irradiance, sensor, longest_s) if exposure_s is None else exposure_s
    expected_e = np.moveaxis(channel_electrons(irradiance, sensor, time_s), -1, 0)
    variance = transport.relight_variance(luminance_cd_m2=luminance_cd_m2)
    weights = electrons_per_irradiance(sensor, transport.wavelength_nm, transport.width_nm, time_s)
    weights = weights * camera_equation(sensor.lens)
    error_e = np.tensordot(weights, np.sqrt(np.maximum(variance, 0.0)), axes=1)
    return monte_carlo_share(error_e, expected_e, sensor, time_s, of_pixels=OF_PIXELS)
