"""SSIM of Wang, Bovik, Sheikh & Simoncelli 2004; what depends on one picture alone is kept between comparisons.

Numbers of equations are those of the paper. Each local mean weighs an 11 x 11 window by a Gaussian of 1.5 pixels.
"""

from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from rodcone.types import Image

SIGMA_PX, REACH_PX = 1.5, 5  # standard deviation of the window, and its pixels on each side of the middle
C1, C2 = 0.01**2, 0.03**2  # equations 7 and 9, for values in [0, 1]


@dataclass(frozen=True)
class LocalMoments:
    """Moments of one picture by which SSIM compares it.

    Attributes
    ----------
    planes : (3, h, w) float64
        The picture's own values.
    mean, variance : (3, h, w) float64
        Local mean and variance, equations 14 and 15.
    """

    planes: Image
    mean: Image
    variance: Image


def local_moments(picture: NDArray[np.floating]) -> LocalMoments:
    """Return the moments of one picture (h, w, 3), with values in [0, 1], that SSIM compares."""
    planes = np.ascontiguousarray(np.moveaxis(np.asarray(picture, dtype=np.float64), -1, 0))
    mean = _local_mean(planes)
    return LocalMoments(planes, mean, _local_mean(planes * planes) - mean * mean)


def ssim(picture: NDArray[np.floating], truth: LocalMoments) -> float:
    """Return the mean SSIM over channels and those pixels whose window lies within the picture.

    If a picture is too small for such pixels, those nearest to its middle count.
    """
    one = local_moments(picture)
    shared = _local_mean(one.planes * truth.planes) - one.mean * truth.mean  # equation 16
    light = (2 * one.mean * truth.mean + C1) / (one.mean**2 + truth.mean**2 + C1)
    similar = light * (2 * shared + C2) / (one.variance + truth.variance + C2)  # equation 13
    border = min(REACH_PX, (min(picture.shape[:2]) - 1) // 2)
    height, width = picture.shape[:2]
    return float(similar[:, border : height - border, border : width - border].mean())


def _local_mean(planes: Image) -> Image:
    """Return each pixel's mean under the window, the picture mirrored at its borders."""
    return np.asarray(scipy.ndimage.gaussian_filter(planes, (0, SIGMA_PX, SIGMA_PX), truncate=REACH_PX / SIGMA_PX))
