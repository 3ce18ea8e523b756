"""Patches that overlap: where they lie, beyond the frame too, and their weighted sums."""

from itertools import pairwise
from typing import Any

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from isp.ple.tables import taper
from isp.strips import strips
from rodcone.types import Singles

STRIDE = 2  # pixels from patch to patch
ROWS = 64  # of patches whose weights are summed together


def border(length: int, size: int) -> tuple[int, int]:
    """Return how many samples to add before and behind a line, so that all its samples lie in equally many patches."""
    return size - STRIDE, (length - 1) // STRIDE * STRIDE + size - length


def padded(samples: NDArray[Any], size: int) -> NDArray[Any]:
    """Extend samples (h, w, ...) on each side by their `border`, by reflection."""
    sides = [border(length, size) for length in samples.shape[:2]]
    return np.pad(samples, sides + [(0, 0)] * (samples.ndim - 2), mode="reflect")


def gather(values: NDArray[Any], index: NDArray[np.intp], size: int) -> NDArray[Any]:
    """Return patches of values (h, w, ...), shape (patch, values of a patch).

    Parameters
    ----------
    values : array
        C-contiguous; every pixel of it lies in a patch.
    index : (patch,) intp
        Which patches, counted row by row.
    size : int
        Pixels a side of a patch.
    """
    lines = _lines(values, size)
    return lines[_places(values, index, size)].view(values.dtype).reshape(len(index), -1)


def add_patches(total: Singles, values: Singles, index: NDArray[np.intp], size: int) -> None:
    """Add patches to the sums of a frame; `total` (h, w, 4) and `index` as `gather` has them."""
    lines, across = _lines(total, size), size // STRIDE
    places = _places(total, index, size)
    nx = (total.shape[1] - size) // STRIDE + 1
    # Patches whose rows and columns leave the same rest don't overlap: of these each sum takes one at the most.
    rest = (index // nx % across * across + index % nx % across).astype(np.int8)
    order = np.argsort(rest, kind="stable")
    for first, last in pairwise(np.searchsorted(rest[order], np.arange(across**2 + 1))):
        part = order[first:last]
        at = places[part]
        sums = lines[at].view(np.float32)
        sums += values[part].reshape(sums.shape)
        lines[at] = sums.view(lines.dtype)


def _lines(values: NDArray[Any], size: int) -> NDArray[np.void]:
    """View the lines of patches as one item each, which NumPy copies at once: every `STRIDE` pixels of the frame's."""
    of_pixel = values[0, 0].size
    view = sliding_window_view(values.reshape(-1), size * of_pixel, writeable=True)[:: STRIDE * of_pixel]
    return view.view(np.dtype((np.void, size * of_pixel * values.itemsize)))[:, 0]


def _places(values: NDArray[Any], index: NDArray[np.intp], size: int) -> NDArray[np.intp]:
    """Return the indices of patches' lines in `_lines`, shape (patch, line)."""
    width = values.shape[1]
    rows, columns = np.divmod(index, (width - size) // STRIDE + 1)
    return np.asarray((STRIDE * rows[:, None] + np.arange(size)) * (width // STRIDE) + columns[:, None])


def weights(weight: Singles, inner: Singles, shape: tuple[int, int], size: int) -> tuple[Singles, Singles, Singles]:
    """Sum the weights of a frame's patches.

    Parameters
    ----------
    weight : (patch,) float32
        w of `isp.ple.estimate`'s formula.
    inner : (patch, 4) float32
        Posterior variance of the mean of the patch's middle, by channel.
    shape : (ny, nx)
        Rows and columns of patches.
    size : int
        Pixels a side of a patch.

    Returns
    -------
    (h, w) float32
        Sums of weights, times the window, at each pixel.
    (h/2, w/2, 4) and (h/2, w/2) float32
        Sums of weighted variances, and of weights, at each cell of 2x2 pixels.
    """
    ny, nx = shape
    across = size // STRIDE
    pixels = np.zeros(((ny - 1) * STRIDE + size, nx - 1 + across, STRIDE), np.float32)
    cells = np.zeros((ny - 1 + across, nx - 1 + across, 5), np.float32)
    # The window is the product of a row and a column, so weights are summed across first and then down; so are cells.
    sides = taper(size).reshape(across, STRIDE)
    for rows in strips(ny, ROWS):
        part = slice(rows.start * nx, rows.stop * nx)
        both = np.concatenate([inner[part], np.ones((part.stop - part.start, 1), np.float32)], axis=1)
        both = (both * weight[part, None]).reshape(-1, nx, 5)
        lines, of_cells = (np.zeros((len(both), nx - 1 + across, width), np.float32) for width in (STRIDE, 5))
        for j in range(across):
            lines[:, j : j + nx] += both[..., 4:] * sides[j]
            of_cells[:, j : j + nx] += both
        for i in range(across):
            cells[rows.start + i : rows.stop + i] += of_cells
            for side in range(STRIDE):
                first = STRIDE * (rows.start + i) + side
                pixels[first : first + STRIDE * len(lines) : STRIDE] += lines * sides[i, side]
    return pixels.reshape(len(pixels), -1), cells[..., :4], cells[..., 4]
