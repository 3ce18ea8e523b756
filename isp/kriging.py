"""Best linear estimate of every channel at every pixel of any mosaic: universal kriging (Matheron 1969).

Channels are modelled as correlated random fields, each around a plane with three unknown numbers (level and slopes).
Among all weights that reproduce constant and linear channels exactly, those of least expected error are used. Samples
are in units of their noise (`isp.anscombe`). The interleaved reconstruction chooses samples that look alike; here a
pixel's filter depends only on its place in the tile and near the border. Near lamps a second filter is used, which
estimates each channel from its own samples.
"""

from collections.abc import Iterator
from dataclasses import replace
from functools import cache, lru_cache

import numpy as np
import scipy
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from isp.anscombe import stabilise_raw, unstabilise, without_prnu
from isp.blas import one_thread
from isp.settings import Reconstruction
from isp.strips import strips
from rodcone.types import Plane
from sensor.cfa import Tile, channels, mask
from sensor.raw import RawImage

# The best of 3 radii, 6 correlations and 4 lengths on three scenes in two lights (docs/decisions/0048).
RADIUS = 6  # radius [pixels] of the window of samples; a corner then has every channel on three lines or more
SIDE = 2 * RADIUS + 1  # side of the window
CORRELATION = 0.93  # correlation of two channels' values at one pixel
LENGTH = 6.0  # length of the exponential covariance [pixels]
BESIDE_LAMPS = 1e3  # assumed variation of a channel beside a lamp [standard deviations of noise]
OUTLYING = 8.0  # a sample is a lamp's if it lies above the middle two thirds by so many times half their width
STRIP_ROWS = 256  # rows that are estimated together, so that memory never holds a whole frame of every channel
LEAST_DEVIATION = 0.1  # least assumed variation of a channel, which a flat field lacks [standard deviations of noise]


def reconstruct_linear(raw: RawImage) -> Reconstruction:
    """Estimate every channel at every pixel of a raw image of any mosaic.

    The variation of each channel is measured on the middle two thirds of its samples, so that a lamp doesn't influence
    it. If a saturated or an outlying sample lies in the window, each channel is estimated from its own samples alone,
    because a full W says nothing about G. It is then interpolated without smoothing, because otherwise a lamp would
    spread over the whole window. The estimate of an even field, however dark, is within 0.1 e- of its mean.
    """
    estimates, noise_gains = zip(*(strip[1:] for strip in linear_strips(raw)), strict=True)
    return Reconstruction(np.concatenate(estimates), np.concatenate(noise_gains), engine="numpy")


def linear_strips(raw: RawImage) -> Iterator[tuple[slice, Plane, Plane]]:
    """Yield the result of `reconstruct_linear` in strips, bit for bit: rows, estimate [e-] and noise gain."""
    names = raw.channels
    plain = replace(without_prnu(raw), noise_steps=())
    values = stabilise_raw(raw.electrons, plain)
    sampled = [mask(raw.cfa, name, raw.shape) for name in names]
    low, high = np.array([np.percentile(values[at], (15.9, 84.1)) for at in sampled]).T
    spread = (high - low) / 2
    deviation = np.sqrt(np.maximum(spread**2 - 1.0, LEAST_DEVIATION**2))
    bright = raw.saturated | (values > np.select(sampled, list(high + OUTLYING * np.maximum(spread, 1.0))))
    beside = scipy.ndimage.maximum_filter(bright, size=SIDE)
    noises = [raw.noise_of(name) for name in names]
    for strip in strips(len(values), STRIP_ROWS):
        rows = range(strip.start, strip.stop)
        estimate, noise_gain = krige(values, raw.cfa, deviation, rows=rows)
        if beside[strip].any():
            lone = np.full_like(deviation, BESIDE_LAMPS)
            apart = krige(values, raw.cfa, lone, 0.0, rows=rows, where=beside)
            estimate, noise_gain = (
                np.where(beside[strip][..., None], *both) for both in zip(apart, (estimate, noise_gain), strict=True)
            )
        # `unstabilise` expects the mean of noisy samples, and adds the 1/4 e- by which noise lowers a mean of roots.
        # The noise that is left in the estimate (`noise_gain`, as a share of a sample's variance) was not averaged
        # away, so that share of the 1/4 e- is subtracted again. Values of a channel with its own readings are
        # electrons divided by `noise.shot`, which is undone at the end.
        electrons = np.empty_like(estimate)
        for index, noise in enumerate(noises):
            counted = unstabilise(estimate[..., index], noise.dark_noise_e / noise.shot) - noise_gain[..., index] / 4
            electrons[..., index] = counted * noise.shot
        yield strip, electrons, noise_gain


