"""From the mosaic to one full plane a letter, in units of noise: where the patches h_i of eq. (5) are read.

Planes are filled by normalised convolution (Knutsson & Westin 1993) of the samples with a tent, so a flat field stays
flat up to the border. They serve only to judge similarity: what is averaged are the samples themselves.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import convolve1d

from sensor.cfa import Tile, channels, mask
from sensor.raw import RawImage

Plane = NDArray[np.float64]


def stabilise(raw: RawImage) -> Plane:
    """Mosaic in units of its own noise: generalised Anscombe transform at unit gain.

    t = 2 sqrt(max(e + 3/8 + s^2, 0)) for Poisson e with Gaussian noise of standard deviation s = `raw.dark_noise_e`
    (Murtagh, Starck & Bijaoui 1995, eq. 7). Its standard deviation is 1 from a few electrons on.

    Returns
    -------
    (h, w) float64
        Stabilised mosaic [standard deviations of a pixel's noise].
    """
    return np.asarray(2.0 * np.sqrt(np.maximum(raw.electrons + 0.375 + raw.dark_noise_e**2, 0.0)))


def tent(radius: int) -> Plane:
    """Weights 1 .. radius + 1 .. 1 along one axis: [1 2 1] for radius 1."""
    return radius + 1.0 - np.abs(np.arange(-radius, radius + 1))


def tent_radius(tile: Tile, letter: str) -> int:
    """Smallest radius of a tent that reaches a sample of `letter` from every phase of an endless mosaic."""
    sampled = np.array([list(row) for row in tile]) == letter
    for radius in range(int(max(sampled.shape))):
        reached: NDArray[np.bool_] = sampled
        for axis in (0, 1):
            shifts = [np.roll(reached, shift, axis) for shift in range(-radius, radius + 1)]
            reached = np.logical_or.reduce(shifts)
        if np.all(reached):
            return radius
    return int(max(sampled.shape))


def tent_weights(tile: Tile, letter: str) -> Plane:
    """Weights with which `fill` makes a plane of an endless mosaic, by phase.

    Returns
    -------
    (th, tw, 2r + 1, 2r + 1) float64
        Weight, for the pixel at phase (i, j) of the tile, of the site at each offset up to the radius r. Sums to 1.
    """
    radius = tent_radius(tile, letter)
    height, width = len(tile), len(tile[0])
    sampled = np.pad(mask(tile, letter, (height, width)), radius, mode="wrap")
    windows = np.lib.stride_tricks.sliding_window_view(sampled, (2 * radius + 1, 2 * radius + 1))
    weights = windows * np.outer(tent(radius), tent(radius))
    weights[mask(tile, letter, (height, width))] = 0.0
    weights[mask(tile, letter, (height, width)), radius, radius] = 1.0
    return np.asarray(weights / weights.sum((2, 3), keepdims=True))


def fill(values: Plane, tile: Tile, letter: str) -> Plane:
    """One full plane from the samples of `letter`; a sampled site keeps its sample.

    Parameters
    ----------
    values : (h, w) float64
        Mosaic.

    Returns
    -------
    (h, w) float64
        Where the frame's edge cuts off every sample within the tent's radius, the next radius that reaches one serves.
    """
    sampled = mask(tile, letter, (values.shape[0], values.shape[1]))
    plane, known = np.where(sampled, values, 0.0), sampled
    samples, radius = plane, tent_radius(tile, letter)
    while not known.all():
        total, weight = samples, sampled.astype(np.float64)
        for axis in (0, 1):
            total = convolve1d(total, tent(radius), axis, mode="constant")
            weight = convolve1d(weight, tent(radius), axis, mode="constant")
        plane = np.where(known, plane, total / np.maximum(weight, 1.0))  # a weight is 0 or at least 1
        known, radius = known | (weight > 0.0), radius + 1
    return plane


def planes(raw: RawImage) -> Plane:
    """Planes h_i in units of noise, shape (channel, h, w), in the order of `sensor.cfa.channels`."""
    stable = stabilise(raw)
    return np.stack([fill(stable, raw.cfa, letter) for letter in channels(raw.cfa)])
