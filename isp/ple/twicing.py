"""Twicing (Tukey 1977) of colours: colour that the prior removed, although the samples show it, is added back.

In the dark the prior desaturates strong colours at every scale, and turns red towards the hues that are common near it.
Over a region of one colour the samples know better: their mean difference from the estimate is the estimate's bias b_c,
plus noise. Means are over cells of 4x4 pixels, in which every channel has samples, weighted by how alike cells are in
the estimate (as in a bilateral filter, Tomasi & Manduchi 1998):

    b_c(i) = sum_j w_ij r_c(j) / sum_j w_ij n_c(j),   w_ij = exp(-|x_i - x_j|^2 / 2 ALIKE^2),

where r_c is the sum of the residuals of a cell's n_c samples of channel c, and x the estimate in units of noise. The
mosaic's sharpest channel g knows brightness best, so that brightness isn't changed. With the estimated light l_c [e-],
a colour gets d_c = b_c - (l_c / l_g) b_g, times 1 - SURE / chi^2 where that is positive (James & Stein 1961). Here
chi^2 is the mean over the colours of d_c^2 over its variance s_c^2. The estimate is seldom wrong by more than half of a
colour's light l_c. This half is therefore the prior standard deviation of its bias, and d_c is multiplied by Wiener's
share (l_c / 2)^2 / ((l_c / 2)^2 + s_c^2), because samples that know a region's light less well add only noise. The
result is added as a share of the colour's light, so that dark places of a region get less.

Such a mean reaches `REACH` cells, 16 pixels, to each side. If these show too little, a wider region may show enough,
for example if a whole picture is red. The same is therefore done three times, with cells of 16, then 8, then 4 pixels a
side, each time with the residuals that are left.

A cell of 4x4 pixels in which the residuals of a channel differ from each other by more than noise holds a lamp or an
edge, and no even surface. Its residuals count for no cell, and nothing is added to it.
"""

from concurrent.futures import ThreadPoolExecutor
from os import cpu_count
from typing import Any

import numpy as np
from numpy.typing import NDArray

from isp.ple.residual_lines import GUIDES
from rodcone.types import Singles
from sensor.cfa import channel_map
from sensor.raw import RawImage

CELL = 4  # side of a cell [pixels]; no tile is larger
TOGETHER_CELLS = (4, 2, 1)  # side of the squares of cells that are treated as one cell, in each of the three rounds
REACH = 4  # cells on each side whose residuals count
SURE = 1.5  # chi^2 up to which nothing is added; 1 would bring hues a little nearer, but coloured clouds into black
LIKELY_BIAS = 0.5  # standard deviation of the bias that a colour's estimate is expected to have [share of its light]
ALIKE = 1.0  # standard deviation of the weight over the difference of two cells' estimates [units of a sample's noise]
LEAST_ALIKE = 0.05  # sum of weights below which the wider cells around a cell count for less
TOGETHER = 16  # rows of cells that are worked on together
LAMP_SIGMAS = 6.0  # root of a cell's summed squared residuals from which it holds no even surface [sigmas of noise]
_LEAST = np.float32(1e-12)


