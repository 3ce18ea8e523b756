"""Colours between their samples: each follows the mosaic's sharpest channel as linearly as its samples do around it.

After residual interpolation (D. Kiku, Y. Monno, M. Tanaka, M. Okutomi, IEEE Trans. Image Process. 25(3), 2016): over
3x3 samples of a colour c a line explains it by the guide g, and what is interpolated is what the line leaves,

    c = b + a g,   a = cov(c, g) / var(g),   b and a between samples the means of the nearest two or four.

The prior takes strong colours for greyer than they are, and doesn't know where. So its estimate p is held against c by
what each misses: (p - c)^2, and e, what b misses between samples, more where g is farther from its mean than at the
samples; both averaged over 3x3 samples. A pixel gets c + (p - c) e / (e + (p - c)^2).

Where the guide is every other pixel, as Bayer's G, half of its value at a colour's sample is p's; the other half is the
sample and the difference between both, carried along rows and columns from the side that changes the least.

Grey is what the prior knows best, and fine grey stripes are what lines know least: all of this counts by how far the
light around is from grey.
"""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rodcone.types import Singles
from sensor.cfa import Tile, channel_map, channels

GUIDES = ("W", "G")  # the first that a mosaic has
MIN_REL_VARIANCE = 1e-4  # of the guide's squared mean: of variances under this, a is the ratio of the means
MISS_FACTOR = 0.25  # of the squared difference of b from its four neighbours' mean: what b misses between samples
LEAST_MISS = 0.05  # of b between samples, where these say as much as noise [units of noise^2]
OWN_WEIGHT = 0.62  # weight of a sample's own difference, beside that of the next pixel
GREY, COLOURED = 0.04, 0.14  # of R, G or B over their mean: where lines begin to count, and where they count in full
MARGIN_PX = 18  # pixels that a value depends on
TOGETHER = 128  # rows, even: they stay in a core's cache
_LEAST = np.float32(1e-12)  # units of noise^2, to divide by
Phase = tuple[int, int]  # row and column within 2x2 pixels


