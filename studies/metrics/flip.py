"""LDR-FLIP: the difference that an eye sees where two pictures alternate, from 0 to 1 per pixel.

Source: Andersson, Nilsson, Akenine-Moller, Oskarsson, Astrom & Fairchild, "FLIP: A difference evaluator for alternating
images", Proc. ACM Comput. Graph. Interact. Tech. 3(2), 2020; numbers of sections and equations are the paper's. Each of
its filters is a product of a filter along rows and one along columns, or a sum of two such products, so it is applied
along one axis after the other. What depends on one picture alone is computed once, because a study compares many
pictures with one.
"""

from dataclasses import dataclass
from math import ceil, pi

import numpy as np
import scipy
from numpy.typing import NDArray

from rodcone.colour_spaces import decode_srgb
from rodcone.types import Floats, Image
from studies.metrics.s_cielab import PIXELS_PER_DEGREE

# Section 4.1.1, Table 1: weights a and widths b [degree^2] of the Gaussians a sqrt(pi / b) exp(-pi^2 r^2 / b) which
# blur each plane of YCxCz as the eye's contrast sensitivity does.
CONTRAST = (((1.0, 0.0047),), ((1.0, 0.0053),), ((34.1, 0.04), (13.5, 0.025)))
WIDEST = 0.04  # the largest b; all filters reach to three standard deviations of the Gaussian with this b
Q_COLOUR, P_COLOUR, P_KNEE = 0.7, 0.4, 0.95  # section 4.1.3: q_c, p_c, p_t
FEATURE_DEG = 0.082  # section 4.2.1: width w of the features' filters; their standard deviation is w / 2
Q_FEATURE = 0.5  # equation 13: q_f
# Matrix from linear sRGB to XYZ under D65, as in the authors' program; the sums of its rows are the white.
TO_XYZ = np.array(
    [
        [10135552 / 24577794, 8788810 / 24577794, 4435075 / 24577794],
        [2613072 / 12288897, 8788810 / 12288897, 887015 / 12288897],
        [1425312 / 73733382, 8788810 / 73733382, 70074185 / 73733382],
    ]
)
WHITE = TO_XYZ.sum(axis=1)
_SLOPE = 6 / 29  # below the cube of this value CIELAB's cube root is replaced by a line


@dataclass(frozen=True)
class Seen:
    """Picture in the form in which FLIP compares it.

    Attributes
    ----------
    colour : (3, h, w) float64
        CIELAB of the blurred picture after the Hunt effect.
    edges, points : (h, w) float64
        Strength of edges, and of points and lines.
    pixels_per_degree : float
    """

    colour: Image
    edges: Image
    points: Image
    pixels_per_degree: float


def seen(encoded: NDArray[np.floating], pixels_per_degree: float = PIXELS_PER_DEGREE) -> Seen:
    """Return the quantities of one picture that FLIP compares, from encoded sRGB (h, w, 3) in [0, 1]."""
    return seen_light(decode_srgb(np.asarray(encoded, dtype=np.float64)), pixels_per_degree)


def seen_light(linear: Image, pixels_per_degree: float = PIXELS_PER_DEGREE) -> Seen:
    """Return the quantities of one picture that FLIP compares, from linear sRGB of a display (h, w, 3) in [0, 1]."""
    planes = np.ascontiguousarray(np.moveaxis(linear, -1, 0))
    x, luminance, z = np.einsum("ij,j...->i...", TO_XYZ / WHITE[:, None], planes)
    # Planes of YCxCz: 116 Y - 16, 500 (X - Y), 200 (Y - Z). Blur keeps sums and constants, so it acts on X, Y, Z here.
    y, x_less_y, y_less_z = (
        _blurred(plane, gaussians, pixels_per_degree)
        for plane, gaussians in zip((luminance, x - luminance, luminance - z), CONTRAST, strict=True)
    )
    blurred = np.stack([y + x_less_y, y, y - y_less_z])
    shown = np.clip(np.einsum("ij,j...->i...", np.linalg.inv(TO_XYZ / WHITE[:, None]), blurred), 0.0, 1.0)
    return Seen(_hunt_lab(shown), *_features(luminance, pixels_per_degree), pixels_per_degree)