def krige(
    values: Plane,
    tile: Tile,
    deviation: Plane,
    correlation: float = CORRELATION,
    *,
    rows: range | None = None,
    where: NDArray[np.bool_] | None = None,
) -> tuple[Plane, Plane]:
    """Estimate every channel at every pixel of a mosaic whose samples have noise of variance 1.

    Parameters
    ----------
    values : (h, w) float64
        Mosaic that begins at the tile's first pixel.
    tile : tuple of str
    deviation : (channel,) float64
        Standard deviation of each channel's signal, above 0.
    correlation : float
        Correlation of two channels at one pixel.
    rows : range, optional
        Rows to estimate, by default all.
    where : (h, w) bool, optional
        Pixels to estimate, by default all; others may be 0.

    Returns
    -------
    estimate, noise_gain : (row, w, channel) float64
        Results for these rows, channels in the order of `sensor.cfa.channels`. The gain is the sum of the squared
        weights, which is the noise's variance in the estimate.
    """
    height, width = values.shape
    count = len(channels(tile))
    asked = range(height) if rows is None else rows
    scales = (*deviation.tolist(), correlation)
    estimate, noise_gain = np.zeros((2, count, len(asked), width))
    for alike in _alike(height, len(tile)):
        part = _within(alike, asked)
        if not len(range(height)[part]):
            continue
        at = slice(part.start - asked.start, part.stop - asked.start, part.step)
        for columns in _alike(width, len(tile[0])):
            if where is not None and not where[part, columns].any():
                continue
            first = alike.start, columns.start
            down, across = (_reach(at, side) for at, side in zip(first, values.shape, strict=True))
            with one_thread():
                weights = _weights(tile, (first[0] % len(tile), first[1] % len(tile[0])), down, across, scales)
                estimate[:, at, columns] = _weighted(values, weights, part, columns, (down, across))
            noise_gain[:, at, columns] = (weights**2).sum(axis=1)[:, None, None]
    return np.moveaxis(estimate, 0, -1), np.moveaxis(noise_gain, 0, -1)


def _reach(at: int, side: int) -> tuple[int, int]:
    """Return the part of a window around a pixel that lies in the frame: its first offset, and one after the last."""
    return -min(RADIUS, at), min(RADIUS, side - 1 - at) + 1


def _alike(side: int, period: int) -> list[slice]:
    """Group the positions along one axis by equal weights: inside by phase of the tile, near the border one by one."""
    inside = range(RADIUS, max(side - RADIUS, RADIUS))
    border = [at for at in range(side) if at not in inside]
    phases = [slice(first, inside.stop, period) for first in inside[:period]]
    return [slice(at, at + 1, period) for at in border] + phases


def _within(positions: slice, asked: range) -> slice:
    """Restrict `positions` to those that are in `asked`."""
    first = positions.start + max(-(-(asked.start - positions.start) // positions.step), 0) * positions.step
    return slice(first, max(min(positions.stop, asked.stop), first), positions.step)


def _weighted(
    values: Plane, weights: Plane, rows: slice, columns: slice, window: tuple[tuple[int, int], tuple[int, int]]
) -> Plane:
    """Compute the weighted sums of the samples in each window, by the same weights, shape (channel, row, column)."""
    (top, bottom), (left, right) = window
    around = values[rows.start + top : rows.stop - 1 + bottom, columns.start + left : columns.stop - 1 + right]
    windows = sliding_window_view(around, (bottom - top, right - left))[:: rows.step, :: columns.step]
    total = np.empty((len(weights), *windows.shape[:2]))
    for row, samples in enumerate(windows):  # one row at a time, because BLAS's last bits depend on the matrix's size
        total[:, row] = weights @ samples.reshape(-1, weights.shape[1]).T
    return total


@cache
def _nearness() -> Plane:
    """Return exp(-distance / LENGTH) between every two pixels of a whole window, row by row."""
    rows, columns = np.divmod(np.arange(SIDE**2), SIDE)
    return np.asarray(np.exp(-np.hypot(rows[:, None] - rows, columns[:, None] - columns) / LENGTH))


@lru_cache(maxsize=1024)
def _weights(
    tile: Tile, phase: tuple[int, int], down: tuple[int, int], across: tuple[int, int], scales: tuple[float, ...]
) -> Plane:
    """Compute the weights of a window's samples, row by row, in the estimate of each channel, shape (channel, sample).

    Parameters
    ----------
    tile : tuple of str
    phase : (int, int)
        Row and column of the pixel within the tile.
    down, across : (int, int)
        First offset of the window from the pixel along each axis, and one after the last.
    scales : tuple of float
        Standard deviation of each channel, and the correlation of two channels at one pixel.
    """
    names, (*deviation, correlation) = channels(tile), scales
    rows, columns = (x.ravel() for x in np.mgrid[slice(*down), slice(*across)])
    cells = np.array([[names.index(name) for name in row] for row in tile])
    channel = cells[(phase[0] + rows) % len(tile), (phase[1] + columns) % len(tile[0])]

    # Covariance between samples, and of samples with the channels' values at the pixel.
    between = np.where(np.eye(len(names)), 1.0, correlation) * np.outer(deviation, deviation)
    near = _nearness()
    at = (RADIUS + rows) * SIDE + RADIUS + columns
    covariance = between[channel[:, None], channel] * near[at[:, None], at] + np.eye(rows.size)
    target_covariance = between[:, channel] * near[len(near) // 2, at]

    # With Lagrange multipliers each channel's own plane is reproduced exactly.
    sampled = channel == np.arange(len(names))[:, None]
    planes = np.concatenate([sampled, sampled * rows, sampled * columns]).astype(np.float64)
    system = np.block([[covariance, planes.T], [planes, np.zeros((len(planes), len(planes)))]])
    target = np.concatenate([np.eye(len(names)), np.zeros((len(names), 2 * len(names)))], axis=1)
    right_side = np.concatenate([target_covariance, target], axis=1).T
    if np.linalg.matrix_rank(planes) == len(planes):
        return np.asarray(np.linalg.solve(system, right_side)[: rows.size].T)
    # In a small frame a channel may have too few samples for its slope; then the least-squares solution is used.
    return np.asarray(np.linalg.lstsq(system, right_side, rcond=None)[0][: rows.size].T)
