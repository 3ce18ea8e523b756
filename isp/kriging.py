"""Every channel at every pixel as the best linear estimate from a mosaic of any tile: universal kriging (Matheron 1969).

Channels are taken for random fields that vary together around a plane of their own, whose three numbers are unknown:
so weights are found that give back every mosaic of planes, constant or linear, exactly, and among these the ones of
least error. A sample's noise is known. Nothing is decided pixel by pixel: where the interleaved reconstruction chooses
among samples that look alike, this one is a fixed filter for each pixel of the tile.
"""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter

from sensor.cfa import Tile, channels, mask
from sensor.raw import RawImage

Plane = NDArray[np.float64]

RADIUS = 4  # of the window that samples are taken from [pixels]: a tile of 4x4 shows every channel on all sides
# Of 4 correlations x 2 lengths on three scenes, quad and Bayer, best or within 0.2 dB (docs/decisions/0048).
CORRELATION = 0.97  # of two channels' values at one pixel
LENGTH = 6.0  # of the exponential covariance [pixels]


def reconstruct_linear(raw: RawImage) -> Plane:
    """Every channel at every pixel of a raw image [e-], shape (h, w, channel), as `sensor.cfa.channels` orders them.

    What channels show and how noisy they are is taken from their samples, over the whole frame. Where a saturated pixel
    lies in the window each channel is estimated from its own samples alone: a full W says nothing of G.
    """
    electrons, names = raw.electrons, channels(raw.cfa)
    samples = [electrons[mask(raw.cfa, name, raw.shape)] for name in names]
    noise = np.sqrt([max(x.mean(), 0.0) + raw.dark_noise_e**2 for x in samples])
    # A channel that shows nothing but noise counts as faint, not as dark: weights over 0 are not defined.
    deviation = np.sqrt([max(x.var() - y**2, 1e-4 * y**2) for x, y in zip(samples, noise, strict=True)])
    together = krige(electrons, raw.cfa, deviation, noise)
    full = maximum_filter(raw.saturated, size=2 * RADIUS + 1)
    if not full.any():
        return together
    return np.where(full[..., None], krige(electrons, raw.cfa, deviation, noise, 0.0), together)


def krige(values: Plane, tile: Tile, deviation: Plane, noise: Plane, correlation: float = CORRELATION) -> Plane:
    """Estimate every channel at every pixel.

    Parameters
    ----------
    values : (h, w) float64
        Mosaic that begins at the tile's first pixel.
    tile : tuple of str
    deviation, noise : (channel,) float64
        Standard deviation of what each channel shows, above 0, and of one sample's noise, in units of `values`.
    correlation : float
        Of two channels at one pixel.

    Returns
    -------
    (h, w, channel) float64
        Channels in the order of `sensor.cfa.channels`.
    """
    height, width = values.shape
    names = channels(tile)
    scales = tuple((deviation / deviation.max()).tolist()), tuple((noise / deviation.max()).tolist()), correlation
    result = np.empty((len(names), height, width))
    for rows in _alike(height, len(tile)):
        for columns in _alike(width, len(tile[0])):
            first = rows.start, columns.start
            down, across = (_reach(at, side) for at, side in zip(first, values.shape, strict=True))
            phase = first[0] % len(tile), first[1] % len(tile[0])
            weights = _weights(tile, phase, down, across, scales)
            total = np.zeros((len(names), len(range(height)[rows]), len(range(width)[columns])))
            for number, (i, j) in enumerate(np.ndindex(down[1] - down[0], across[1] - across[0])):
                seen = values[_moved(rows, down[0] + i), _moved(columns, across[0] + j)]
                total += weights[:, number, None, None] * seen
            result[:, rows, columns] = total
    return np.moveaxis(result, 0, -1)


def _reach(at: int, side: int) -> tuple[int, int]:
    """Offsets of the window around a pixel that lie in the frame: first, and one after the last."""
    return -min(RADIUS, at), min(RADIUS, side - 1 - at) + 1


def _alike(side: int, period: int) -> list[slice]:
    """Positions along one axis that the same weights serve: of one phase inside, each by itself near the border."""
    inside = range(RADIUS, max(side - RADIUS, RADIUS))
    border = [at for at in range(side) if at not in inside]
    phases = [slice(first, inside.stop, period) for first in inside[:period]]
    return [slice(at, at + 1, period) for at in border] + phases


def _moved(positions: slice, offset: int) -> slice:
    return slice(positions.start + offset, positions.stop + offset, positions.step)


@lru_cache(maxsize=1024)
def _weights(
    tile: Tile,
    phase: tuple[int, int],
    down: tuple[int, int],
    across: tuple[int, int],
    scales: tuple[tuple[float, ...], tuple[float, ...], float],
) -> Plane:
    """Weights of the window's samples, row by row, for each channel, shape (channel, sample)."""
    names, (deviation, noise) = channels(tile), (np.array(scale) for scale in scales[:2])
    rows, columns = (x.ravel() for x in np.mgrid[slice(*down), slice(*across)])
    letters = [tile[(phase[0] + i) % len(tile)][(phase[1] + j) % len(tile[0])] for i, j in zip(rows, columns)]
    channel = np.array([names.index(letter) for letter in letters])

    # Covariance between samples, and of samples with what is asked for.
    between = np.where(np.eye(len(names)), 1.0, scales[2]) * np.outer(deviation, deviation)
    distance = np.hypot(rows[:, None] - rows, columns[:, None] - columns)
    covariance = between[channel[:, None], channel] * np.exp(-distance / LENGTH) + np.diag(noise[channel] ** 2)
    asked = between[:, channel] * np.exp(-np.hypot(rows, columns) / LENGTH)

    # Planes of each channel by itself have to come out exactly: Lagrange's multipliers.
    own = channel == np.arange(len(names))[:, None]
    planes = np.concatenate([own, own * rows, own * columns]).astype(np.float64)
    system = np.block([[covariance, planes.T], [planes, np.zeros((len(planes), len(planes)))]])
    target = np.concatenate([np.eye(len(names)), np.zeros((len(names), 2 * len(names)))], axis=1)
    solved = np.linalg.lstsq(system, np.concatenate([asked, target], axis=1).T, rcond=None)[0]
    return np.asarray(solved[: rows.size].T)
