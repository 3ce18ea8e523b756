"""Patches that overlap: where they lie, beyond the frame too, and their weighted sums."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from isp.ple.pick import BLOCK
from isp.ple.tables import taper
from rodcone.types import Singles

STRIDE = 2  # pixels from patch to patch


@dataclass(frozen=True)
class Patches:
    """Estimates of some patches; arrays over the patches first.

    Attributes
    ----------
    values : (patch, value) float32
        Every channel at every pixel, times window and weight.
    weight : (patch,) float32
        w of `isp.ple.estimate`'s formula.
    inner, noise : (patch, 4) float32
        By channel: posterior variance of the mean of the patch's middle, and of a pixel over a sample's noise.
    """

    values: Singles
    weight: Singles
    inner: Singles
    noise: Singles


def border(length: int, size: int) -> tuple[int, int]:
    """Return how many samples to add before and behind a line, so that all its samples lie in equally many patches."""
    return size - STRIDE, (length - 1) // STRIDE * STRIDE + size - length


def padded(samples: NDArray[Any], size: int) -> NDArray[Any]:
    """Extend samples (h, w, ...) on each side by their `border`, by reflection."""
    sides = [border(length, size) for length in samples.shape[:2]]
    return np.pad(samples, sides + [(0, 0)] * (samples.ndim - 2), mode="reflect")


def overlapped(patches: Patches, shape: tuple[int, int], size: int) -> tuple[Singles, ...]:
    """Sum over overlapping patches: values and weights per pixel, then variances and weights per cell of 2x2 pixels."""
    ny, nx = shape
    across = size // STRIDE
    total = np.zeros(((ny - 1) * STRIDE + size, nx - 1 + across, 4 * STRIDE), np.float32)
    values = patches.values.reshape(ny, nx, size, -1)
    # Several rows of patches are added at once, so that each value is read once from memory. Of a row, every
    # `across`-th patch is added at once: these lie side by side without overlap.
    together = max(1, 4 * BLOCK // nx)
    for first in range(0, ny, together):
        lines = slice(first, min(first + together, ny))
        for i in range(size):
            rows = total[first * STRIDE + i : (lines.stop - 1) * STRIDE + i + 1 : STRIDE]
            for j in range(min(across, nx)):
                part = values[lines, j::across, i]
                line = rows[:, j : j + part.shape[1] * across].reshape(part.shape)  # a view: `total` takes the sum
                line += part
    # The window is the product of a row and a column, so weights are summed across first and then down; so are cells.
    inner = np.concatenate([patches.inner, np.ones((ny * nx, 1), np.float32)], axis=1)
    inner = (inner * patches.weight[:, None]).reshape(ny, nx, 5)
    shares = inner[..., 4:]
    sides = taper(size).reshape(across, STRIDE)
    weight, cells = (np.zeros((ny, nx - 1 + across, width), np.float32) for width in (STRIDE, 5))
    for j in range(across):
        weight[:, j : j + nx] += shares * sides[j]
        cells[:, j : j + nx] += inner
    weights = np.zeros((len(total), nx - 1 + across, STRIDE), np.float32)
    sums = np.zeros((ny - 1 + across, nx - 1 + across, 5), np.float32)
    for i in range(across):
        sums[i : i + ny] += cells
        for side in range(STRIDE):
            weights[STRIDE * i + side :: STRIDE][:ny] += weight * sides[i, side]
    return total.reshape(len(total), -1, 4), weights.reshape(len(total), -1), sums[..., :4], sums[..., 4]