def twice_colours(planes: Singles, stable: Singles, raw: RawImage) -> None:
    """Add to each colour the mean residual of the samples in similar places.

    Parameters
    ----------
    planes : (h, w, channel) float32
        Estimate [e-], channels in the order of `sensor.cfa.channels`; it is overwritten.
    stable : (h, w, channel) float32
        The same estimate [units of noise].
    raw : RawImage
        Raw image whose tile has 1, 2 or 4 pixels a side. Its saturated samples aren't used.
    """
    names = raw.channels
    guide = next((names.index(name) for name in GUIDES if name in names), None)
    colours = [c for c in range(len(names)) if c != guide]
    if guide is None or not colours:
        return
    sites = channel_map(raw.cfa, raw.shape)[..., None] == np.array(names)
    sites &= ~raw.saturated[..., None]
    laws = [raw.noise_of(name) for name in names]
    shot, dark = (
        np.array(values, np.float32) for values in zip(*((x.shot, x.dark_noise_e**2) for x in laws), strict=True)
    )

    def variance_of(light: Singles) -> Singles:
        return np.asarray(shot * light + dark + (np.float32(raw.prnu) * light) ** 2)

    residuals = np.where(sites, raw.electrons.astype(np.float32)[..., None] - planes, np.float32(0))
    of_cell, n, r = _sums(np.ones(raw.shape, np.float32))[..., None], _sums(sites), _sums(residuals)
    light, x = _sums(planes), _sums(stable)
    # Where residuals spread more than noise makes them, there is no even surface.
    spread = _sums(residuals * residuals) - r**2 / np.maximum(n, 1.0)
    of_light = variance_of(np.maximum(light / of_cell, 0.0))
    surface = np.all(spread < LAMP_SIGMAS**2 * of_light, axis=-1, keepdims=True)
    n *= surface

    # Shares are added only to estimates above 0: their sums over a cell, and over its samples.
    positive = np.maximum(planes, np.float32(0))
    raised, raised_at_sites = _sums(positive), _sums(np.where(sites, positive, np.float32(0)))
    factor = np.ones_like(light)
    for together in TOGETHER_CELLS:
        pixels, count = _sums(of_cell, together), _sums(n, together)
        wide_x, wide_light = _sums(x, together) / pixels, np.maximum(_sums(light, together) / pixels, 0.0)
        sums = [_sums(r * surface, together), count, count * variance_of(wide_light)]
        share = _biases(wide_x, sums, wide_light, guide, colours) / (wide_light + _LEAST)
        share = _to_cells(share, wide_x, x / of_cell, together) * surface
        if together > 1:
            light += share * factor * raised
            r -= share * factor * raised_at_sites
            factor *= 1 + share
    for c in colours:
        wider = np.repeat(np.repeat(factor[..., c], CELL, axis=0), CELL, axis=1)
        added = wider * (1 + _to_pixels(_to_pixels(share[..., c]).T).T) - 1
        planes[..., c] += added[: raw.shape[0], : raw.shape[1]] * positive[..., c]


def _to_pixels(cells: Singles) -> Singles:
    """Interpolate rows of cells to rows of pixels; a pixel gets the mean over the 2 `CELL` - 1 pixels around it."""
    wide = np.pad(cells, ((1, 1), (0, 0)), mode="edge")
    side = 2 * CELL - 1
    place = np.arange(CELL, dtype=np.float32)[:, None] / side
    before, own, after = wide[:-2, None], wide[1:-1, None], wide[2:, None]
    pixels = own * np.float32(CELL / side) + before * (np.float32(1 - CELL / side) - place) + after * place
    return np.asarray(pixels.reshape(-1, cells.shape[1]))


def _to_cells(share: Singles, wide: Singles, x: Singles, together: int) -> Singles:
    """Interpolate the shares of wider cells to cells, weighted by how alike the cells are in x.

    The interpolation is linear between the centres of the wider cells, each of which is `together` x `together` cells
    with the mean `wide` of x. A cell that is like none of the wider ones around it, such as a cell beside an edge, gets
    next to nothing.
    """
    if together == 1:
        return share
    height, width = x.shape[:2]
    around = [np.pad(values, ((1, 1), (1, 1), (0, 0)), mode="edge") for values in (share, wide)]
    total, weights = np.zeros_like(x), np.zeros_like(x[..., :1])
    place = (np.arange(max(height, width)) % together + 0.5) / together - 0.5  # within a wide cell, from its centre
    for dy, dx in np.ndindex(3, 3):
        rows, columns = (
            np.repeat(np.arange(step, step + count), together)[:length]
            for step, count, length in ((dy, share.shape[0], height), (dx, share.shape[1], width))
        )
        tents = (
            np.maximum(0.0, 1.0 - np.abs(place[:length] - (step - 1))).astype(np.float32)
            for step, length in ((dy, height), (dx, width))
        )
        share_there, x_there = (values[np.ix_(rows, columns)] for values in around)
        difference = x_there - x
        alike = np.exp(np.vecdot(difference, difference) * np.float32(-0.5 / ALIKE**2))
        w = (np.outer(*tents) * alike)[..., None]
        total += w * share_there
        weights += w
    return np.asarray(total / np.maximum(weights, LEAST_ALIKE))


