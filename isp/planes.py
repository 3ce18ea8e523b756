"""Interpolation of the mosaic to one full plane per channel, from which the paper reads the patches h_i of eq. (5).

Planes are filled by normalised convolution (Knutsson & Westin 1993) of the samples with a tent, so that a flat field
stays flat up to the border.
"""

from collections.abc import Sequence
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rodcone.types import Mosaic, Plane
from sensor.cfa import Tile
from sensor.raw import RawImage

BLOCK_ROWS = 128  # rows that go through several sums together, so that intermediate results stay in the cache


def tent(radius: int) -> Plane:
    """Return the weights 1 .. radius + 1 .. 1 along one axis, such as [1 2 1] for radius 1."""
    return radius + 1.0 - np.abs(np.arange(-radius, radius + 1))


@lru_cache(maxsize=64)
def tent_radius(tile: Tile, channel: str) -> int:
    """Return the smallest radius of a tent that reaches a sample of `channel` from every phase of an endless mosaic."""
    sampled = np.array([list(row) for row in tile]) == channel
    for radius in range(int(max(sampled.shape))):
        reached: NDArray[np.bool_] = sampled
        for axis in (0, 1):
            shifts = [np.roll(reached, shift, axis) for shift in range(-radius, radius + 1)]
            reached = np.logical_or.reduce(shifts)
        if np.all(reached):
            return radius
    return int(max(sampled.shape))


def fill(values: NDArray[np.floating], tile: Tile, channel: str) -> NDArray[Any]:
    """Interpolate the samples of `channel` to a full plane; a sampled site keeps its sample.

    Parameters
    ----------
    values : (h, w) float32 or float64
        Mosaic.

    Returns
    -------
    (h, w) of the same type
        The plane. If the frame's edge cuts off every sample within the tent's radius, the next radius that reaches one
        is used. Sums have the same order at every pixel, so that a part of the frame gives the same bits.
    """
    result = np.empty_like(values)
    down, across = len(tile), len(tile[0])
    for phase in np.ndindex(down, across):
        at = (slice(phase[0], None, down), slice(phase[1], None, across))
        radius = tent_radius(tile, channel)
        if tile[phase[0]][phase[1]] == channel:
            result[at] = values[at]
            continue
        total, weight = _tent_sums(values, tile, channel, phase, radius)
        while not np.all(weight):
            radius += 1
            more, more_weight = _tent_sums(values, tile, channel, phase, radius)
            total, weight = np.where(weight > 0.0, total, more), np.where(weight > 0.0, weight, more_weight)
        np.divide(total, weight, out=result[at])
    return result


def _tent_sums(
    values: NDArray[np.floating], tile: Tile, channel: str, phase: tuple[int, ...], radius: int
) -> tuple[NDArray[Any], NDArray[Any]]:
    """Compute the sums of tent times sample, and of the tent alone, for the pixels at one phase of the tile.

    Both sums are over the samples that lie in the frame.
    """
    size = (len(tile), len(tile[0]))
    tents = _phase_tent(tile, channel, phase, radius).astype(values.dtype)
    counts = [len(range(first, length, pace)) for first, length, pace in zip(phase, values.shape, size, strict=True)]
    total, weight = np.zeros(counts, values.dtype), np.zeros(counts, values.dtype)
    for i, j in np.argwhere(tents).tolist():
        # Find the pixels whose sample at this step of the tent lies in the frame, and these samples.
        pixels, samples = [], []
        for start, length, pace, count in zip((phase[0] + i, phase[1] + j), values.shape, size, counts, strict=True):
            low = max(-((start - radius) // pace), 0)
            high = max(min(-((start - radius - length) // pace), count), low)
            pixels.append(slice(low, high))
            samples.append(slice(start - radius + low * pace, start - radius + high * pace, pace))
        total[tuple(pixels)] += tents[i, j] * values[tuple(samples)]
        weight[tuple(pixels)] += tents[i, j]
    return total, weight


@lru_cache(maxsize=256)
def _phase_tent(tile: Tile, channel: str, phase: tuple[int, ...], radius: int) -> Plane:
    """Return the tent around a pixel at one phase of the tile; it is 0 where there is no sample of the channel."""
    size = 2 * radius + 1
    rows, columns = (
        (np.arange(size) - radius + first) % n for first, n in zip(phase, (len(tile), len(tile[0])), strict=True)
    )
    sampled = np.array([list(row) for row in tile])[np.ix_(rows, columns)] == channel
    return np.asarray(sampled * np.outer(tent(radius), tent(radius)))


def rows_at(values: NDArray[Any], pixels: NDArray[np.bool_]) -> NDArray[Any]:
    """Return `values[pixels]` of an (h, w, channel) array, one row of channels per pixel, ten times as fast."""
    return np.compress(pixels.ravel(), values.reshape(-1, values.shape[-1]), axis=0)


def box_sums(values: NDArray[Any], size: tuple[int, int]) -> NDArray[Any]:
    """Sum the values of each box of `size` in the array, everywhere in the same order: pairs, fours, eights."""
    height, width = (length - count + 1 for length, count in zip(values.shape, size, strict=True))
    result = np.empty((height, width), values.dtype)
    for first in range(0, height, BLOCK_ROWS):
        lines = _line_sums(values[first : first + BLOCK_ROWS + size[0] - 1], size[0])
        result[first : first + BLOCK_ROWS] = _line_sums(lines.T, size[1]).T
    return result


def _line_sums(values: NDArray[Any], count: int) -> NDArray[Any]:
    """Sum every `count` consecutive rows, by means of sums over powers of two."""
    rows = len(values) - count + 1
    start = 0
    power = 1
    total = None
    while True:
        if count & power:
            part = values[start : start + rows]
            total = part.copy(order="K") if total is None else np.add(total, part, out=total)
            start = start + power
        if 2 * power > count:
            return np.asarray(total)
        values = values[:-power] + values[power:]
        power = 2 * power


def bilinear(raw: RawImage) -> NDArray[np.float64]:
    """Interpolate every channel at every pixel bilinearly, shape (h, w, channel) [e-].

    A sampled pixel keeps its sample. At the frame's border the existing samples are normalised, so that a flat field
    stays flat.
    """
    return fill_channels(raw.electrons, raw.cfa, raw.channels)


def fill_channels(mosaic: Mosaic, tile: Tile, names: Sequence[str]) -> NDArray[np.float64]:
    """Interpolate a mosaic's channels `names` as `bilinear` does."""
    return np.stack([fill(mosaic, tile, name) for name in names], axis=-1)