def flip(
    picture: "NDArray[np.floating] | Seen",
    truth: "NDArray[np.floating] | Seen",
    pixels_per_degree: float = PIXELS_PER_DEGREE,
) -> Image:
    """Return LDR-FLIP of each pixel, shape (h, w), from 0 (no difference) to 1; its mean is a picture's usual figure.

    Parameters
    ----------
    picture, truth : (h, w, 3) array or Seen
        Encoded sRGB in [0, 1], or the result of `seen`. A `picture` that is an array is compared at the pixels per
        degree of a `truth` from `seen`.
    pixels_per_degree : float
        Pixels per degree of the eye's view; the default is FLIP's own. It counts for arrays.
    """
    second = truth if isinstance(truth, Seen) else seen(truth, pixels_per_degree)
    first = picture if isinstance(picture, Seen) else seen(picture, second.pixels_per_degree)
    colour = _redistributed(_hyab(first.colour, second.colour))  # equation 11: Delta E_c
    feature = np.maximum(np.abs(first.edges - second.edges), np.abs(first.points - second.points))
    feature = (feature / np.sqrt(2)) ** Q_FEATURE  # equation 13: Delta E_f
    return np.asarray(colour ** (1 - feature))  # equation 14


def _blurred(plane: Image, gaussians: tuple[tuple[float, float], ...], pixels_per_degree: float) -> Image:
    """Blur a plane by a sum of Gaussians whose weights sum to 1; pixels at the border are repeated beyond it."""
    reach = ceil(3 * np.sqrt(WIDEST / (2 * pi**2)) * pixels_per_degree)
    degrees = np.arange(-reach, reach + 1) / pixels_per_degree
    lines = [np.exp(-(pi**2) * degrees**2 / b) for _, b in gaussians]
    weights = np.array([a * np.sqrt(pi / b) * line.sum() ** 2 for (a, b), line in zip(gaussians, lines, strict=True)])
    result = np.zeros_like(plane)
    for weight, line in zip(weights / weights.sum(), lines, strict=True):
        taps = line / line.sum()
        result += weight * _along(_along(plane, taps, 0), taps, 1)
    return result


def _features(luminance: Image, pixels_per_degree: float) -> tuple[Image, Image]:
    """Return the strengths of edges and points: the lengths of the vectors of first and second derivatives (4.2.1).

    The positive taps of each derivative's filter sum to 1, and the negative ones to -1.
    """
    sigma = 0.5 * FEATURE_DEG * pixels_per_degree
    at = np.arange(-ceil(3 * sigma), ceil(3 * sigma) + 1)
    gaussian = np.exp(-(at**2) / (2 * sigma**2))
    across = gaussian / gaussian.sum()
    blurred_down = _along(luminance, across, 0)
    found = []
    for derivative in (-at * gaussian, (at**2 / sigma**2 - 1) * gaussian):
        positive = np.maximum(derivative, 0.0)
        negative = np.minimum(derivative, 0.0)
        taps = positive / positive.sum() - negative / negative.sum()
        found.append(np.hypot(_along(blurred_down, taps, 1), _along(_along(luminance, taps, 0), across, 1)))
    return found[0], found[1]


def _along(plane: Image, taps: Floats, axis: int) -> Image:
    """Filter a plane along one axis; pixels at the border are repeated beyond it."""
    return np.asarray(scipy.ndimage.correlate1d(plane, taps, axis=axis, mode="nearest"))


def _hunt_lab(linear: Image) -> Image:
    """Return CIELAB of planes of linear sRGB whose chroma grows with the lightness, as Hunt found (equation 7)."""
    ratio = np.einsum("ij,j...->i...", TO_XYZ / WHITE[:, None], linear)
    root = np.cbrt(ratio)
    dark = ratio <= _SLOPE**3
    root[dark] = ratio[dark] / (3 * _SLOPE**2) + 4 / 29
    x, y, z = root
    lightness = 116 * y - 16
    return np.stack([lightness, 5 * lightness * (x - y), 2 * lightness * (y - z)])


def _hyab(first: Image, second: Image) -> Image:
    """Return the HyAB distance of colours: |dL| plus the Euclidean distance in a and b (equation 8)."""
    lightness, a, b = first - second
    return np.asarray(np.abs(lightness) + np.hypot(a, b))


def _redistributed(distance: Image) -> Image:
    """Map colour distances to [0, 1]: steeply up to p_c of the largest, then along a flatter line (4.1.3)."""
    green, blue = (_hunt_lab(np.array(colour)) for colour in ([0.0, 1.0, 0.0], [0.0, 0.0, 1.0]))
    largest = float(_hyab(green, blue)) ** Q_COLOUR
    knee = P_COLOUR * largest
    power = distance**Q_COLOUR
    steep = P_KNEE / knee * power
    flat = P_KNEE + (power - knee) / (largest - knee) * (1 - P_KNEE)
    return np.asarray(np.where(power < knee, steep, flat))