def _biases(x: Singles, sums: list[Singles], light: Singles, guide: int, colours: list[int]) -> Singles:
    """Compute `_bias` of all cells in strips of rows; `x` and `sums` are `wide` there without `REACH` cells around."""
    sides = ((REACH, REACH), (REACH, REACH), (0, 0))
    wide = [np.pad(values, sides) for values in (x, *sums)]  # nothing is known beyond the picture
    bias = np.empty_like(light)

    def strip(first: int) -> None:
        rows = slice(first, first + TOGETHER)
        around = [values[first : first + TOGETHER + 2 * REACH] for values in wide]
        bias[rows] = _bias(x[rows], around, light[rows], guide, colours)

    with ThreadPoolExecutor(cpu_count()) as threads:
        list(threads.map(strip, range(0, len(light), TOGETHER)))
    return bias


def _bias(x: Singles, wide: list[Singles], light: Singles, guide: int, colours: list[int]) -> Singles:
    """Return the shrunken d_c of each cell [e-], 0 in the guide.

    Parameters
    ----------
    x : (row, column, channel) float32
        Mean estimate of each cell [units of noise].
    wide : list of arrays
        x, the sums r_c of residuals, the counts n_c, and n_c times the variance of a sample's noise, each with `REACH`
        cells around.
    light : like `x`
        The mean estimate l_c [e-], 0 or more.
    guide, colours : int, and list of int
        Indices of the guide and of the colours among the channels.
    """
    x_wide, *sums_wide = wide
    height, width = x.shape[:2]
    r, n, variance = (np.zeros_like(x) for _ in range(3))
    for dy, dx in np.ndindex(2 * REACH + 1, 2 * REACH + 1):
        window = slice(dy, dy + height), slice(dx, dx + width)
        difference = x_wide[window] - x
        w = np.exp(np.vecdot(difference, difference) * np.float32(-0.5 / ALIKE**2))[..., None]
        for total, values, by in zip((r, n, variance), sums_wide, (w, w, w * w), strict=True):
            np.add(total, by * values[window], out=total)
    n = np.maximum(n, _LEAST)
    b = r / n
    variance = variance / n**2
    # l_c / l_g, where the guide's light is at least its standard deviation
    guide_light = np.maximum(light[..., guide], np.sqrt(variance[..., guide]))[..., None] + _LEAST
    share = light / guide_light
    d = b - share * b[..., guide, None]
    d_variance = variance + share**2 * variance[..., guide, None] + _LEAST
    chi2 = (d[..., colours] ** 2 / d_variance[..., colours]).mean(axis=-1, keepdims=True)
    prior_variance = (np.float32(LIKELY_BIAS) * light) ** 2
    d *= np.maximum(1.0 - SURE / np.maximum(chi2, _LEAST), 0.0) * prior_variance / (prior_variance + d_variance)
    result = np.maximum(d, -light)
    result[..., guide] = 0.0
    return np.asarray(result, np.float32)


def _sums(values: NDArray[Any], side: int = CELL) -> Singles:
    """Sum the values in each square of `side` x `side`; squares at the bottom and the right edge may be cut off."""
    height, width = values.shape[:2]
    filled = np.pad(values, ((0, -height % side), (0, -width % side), *((0, 0),) * (values.ndim - 2)))
    cells = filled.reshape(len(filled) // side, side, filled.shape[1] // side, side, *values.shape[2:])
    return np.asarray(cells.sum(axis=(1, 3), dtype=np.float32))
