"""Charge that diffuses into the neighbours before it is collected."""

import numpy as np
from numpy.typing import NDArray


def spread_charge(expected_e: NDArray[np.float64], crosstalk: float) -> NDArray[np.float64]:
    """Expected photo-electrons after each pixel gave `crosstalk` of its own to each of its four neighbours.

    It belongs before the Poisson draw: electrons that go separate ways are thinned, and thinned Poisson counts are
    Poisson and independent again. At the frame's edge the charge stays, so the total is kept. Charge beyond a full
    well is lost, not handed on: blooming isn't modelled.

    Parameters
    ----------
    expected_e : (h, w) float64
    crosstalk : float
        0 to 0.25; 0 returns the frame as it is.

    Returns
    -------
    (h, w) float64
    """
    if crosstalk == 0:
        return expected_e
    around = np.pad(expected_e, 1, mode="edge")
    neighbours = around[:-2, 1:-1] + around[2:, 1:-1] + around[1:-1, :-2] + around[1:-1, 2:]
    return np.asarray((1 - 4 * crosstalk) * expected_e + crosstalk * neighbours)
