"""Count blemishes that an eye sees first in a developed picture, and that a mean over all pixels hides.

A spot is a pixel of a hue that nothing around it has. A hole is a dark pixel in a light. A dot is a pixel that stands
out of an even surface.
"""

from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray
from scipy.ndimage import median_filter
from skimage.color import deltaE_ciede2000, rgb2lab

from rodcone.colour_spaces import decode_srgb, luminance_of_srgb
from studies.metrics.appearance import require_finite

SPOT = 20.0  # CIEDE2000 of a spot to the truth of every neighbour, so large that its colour has another name
LIGHT, HOLE = 0.5, 0.2  # a light has half of white's brightness or more, a hole in it a fifth of white's or less
EVEN, DOT = 1.0, 5.0  # CIEDE2000 up to which the truth of an even surface varies, and from which on a dot differs


@dataclass(frozen=True)
class Blemishes:
    """Numbers of pixels with each blemish, and of those on even surfaces, among which dots are sought.

    Attributes
    ----------
    spots : int
        Pixels of a hue that the truth has neither there nor in a neighbouring pixel.
    holes : int
        Dark pixels where the truth is a light.
    dots : int
        Pixels that stand out of an even surface.
    even : int
        Pixels on even surfaces.
    """

    spots: int
    holes: int
    dots: int
    even: int


def count_blemishes(picture: NDArray[np.float64], truth: NDArray[np.float64]) -> Blemishes:
    """Count the blemishes of an encoded sRGB picture (h, w, 3) in [0, 1] beside the truth.

    A pixel is compared with the truth at the truth's lightness, so that noise of lightness alone makes no spot. A spot
    must also differ from the median of the picture's 5 x 5 pixels around it, so that a wrong cast over an area makes no
    spots. A pixel is on an even surface if the truth in the 5 x 5 pixels around it is within one CIEDE2000 of its own;
    a dot differs by five from the picture's median there.

    Raises
    ------
    InputError
        For a value that is NaN or infinite.
    """
    require_finite(picture=picture, truth=truth)
    shown, true = rgb2lab(picture), rgb2lab(truth)
    median = median_filter(shown, (5, 5, 1), mode="mirror")
    spot = _difference_of_hue(shown, median) > SPOT / 2.0
    for neighbour in _around(true, 1):
        spot &= _difference_of_hue(shown, neighbour) > SPOT
    light, shown_light = (luminance_of_srgb(decode_srgb(values)) for values in (truth, picture))
    hole = (light >= LIGHT) & (shown_light < HOLE * light)
    even = np.all([deltaE_ciede2000(true, neighbour) < EVEN for neighbour in _around(true, 2)], axis=0)
    dot = even & (deltaE_ciede2000(shown, median) > DOT)
    return Blemishes(*(int(pixels.sum()) for pixels in (spot, hole, dot, even)))


def _around(values: NDArray[np.float64], reach: int) -> list[NDArray[np.float64]]:
    """Return a picture for each shift by up to `reach` pixels, no shift included; it is mirrored at the border."""
    padded = np.pad(values, ((reach, reach), (reach, reach), (0, 0)), mode="reflect")
    windows = sliding_window_view(padded, (2 * reach + 1,) * 2, axis=(0, 1))
    return [windows[..., i, j] for i, j in np.ndindex(windows.shape[3:])]


def _difference_of_hue(lab: NDArray[np.float64], other: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return CIEDE2000 between two colours, both at the lightness of `other`."""
    return np.asarray(deltaE_ciede2000(np.concatenate([other[..., :1], lab[..., 1:]], axis=-1), other))