def blend_with_lines(
    planes: Singles,
    tile: Tile,
    noise: NDArray[np.float64],
    black: Sequence[float],
    balanced: Callable[[Singles], NDArray[np.float64]],
) -> None:
    """Bring the channels that a mosaic samples once in 2x2 pixels to their guide's lines.

    Parameters
    ----------
    planes : (h, w, channel) float32
        In units of noise, channels in the order of `sensor.cfa.channels`; it is overwritten but for the samples.
    tile : tuple of str
        Of 1, 2 or 4 pixels a side. Channels on other sites are left as they are.
    noise : (channel,) float64
        Posterior variance of a pixel over a sample's noise: where it is small, samples say little of lines.
    black : (channel,) sequence of float
        Reading of no light, under which no line goes.
    balanced : callable
        Gives the light of values (..., channel) of `planes`, equal in all channels for a grey.
    """
    names = channels(tile)
    letters = channel_map(tile, (4, 4))
    sites = {name: [(i, j) for i, j in np.ndindex(2, 2) if np.all(letters[i::2, j::2] == name)] for name in names}
    guide = next((name for name in GUIDES if sites.get(name)), None)
    colours = [c for c, name in enumerate(names) if name != guide and len(sites[name]) == 1]
    if guide is None or not colours:
        return
    height, width = planes.shape[:2]
    rows = np.pad(np.arange(height), (MARGIN_PX, MARGIN_PX + height % 2), mode="reflect")
    sides = ((0, 0), (MARGIN_PX, MARGIN_PX + width % 2), (0, 0))
    edge = MARGIN_PX // 2
    before = list[tuple[slice, Singles]]()
    for first in range(0, height, TOGETHER):
        strip = np.pad(planes[rows[first : first + TOGETHER + 2 * MARGIN_PX]], sides, mode="reflect")
        # By row and column within 2x2 pixels: (2, 2, channel, row, column).
        parts = strip.reshape(len(strip) // 2, 2, -1, 2, len(names)).transpose(1, 3, 4, 0, 2).copy()
        lines = parts[:, :, names.index(guide)].copy()
        share = _colourfulness(parts, names, balanced)
        for c in colours if sites[guide] in ([(0, 0), (1, 1)], [(0, 1), (1, 0)]) else ():
            (site,) = sites[names[c]]
            lines[site] = 0.5 * (lines[site] + _guide_at_samples(parts[*site, c], site, lines, sites[guide]))
        for c in colours:
            least = LEAST_MISS / float(noise[c]) ** 2
            _follow(parts[:, :, c], lines, sites[names[c]][0], least, black[c], share)
        inside = parts[..., edge:-edge, edge:-edge].transpose(3, 0, 4, 1, 2)
        # A strip is written when the next one has been read.
        for place, values in before:
            planes[place] = values
        place = slice(first, min(first + TOGETHER, height))
        before = [(place, inside.reshape(2 * len(inside), -1, len(names))[: place.stop - first, :width])]
    planes[before[0][0]] = before[0][1]


def _colourfulness(
    parts: Singles, names: tuple[str, ...], balanced: Callable[[Singles], NDArray[np.float64]]
) -> Singles:
    """0 where the light around is grey, 1 where it is coloured, for cells of 2x2 pixels."""
    around = np.stack([_means(_means(plane)) for plane in parts.mean(axis=(0, 1))], axis=-1)
    light = balanced(around)[..., [c for c, name in enumerate(names) if name != "W"]]
    mean = np.maximum(light.mean(axis=-1), _LEAST)
    most = np.abs(light - mean[..., None]).max(axis=-1) / mean
    return np.asarray(np.clip((most - GREY) / (COLOURED - GREY), 0.0, 1.0), np.float32)


def _follow(plane: Singles, guide: Singles, site: Phase, least: float, black: float, share: Singles) -> None:
    """Overwrite a colour (2, 2, row, column) by `share` at most, but for its samples, those of `site`."""
    others = [phase for phase in np.ndindex(2, 2) if phase != site]
    b, a, middle, variance = _line(plane[site], guide[site])
    around = sum(np.roll(b, step, axis) for step in (1, -1) for axis in (0, 1))
    missed = MISS_FACTOR * _means((b - 0.25 * around) ** 2) + least
    missed *= np.maximum(1.0, _means(np.mean([(guide[phase] - middle) ** 2 for phase in others], axis=0)) / variance)
    lines = [_between(b, site, phase) + _between(a, site, phase) * guide[phase] for phase in others]
    lines = [np.maximum(line, np.float32(black)) for line in lines]
    differences = [plane[phase] - line for phase, line in zip(others, lines, strict=True)]
    squares = _means(np.mean(np.square(differences), axis=0))
    for phase, difference in zip(others, differences, strict=True):
        plane[phase] -= share * (squares / (missed + squares)) * difference


def _guide_at_samples(c: Singles, site: Phase, guide: Singles, besides: list[Phase]) -> Singles:
    """Guide at a colour's samples c, from its samples beside them in a row and in a column."""
    total, weights = np.zeros_like(c), np.zeros_like(c)
    for beside in besides:
        axis = int(beside[0] == site[0])
        step = site[axis] - beside[axis]
        # Guide less colour: at the colour's samples, and at the guide's on either side.
        here = _predict(c, site, guide[beside], beside) - c
        there = guide[beside] - _predict(guide[beside], beside, c, site)
        sides = there, np.roll(there, -step, axis)
        across = np.abs(sides[0] - sides[1])
        for side, towards in zip(sides, (-step, step), strict=True):
            rough = across + np.abs(np.roll(here, -towards, axis) - here)
            weight = 1.0 / (rough**2 + _LEAST)
            total += weight * (OWN_WEIGHT * here + (1.0 - OWN_WEIGHT) * side)
            weights += weight
    return c + total / weights


def _predict(c: Singles, site: Phase, other: Singles, beside: Phase) -> Singles:
    """Another channel at the samples c, from its samples `beside` them."""
    b, a, _, _ = _line(other, _between(c, site, beside))
    return _between(b, beside, site) + _between(a, beside, site) * c


def _line(c: Singles, g: Singles) -> tuple[Singles, Singles, Singles, Singles]:
    """Offset b and slope a of c over g around each sample; mean and variance of g."""
    mean, middle = _means(c), _means(g)
    share = np.float32(1.0 - MIN_REL_VARIANCE)
    variance = _means(g * g) - share * middle * middle + _LEAST
    a = _means((_means(c * g) - share * mean * middle) / variance)
    return c - a * g, a, middle, variance


def _means(values: NDArray[Any]) -> Singles:
    """Over 3x3, 0 in the outermost lines."""
    means = np.zeros_like(values)
    rows = values[:-2] + values[1:-1] + values[2:]
    inside = np.add(rows[:, :-2], rows[:, 1:-1], out=means[1:-1, 1:-1])
    inside += rows[:, 2:]
    inside *= np.float32(1 / 9)
    return means


def _between(values: Singles, site: Phase, phase: Phase) -> Singles:
    """Means of the nearest samples, those of `site`, at the pixels of `phase`; wrong in the outermost lines."""
    for axis in (0, 1):
        if step := phase[axis] - site[axis]:
            values = 0.5 * (values + np.roll(values, -step, axis))
    return values
