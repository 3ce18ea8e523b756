"""From the mosaic to one full plane a letter, in units of noise: where the patches h_i of eq. (5) are read.

Planes are filled by normalised convolution (Knutsson & Westin 1993) of the samples with a tent, so a flat field stays
flat up to the border. They serve only to judge similarity: what is averaged are the samples themselves.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from isp.settings import Distance
from sensor.cfa import Tile, channels
from sensor.raw import RawImage

Plane = NDArray[np.float64]

# Under it PRNU adds less than 1 % to shot noise up to a million electrons, and ln(1 + p) runs out of digits.
LEAST_PRNU = 1e-4


def stabilise(electrons: NDArray[Any], dark_noise_e: float, prnu: float) -> NDArray[Any]:
    """Mosaic in units of its own noise: generalised Anscombe transform at unit gain, with PRNU.

    The integral of 1 / sqrt(s^2 + e + 3/8 + (p e)^2), shot noise, dark noise s and PRNU p:

        t = ln(1 + 2 p sqrt(v) + 2 p^2 e') / p,    e' = e + 3/8,    v = s^2 + e' + (p e')^2

    which for p -> 0 is 2 sqrt(e + 3/8 + s^2) (Murtagh, Starck & Bijaoui 1995, eq. 7) less a constant. Its standard
    deviation is 1 from a few electrons on. Where e' is under 0 PRNU is left out; under -s^2 t stays 0.

    Parameters
    ----------
    electrons : (h, w) float32 or float64
        Mosaic [e-].
    dark_noise_e : float
        s, as `RawImage.dark_noise_e` [e-].
    prnu : float
        p, as `RawImage.prnu`.

    Returns
    -------
    (h, w) of the same type
        Stabilised mosaic [standard deviations of a pixel's noise].
    """
    if prnu < LEAST_PRNU:
        return np.asarray(2.0 * np.sqrt(np.maximum(electrons + (0.375 + dark_noise_e**2), 0.0)))
    seen = np.maximum(electrons + 0.375, 0.0)
    variance = np.maximum(electrons + (0.375 + dark_noise_e**2), 0.0) + (prnu * seen) ** 2
    return np.asarray(np.log(1.0 + 2.0 * prnu * np.sqrt(variance) + 2.0 * prnu**2 * seen) / prnu)


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
    weights = np.zeros((len(tile), len(tile[0]), 2 * radius + 1, 2 * radius + 1))
    for phase in np.ndindex(*weights.shape[:2]):
        if tile[phase[0]][phase[1]] == letter:
            weights[(*phase, radius, radius)] = 1.0
        else:
            weights[phase] = _phase_tent(tile, letter, phase, radius)
    return np.asarray(weights / weights.sum((2, 3), keepdims=True))


def fill(values: NDArray[Any], tile: Tile, letter: str) -> NDArray[Any]:
    """One full plane from the samples of `letter`; a sampled site keeps its sample.

    Parameters
    ----------
    values : (h, w) float32 or float64
        Mosaic.

    Returns
    -------
    (h, w) of the same type
        Where the frame's edge cuts off every sample within the tent's radius, the next radius that reaches one serves.
        The sums run in one order at every pixel: a part of the frame gives the same bits.
    """
    radius = tent_radius(tile, letter)
    total, weight = _tent_sums(values, tile, letter, radius)
    while not np.all(weight):
        radius += 1
        more, more_weight = _tent_sums(values, tile, letter, radius)
        total, weight = np.where(weight > 0.0, total, more), np.where(weight > 0.0, weight, more_weight)
    total /= weight
    return total


def _tent_sums(values: NDArray[Any], tile: Tile, letter: str, radius: int) -> tuple[NDArray[Any], NDArray[Any]]:
    """Sums of tent times sample, and of the tent, over the samples in the frame; a sampled site is its own sum."""
    padded, size = np.pad(values, radius), (len(tile), len(tile[0]))
    inside = [np.pad(np.ones(length, values.dtype), radius) for length in values.shape]
    total, weight = np.empty_like(values), np.empty_like(values)
    for phase in np.ndindex(*size):
        at = slice(phase[0], None, size[0]), slice(phase[1], None, size[1])
        if tile[phase[0]][phase[1]] == letter:
            total[at], weight[at] = values[at], 1.0
            continue
        # Row and column of the first pixel of this phase, moved by each step of the tent.
        lines = [
            [slice(first + step, length + step, pace) for step in range(2 * radius + 1)]
            for first, length, pace in zip(phase, values.shape, size, strict=True)
        ]
        tents = _phase_tent(tile, letter, phase, radius).astype(values.dtype)
        total[at] = sum(tents[i, j] * padded[lines[0][i], lines[1][j]] for i, j in np.argwhere(tents))
        rows, columns = (
            np.stack([line[place] for place in places]) for line, places in zip(inside, lines, strict=True)
        )
        # Small whole numbers: exact. Outer products, for a product of matrices would keep its threads spinning.
        weight[at] = sum(np.outer(row, line @ columns) for row, line in zip(rows, tents, strict=True) if line.any())
    return total, weight


def _phase_tent(tile: Tile, letter: str, phase: tuple[int, ...], radius: int) -> Plane:
    """Tent around a pixel of some phase of the tile, 0 where there is no sample of the letter."""
    size = 2 * radius + 1
    rows, columns = (
        (np.arange(size) - radius + first) % n for first, n in zip(phase, (len(tile), len(tile[0])), strict=True)
    )
    sampled = np.array([list(row) for row in tile])[np.ix_(rows, columns)] == letter
    return np.asarray(sampled * np.outer(tent(radius), tent(radius)))


def box_sums(values: NDArray[Any], size: tuple[int, int]) -> NDArray[Any]:
    """Sum of each box of `size` that lies in the array, added up in one order everywhere: pairs, fours, eights."""
    for axis, count in enumerate(size):
        values = _line_sums(values.swapaxes(0, axis), count).swapaxes(0, axis)
    return values


def _line_sums(values: NDArray[Any], count: int) -> NDArray[Any]:
    """Sums of `count` rows that follow each other, from sums of a power of two of them."""
    rows, start, power, total = len(values) - count + 1, 0, 1, None
    while True:
        if count & power:
            part = values[start : start + rows]
            total, start = part.copy(order="K") if total is None else np.add(total, part, out=total), start + power
        if 2 * power > count:
            return np.asarray(total)
        values, power = values[:-power] + values[power:], 2 * power


def judged_mosaic(electrons: NDArray[Any], raw: RawImage, distance: Distance) -> NDArray[Any]:
    """The mosaic of `raw` [e-] as patches are read from it: in units of noise, or as it is."""
    return stabilise(electrons, raw.dark_noise_e, raw.prnu) if distance == "noise" else electrons


def planes(raw: RawImage, distance: Distance = "noise") -> Plane:
    """Planes h_i, shape (channel, h, w), in the order of `sensor.cfa.channels`."""
    mosaic = judged_mosaic(raw.electrons, raw, distance)
    return np.stack([fill(mosaic, raw.cfa, letter) for letter in channels(raw.cfa)])
