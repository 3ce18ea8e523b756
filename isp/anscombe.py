"""Back from units of noise to electrons without bias: the exact inverse of the generalised Anscombe transform."""

import numpy as np
from numpy.typing import NDArray

_LEAST = 2.0 * np.sqrt(0.375)  # what stands for 0 electrons: the Anscombe transform of 0


def unstabilise(stable: NDArray[np.floating], dark_noise_e: float) -> NDArray[np.float64]:
    """Electrons whose noisy samples have this mean after the generalised Anscombe transform.

    The mean of a root is not the root of a mean: the algebraic inverse would be 1/4 e- too low. The closed form of the
    exact unbiased inverse (Makitalo & Foi 2011), shifted by the dark noise's variance (Makitalo & Foi, "Optimal
    inversion of the generalized Anscombe transformation for Poisson-Gaussian noise", IEEE TIP 22(1), 2013).

    Parameters
    ----------
    stable : array
        Denoised values [standard deviations of noise].
    dark_noise_e : float
        The standard deviation that `isp.planes.stabilise` took, with no PRNU [e-].

    Returns
    -------
    array of float64
        Electrons; not under ``-dark_noise_e**2``, where the transform ends.
    """
    root = np.maximum(np.asarray(stable, dtype=np.float64), _LEAST)
    series = root**2 / 4 - 0.125 + np.sqrt(1.5) / 4 / root - 1.375 / root**2 + 0.625 * np.sqrt(1.5) / root**3
    return np.asarray(series - dark_noise_e**2)
