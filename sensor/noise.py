"""The sensor's own noise, as a number: what errors of the simulation are weighed against."""

import numpy as np
from numpy.typing import NDArray

from sensor.config import SensorConfig
from sensor.crosstalk import spread_charge


def noise_variance(expected_e: NDArray[np.float64], sensor: SensorConfig, exposure_s: float) -> NDArray[np.float64]:
    """Variance of one pixel of one chip drawn at random [e-^2], shape of `expected_e`; clipping left out.

    Shot noise of signal and dark current, PRNU on the signal, hot pixels, column gains on all that was collected, DSNU
    and column offsets, read noise and quantisation (gain^2 / 12).

    Parameters
    ----------
    expected_e : (h, w) float64
        Expected photo-electrons as `read_out` takes them: before crosstalk.
    sensor : SensorConfig
    exposure_s : float
        For the dark current [s].
    """
    pixel = sensor.pixel
    signal = spread_charge(np.asarray(expected_e, dtype=np.float64), pixel.crosstalk)
    hot_e, hot_share = pixel.hot_pixel_dark_current_e_per_s * exposure_s, pixel.hot_pixel_share
    collected = signal + pixel.dark_current_e_per_s * exposure_s + hot_share * hot_e
    variance = collected + (pixel.prnu * signal) ** 2 + hot_share * (1 - hot_share) * hot_e**2
    # a product of independent factors: E[gain^2] E[collected^2] - E[collected]^2
    variance = variance + pixel.column_gain_spread**2 * (variance + collected**2)
    dark = pixel.read_noise_e**2 + pixel.fixed_dark_e**2 + sensor.gain_e_per_dn**2 / 12
    return np.asarray(variance + dark)
