"""Residual interpolation of Bayer mosaics with minimized Laplacians (MLRI).

D. Kiku, Y. Monno, M. Tanaka, M. Okutomi, "Beyond color difference: residual interpolation for color image
demosaicking", IEEE Trans. Image Process. 25(3), 2016; first in ICIP 2013. A guided filter predicts one colour from
another, and the residual at that colour's samples is interpolated. Green comes first: its differences from the other
colour along rows and columns are averaged over four sides, weighted by their gradients as in I. Pekkucuksen,
Y. Altunbasak, "Gradient based threshold free color filter array interpolation", ICIP 2010. Windows are averaged,
weighted by how well they fit, as in Y. Monno, D. Kiku, M. Tanaka, M. Okutomi, "Adaptive residual interpolation for
color and multispectral image demosaicking", Sensors 17(12), 2017.

This follows the papers, not their authors' program. Reflection about the outermost pixels is this project's.
"""

import numpy as np
import scipy
from numpy.typing import NDArray

from isp.planes import fill_channels
from isp.processors.demosaic import require_bayer
from rodcone.types import Image, Mosaic, Plane
from sensor.cfa import Tile, mask

REACH = 28  # distance [pixels] at which the mosaic may still change a value: 15 for green, and 13 more for R and B
_GREEN_WINDOW, _COLOUR_WINDOW = 7, 11  # pixels along a side of the guided filters' windows
_SECOND = np.array([-1.0, 0.0, 2.0, 0.0, -1.0])  # Laplacian along one axis of samples two apart
_BETWEEN = np.array([0.5, 1.0, 0.5])  # interpolates samples two apart
_GAUSSIAN = np.exp(-(np.arange(5) ** 2) / 2.0)  # weight of colour differences towards one side, by distance
_ROUNDING = 1e-6  # share of a mean square, below which a difference of two mean squares is rounding alone
_LEAST = 1e-10  # added to divisors; far below any gradient or Laplacian of noise


def residual_interpolation(mosaic: Mosaic, cfa: Tile) -> Image:
    """Demosaic to planes of R, G and B, shape (h, w, 3); parameters are those of `isp.processors.demosaic.menon`."""
    require_bayer(cfa)
    padded = np.pad(mosaic, REACH, mode="reflect")
    height, width = padded.shape
    sites = {colour: mask(cfa, colour, (height, width)) for colour in "RGB"}
    green = _green(padded, sites["G"])
    planes = {"G": green}
    for colour in "RB":
        predicted = _predict(padded, green, sites[colour], (0, 1), _COLOUR_WINDOW)
        planes[colour] = predicted + fill_channels(padded - predicted, cfa, colour)[..., 0]
    return np.stack([planes[colour] for colour in "RGB"], axis=-1)[REACH:-REACH, REACH:-REACH]


def _green(mosaic: Mosaic, green: NDArray[np.bool_]) -> Plane:
    """Interpolate green: at another colour's site, that sample plus the mean difference over the four sides."""
    total, weights = np.zeros_like(mosaic), np.zeros_like(mosaic)
    for axis, difference in ((1, _differences(mosaic, green)), (0, _differences(mosaic.T, green.T).T)):
        gradient = np.abs(scipy.ndimage.convolve1d(difference, [1.0, 0.0, -1.0], axis))
        around = scipy.ndimage.convolve1d(gradient, np.ones(5), 1 - axis)
        for side in (1, -1):
            reached = np.concatenate([np.zeros(4), np.ones(5)])[::side]
            average = np.concatenate([np.zeros(4), _GAUSSIAN / _GAUSSIAN.sum()])[::side]
            weight = 1.0 / (scipy.ndimage.convolve1d(around, reached, axis) ** 2 + _LEAST)
            total += weight * scipy.ndimage.convolve1d(difference, average, axis)
            weights += weight
    return np.where(green, mosaic, mosaic + total / weights)


def _differences(mosaic: Mosaic, green: NDArray[np.bool_]) -> Plane:
    """Compute green minus the other colour of the same row at every pixel, by residual interpolation along rows."""
    between = scipy.ndimage.convolve1d(mosaic, [0.5, 0.0, 0.5], axis=1)
    as_green, as_colour = np.where(green, mosaic, between), np.where(green, between, mosaic)
    result = np.empty_like(mosaic)
    for parity in (0, 1):  # rows with red, rows with blue
        rows = np.zeros_like(green)
        rows[parity::2] = True
        planes = []
        for guide, sampled in ((as_colour, rows & green), (as_green, rows & ~green)):
            predicted = _predict(mosaic, guide, sampled, (1,), _GREEN_WINDOW)
            residual = np.where(sampled, mosaic - predicted, 0.0)
            planes.append(predicted + scipy.ndimage.convolve1d(residual, _BETWEEN, axis=1))
        result[parity::2] = (planes[0] - planes[1])[parity::2]
    return result


def _predict(samples: Plane, guide: Plane, sampled: NDArray[np.bool_], axes: tuple[int, ...], window: int) -> Plane:
    """Predict a colour that is linear in the guide within each window, so that its residual's Laplacian is least."""
    slopes = [sum(scipy.ndimage.convolve1d(plane, _SECOND, axis) for axis in axes) for plane in (guide, samples)]
    guide_slope = np.where(sampled, slopes[0], 0.0)
    sample_slope = slopes[1]
    gain = _sums(guide_slope * sample_slope, window) / (_sums(guide_slope**2, window) + _LEAST)
    count = _sums(sampled.astype(np.float64), window)
    sample, guides = (np.where(sampled, plane, 0.0) for plane in (samples, guide))
    mean, mean_guide = _sums(sample, window) / count, _sums(guides, window) / count
    offset = mean - gain * mean_guide
    # Windows are weighted by how well they fit, because one with a lamp or two surfaces says little about other pixels.
    squares = _sums(sample**2, window) / count
    product = _sums(sample * guides, window) / count - mean * mean_guide
    missed = squares - mean**2 - 2 * gain * product + gain**2 * (_sums(guides**2, window) / count - mean_guide**2)
    weight = 1.0 / np.sqrt(np.maximum(missed, _ROUNDING * squares + _LEAST))
    return (_sums(weight * gain, window) * guide + _sums(weight * offset, window)) / _sums(weight, window)


def _sums(values: Plane, window: int) -> Plane:
    """Sum the window around each pixel afresh, because a running sum would keep the rounding error of bright pixels."""
    ones = np.ones(window)
    return np.asarray(scipy.ndimage.convolve1d(scipy.ndimage.convolve1d(values, ones, 0), ones, 1))
