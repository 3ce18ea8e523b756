"""S-CIELAB: colour difference as seen from a distance, from which the eye blurs fine noise, and colour more than light.

Source: Zhang & Wandell, "A spatial extension of CIELAB for digital color image reproduction", J. SID 5(1), 1997: XYZ to
three opponent planes, each blurred by the eye's own spread, back to XYZ, then CIELAB's difference (CIE 1976).
"""

import numpy as np
import scipy
import skimage
from numpy.typing import NDArray

from rodcone.colour_spaces import decode_srgb
from rodcone.types import Floats, Image

# Pixels per degree of a display 3840 pixels and 0.7 m wide, seen from 0.7 m, as by FLIP's default.
PIXELS_PER_DEGREE = 3840 * np.pi / 180

# Matrix from XYZ to light-dark, red-green and blue-yellow, with the digits of the authors' program. In reprints of the
# formulas the 0.077 of the second row has a minus. The plus is right: it follows from the matrix of the cones
# (Hunt-Pointer-Estevez) and the weights of the opponent planes.
XYZ_TO_OPPONENT = np.array(
    [[0.2787336, 0.7218031, -0.1065520], [-0.4487736, 0.2898056, 0.0771569], [0.0859513, -0.5899859, 0.5011089]]
)
# The paper's table: weight and spread s [degree] of each Gaussian exp(-r^2 / s^2), each scaled to sum 1. Weights are
# scaled to sum 1 too, so that a uniform field stays as it is.
SPREADS = (
    ((0.921, 0.0283), (0.105, 0.133), (-0.108, 4.336)),
    ((0.531, 0.0392), (0.330, 0.494)),
    ((0.488, 0.0536), (0.371, 0.386)),
)


def eye_transfer(plane: int, cycles_per_degree: Floats) -> Floats:
    """Return the eye's contrast transfer at each frequency in opponent plane 0, 1 or 2; it is 1 at frequency 0."""
    return np.asarray(_gaussians(plane, cycles_per_degree) @ _weights(plane))


def eye_xyz(xyz: NDArray[np.float64], pixels_per_degree: float = PIXELS_PER_DEGREE) -> NDArray[np.float64]:
    """Return XYZ (h, w, 3) after the eye's blur, with the picture mirrored at its borders.

    The blur is a product in the space of the cosine transform, which mirrors a picture. So it is exact for any spread,
    even that of 4.3 degrees, and takes O(n log n). Each Gaussian is a product of a factor for the row frequency and one
    for the column frequency.
    """
    spectrum = scipy.fft.dctn(xyz @ XYZ_TO_OPPONENT.T, axes=(0, 1))
    down, across = (np.arange(n) / (2 * n) * pixels_per_degree for n in xyz.shape[:2])
    for plane in range(3):
        spectrum[..., plane] *= (_gaussians(plane, down) * _weights(plane)) @ _gaussians(plane, across).T
    return np.asarray(scipy.fft.idctn(spectrum, axes=(0, 1)) @ np.linalg.inv(XYZ_TO_OPPONENT).T)


def _gaussians(plane: int, cycles_per_degree: Floats) -> Floats:
    """Return by how much each Gaussian of an opponent plane reduces contrast, (frequency, Gaussian)."""
    spreads_deg = np.array(SPREADS[plane])[:, 1]
    return np.exp(-((np.pi * spreads_deg * np.asarray(cycles_per_degree)[..., None]) ** 2))


def _weights(plane: int) -> Floats:
    """Return the weights of an opponent plane's Gaussians; their sum is 1."""
    weights = np.array(SPREADS[plane])[:, 0]
    return np.asarray(weights / weights.sum())


def eye_lab(encoded: NDArray[np.float64], pixels_per_degree: float = PIXELS_PER_DEGREE) -> NDArray[np.float64]:
    """Return CIELAB of encoded sRGB (h, w, 3) after the eye's blur."""
    return eye_lab_of_light(decode_srgb(encoded), pixels_per_degree)


def eye_lab_of_light(linear: Image, pixels_per_degree: float = PIXELS_PER_DEGREE) -> Image:
    """Return CIELAB of a display's light, linear sRGB (h, w, 3) in [0, 1], after the eye's blur."""
    return np.asarray(
        skimage.color.xyz2lab(eye_xyz(linear @ skimage.color.colorconv.xyz_from_rgb.T, pixels_per_degree))
    )


def s_cielab(
    picture: NDArray[np.float64], truth: NDArray[np.float64], pixels_per_degree: float = PIXELS_PER_DEGREE
) -> NDArray[np.float64]:
    """Return the S-CIELAB difference of each pixel, shape (h, w); a difference of about 1 can just be seen.

    Parameters
    ----------
    picture, truth : (h, w, 3) float64
        Encoded sRGB in [0, 1]; D65 is the white.
    pixels_per_degree : float
        Pixels per degree of the eye's view. With fewer the picture is nearer, and finer detail is seen.
    """
    return np.asarray(
        skimage.color.deltaE_cie76(eye_lab(picture, pixels_per_degree), eye_lab(truth, pixels_per_degree))
    )
