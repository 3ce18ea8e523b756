"""Colours by the light around a pixel: where it is brighter than the frame's mean, noise takes less of its colour.

The matrix of least expected error (`isp.colour.colour_fit`) makes colours paler, the more noise there is beside the
light. One matrix for a frame knows the noise at the frame's mean alone, so that in moonlight it also pales what is
bright enough to show its colour. Here the matrix of a pixel is that of its own light,

    M(x) = M(noise at s(x)),    s(x) = (G_sigma * f)(x) / mean of f, at least 1,

with the channel f that has the least noise. Light under the mean counts as the mean, because what is dark is as often
a dark surface, whose colours would turn grey, as shade (docs/decisions/0071-colours-by-their-light.md).
"""

import numpy as np
import scipy
from numpy.typing import NDArray

from isp.strips import strips
from rodcone.types import Floats
from sensor.raw import RawImage

LIGHTS = 2.0 ** np.arange(0.0, 2.5, 0.5)  # over the frame's mean, with a matrix each; interpolated in log between them
SIGMA = 2.0  # of the Gaussian, in pixels: the matrix doesn't follow the noise from pixel to pixel
_STRIP_ROWS = 64


def light_around(raw: RawImage, plane: NDArray[np.floating]) -> Floats:
    """Compute a plane's Gaussian mean around each pixel over its mean where nothing is saturated, from 1 on."""
    mean = float(plane[~raw.saturated].mean()) if not raw.saturated.all() else float(plane.mean())
    if mean <= 0.0:
        return np.ones(plane.shape)
    return np.asarray(np.maximum(scipy.ndimage.gaussian_filter(np.asarray(plane, dtype=np.float64), SIGMA) / mean, 1.0))


def apply_by_light(balanced: NDArray[np.floating], light: Floats, matrices: Floats) -> Floats:
    """Multiply each pixel (h, w, channel) by the matrix of its light (h, w) among `matrices` (light, 3, channel).

    There is one matrix for each of `LIGHTS`. Between two of them it is interpolated by the logarithm of light; beyond
    the last, it is the last.
    """
    step = np.log2(LIGHTS[1])
    rgb = np.asarray(balanced @ matrices[0].T, dtype=np.float64)
    for rows in strips(len(rgb), _STRIP_ROWS):
        brighter = light[rows] > 1.0
        position = np.minimum(np.log2(light[rows][brighter]) / step, len(LIGHTS) - 1)
        lower = np.minimum(position.astype(int), len(LIGHTS) - 2)
        share = (position - lower)[:, None, None]
        of_pixels = matrices[lower] + share * (matrices[lower + 1] - matrices[lower])
        rgb[rows][brighter] = np.einsum("nij,nj->ni", of_pixels, balanced[rows][brighter])
    return rgb
