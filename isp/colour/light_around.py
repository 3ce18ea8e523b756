"""Colour matrices by the light around each pixel: what is brighter than the frame's mean keeps more of its colour.

The matrix of least expected error (`isp.colour.colour_fit`) makes colours paler, the more noise there is beside the
light. One matrix for a frame knows the noise at the frame's mean alone, so that in moonlight it also pales what is
bright enough to show its colour. Here a pixel's matrix lies between the one for the frame's mean and the one for
`BRIGHTEST` times as much light. Its share follows 1/s, because the relative variance of shot noise does:

    M(x) = M_1 + a (M_4 - M_1),    a = (1 - 1 / s(x)) / (1 - 1 / 4),    s(x) = (G_sigma * f)(x) / mean of f, from 1 to 4

with the channel f that has the least noise. Light under the mean counts as the mean, because what is dark is as often
a dark surface, whose colours would turn grey, as shade (docs/decisions/0071-colours-by-their-light.md).
"""

import numpy as np
import scipy
from numpy.typing import NDArray

from rodcone.types import Floats
from sensor.raw import RawImage

BRIGHTEST = 4.0  # over the frame's mean; a limit of 16 gains no more
LIGHTS = (1.0, BRIGHTEST)  # over the frame's mean, for which matrices are computed
SIGMA = 2.0  # of the Gaussian, in pixels: the matrix doesn't follow the noise from pixel to pixel


def light_around(raw: RawImage, plane: NDArray[np.floating]) -> Floats:
    """Compute s: a plane's Gaussian mean around each pixel, over its mean where nothing is saturated, within `LIGHTS`.

    If everything is saturated, the mean of all pixels counts; without any signal, s is 1.
    """
    mean = float(plane[~raw.saturated].mean()) if not raw.saturated.all() else float(plane.mean())
    if mean <= 0.0:
        return np.ones(plane.shape)
    around = scipy.ndimage.gaussian_filter(np.asarray(plane, dtype=np.float64), SIGMA)
    return np.asarray(np.clip(around / mean, *LIGHTS))


def apply_by_light(balanced: NDArray[np.floating], light: Floats, matrices: Floats) -> Floats:
    """Multiply each pixel (h, w, channel) by the matrix of its light (h, w); `matrices` are those for `LIGHTS`."""
    share = (1.0 - 1.0 / light) / (1.0 - 1.0 / BRIGHTEST)
    of_mean, of_brightest = matrices
    return np.asarray(balanced @ of_mean.T + share[..., None] * (balanced @ (of_brightest - of_mean).T))
