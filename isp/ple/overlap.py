"""Overlapping patches: their places, which reach beyond the frame, and their weighted sums."""

from itertools import pairwise
from typing import Any

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from isp.ple.tables import taper
from isp.strips import strips
from rodcone.types import Singles

STRIDE = 2  # pixels from patch to patch
ROWS = 64  # rows of patches whose weights are summed together


def border(length: int, size: int) -> tuple[int, int]:
    """Return how many samples to add at either end of a line, so that all its samples lie in equally many patches."""
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
        C-contiguous array, whose every pixel lies in a patch.
    index : (patch,) intp
        Numbers of the patches to return, counted row by row.
    size : int
        Side of a patch [pixels].
    """
    lines = _lines(values, size)
    return lines[_places(values, index, size)].view(values.dtype).reshape(len(index), -1)


def add_patches(total: Singles, values: Singles, index: NDArray[np.intp], size: int) -> None:
    """Add patches to the sums of a frame, `total` (h, w, 4); `index` and `size` are those of `gather`."""
    lines, across = _lines(total, size), size // STRIDE
    places = _places(total, index, size)
    nx = (total.shape[1] - size) // STRIDE + 1
    # Patches whose row and column leave the same remainders after division by `across` don't overlap. They are added at
    # once, because each pixel lies in at most one of them.
    rest = (index // nx % across * across + index % nx % across).astype(np.int8)
    order = np.argsort(rest, kind="stable")
    for first, last in pairwise(np.searchsorted(rest[order], np.arange(across**2 + 1))):
        part = order[first:last]
        at = places[part]
        sums = lines[at].view(np.float32)
        sums += values[part].reshape(sums.shape)
        lines[at] = sums.view(lines.dtype)


def _lines(values: NDArray[Any], size: int) -> NDArray[np.void]:
    """View `size` pixels from every `STRIDE`-th pixel on, which are a line of a patch, as one item, to copy at once."""
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
        w_p of `isp.ple.estimate`'s formula.
    inner : (patch, 4) float32
        Posterior variance of the mean over the patch's middle half, per channel.
    shape : (ny, nx)
        Numbers of patches down and across.
    size : int
        Side of a patch [pixels].

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
    # The window is the product of a row and a column. Sums over overlapping patches are therefore made across first and
    # then down, at the pixels and, with even weights, at the cells.
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
