"""The sensor's own noise, as a number: what errors of the simulation are weighed against."""

import numpy as np
from numpy.typing import NDArray

from sensor.config import SensorConfig


def noise_variance(expected_e: NDArray[np.float64], sensor: SensorConfig, exposure_s: float) -> NDArray[np.float64]:
    """Variance of one pixel of one chip drawn at random [e-^2], shape of `expected_e`; clipping left out.

    Shot noise of signal and dark current, PRNU on the signal, DSNU, read noise and quantisation (gain^2 / 12).
    """
    pixel = sensor.pixel
    shot = expected_e + pixel.dark_current_e_per_s * exposure_s
    dark = pixel.read_noise_e**2 + pixel.dsnu_e**2 + sensor.gain_e_per_dn**2 / 12
    return np.asarray(shot + (pixel.prnu * expected_e) ** 2 + dark)
