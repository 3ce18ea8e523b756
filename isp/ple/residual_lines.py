"""Interpolation of a colour between its samples by a local linear function of the mosaic's sharpest channel.

This follows residual interpolation (D. Kiku, Y. Monno, M. Tanaka, M. Okutomi, IEEE Trans. Image Process. 25(3), 2016).
Let c be a colour, g the guide (that channel), and <> the mean over 3x3 samples of c. Then

    a = <cov(c, g) / var(g)>,   b = c - a g                     (1) slope, and residual at each sample
    q = b + a g                                                 (2) prediction at a pixel between samples

In (2), a and b are means over the nearest two or four samples. The prior desaturates strong colours. Its estimate p
is therefore blended with q, each weighted by the other's estimated squared error:

    x = p - k D / (D + E) (p - q),   D = <(p - q)^2>            (3) the error of p, for the most part
    E = <(b - mean of its four neighbours)^2> / 4 + least,      (4) the error of q: what interpolating b misses,
        times max(1, <(g - <g>)^2 between samples> / var(g))        more where g varies more between the samples

Near grey the prior is better than the lines, which fail on fine grey stripes. The blend is therefore scaled by k, 0 in
grey surroundings and 1 in coloured ones.

If the guide has only every other pixel, like Bayer's G, it is first estimated at the colour's own samples. The value
there is the mean of the prior's estimate and of the sample plus the difference g - c. This difference is interpolated
along rows and columns, mostly from the side on which it changes less.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rodcone.types import Singles
from sensor.cfa import Tile, channel_map, channels

GUIDES = ("W", "G")  # the guide is the first of these that a mosaic has
MIN_REL_VARIANCE = 1e-4  # share of <g>^2 that is added to var(g), so that an even guide gives a = <c> / <g>
MISS_FACTOR = 0.25  # eq. (4): the squared error of interpolating b, over b's squared difference from its neighbours
LEAST_MISS = 0.05  # eq. (4): `least`, if a pixel's posterior variance equals a sample's noise [units of noise^2]
OWN_WEIGHT = 0.62  # weight of g - c at a colour's own sample; g - c at the guide's sample beside it has the rest
GREY, COLOURED = 0.04, 0.14  # relative deviation of R, G or B from their mean: k is 0 up to GREY, 1 from COLOURED on
MARGIN_PX = 18  # a result depends on pixels up to this far away
TOGETHER = 128  # rows of a strip, an even number: a strip stays in a core's cache
_LEAST = np.float32(1e-12)  # keeps divisions from 0 [units of noise^2]
Phase = tuple[int, int]  # row and column within 2x2 pixels


@dataclass(frozen=True)
class Line:
    """Line of a colour c over the guide g around each of c's samples, eq. (1)."""

    a: Singles  # slope
    b: Singles  # residual at the sample
    g_mean: Singles  # <g>
    g_variance: Singles  # var(g), with MIN_REL_VARIANCE of <g>^2


def blend_with_lines(
    planes: Singles,
    tile: Tile,
    noise: NDArray[np.float64],
    black: Sequence[float],
    balanced: Callable[[Singles], NDArray[np.float64]],
) -> None:
    """Blend the channels that a mosaic samples once in 2x2 pixels with their lines over the guide, eq. (3).

    Parameters
    ----------
    planes : (h, w, channel) float32
        Estimates [units of noise], channels in the order of `sensor.cfa.channels`. They are overwritten except at the
        samples.
    tile : tuple of str
        Tile of 1, 2 or 4 pixels a side. Channels on other sites than one of 2x2 pixels are left as they are.
    noise : (channel,) float64
        Posterior variance of a pixel over the variance of a sample's noise. Where it is small, single samples say
        little about lines.
    black : (channel,) sequence of float
        Reading without light, which is the lower limit of predictions.
    balanced : callable
        Converts values (..., channel) of `planes` to light, equal in all channels for a grey.
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
        k = _colourfulness(parts, names, balanced)
        for c in colours if sites[guide] in ([(0, 0), (1, 1)], [(0, 1), (1, 0)]) else ():
            (site,) = sites[names[c]]
            lines[site] = 0.5 * (lines[site] + _guide_at_samples(parts[*site, c], site, lines, sites[guide]))
        for c in colours:
            least = LEAST_MISS / float(noise[c]) ** 2
            _blend(parts[:, :, c], lines, sites[names[c]][0], least, black[c], k)
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
    """Return k of eq. (3) for cells of 2x2 pixels: 0 where the light around is grey, 1 where it is coloured."""
    around = np.stack([_means(_means(plane)) for plane in parts.mean(axis=(0, 1))], axis=-1)
    light = balanced(around)[..., [c for c, name in enumerate(names) if name != "W"]]
    mean = np.maximum(light.mean(axis=-1), _LEAST)
    most = np.abs(light - mean[..., None]).max(axis=-1) / mean
    return np.asarray(np.clip((most - GREY) / (COLOURED - GREY), 0.0, 1.0), np.float32)


def _blend(p: Singles, g: Singles, site: Phase, least: float, black: float, k: Singles) -> None:
    """Overwrite a colour's estimate p (2, 2, row, column) by x of eq. (3), except at `site`, where its samples are."""
    others = [phase for phase in np.ndindex(2, 2) if phase != site]
    line = _line(p[site], g[site])
    neighbours = sum(np.roll(line.b, step, axis) for step in (1, -1) for axis in (0, 1))
    # E of eq. (4)
    q_error = MISS_FACTOR * _means((line.b - 0.25 * neighbours) ** 2) + least
    g_spread = _means(np.mean([(g[phase] - line.g_mean) ** 2 for phase in others], axis=0))
    q_error *= np.maximum(1.0, g_spread / line.g_variance)
    # q of eq. (2), and D of eq. (3)
    q = [_between(line.b, site, phase) + _between(line.a, site, phase) * g[phase] for phase in others]
    q = [np.maximum(prediction, np.float32(black)) for prediction in q]
    differences = [p[phase] - prediction for phase, prediction in zip(others, q, strict=True)]
    p_error = _means(np.mean(np.square(differences), axis=0))
    for phase, difference in zip(others, differences, strict=True):
        p[phase] -= k * (p_error / (q_error + p_error)) * difference


def _guide_at_samples(c: Singles, site: Phase, guide: Singles, besides: list[Phase]) -> Singles:
    """Estimate the guide at a colour's samples c, from the guide's samples beside them in a row and in a column.

    `site` and `besides` are the phases of the colour and of the guide within 2x2 pixels.
    """
    total, weights = np.zeros_like(c), np.zeros_like(c)
    for beside in besides:
        axis = int(beside[0] == site[0])
        step = site[axis] - beside[axis]
        # The difference guide minus colour: at the colour's samples, and at the guide's on either side.
        here = _predict(c, site, guide[beside], beside) - c
        there = guide[beside] - _predict(guide[beside], beside, c, site)
        sides = there, np.roll(there, -step, axis)
        across = np.abs(sides[0] - sides[1])
        for side, towards in zip(sides, (-step, step), strict=True):
            change = across + np.abs(np.roll(here, -towards, axis) - here)
            weight = 1.0 / (change**2 + _LEAST)
            total += weight * (OWN_WEIGHT * here + (1.0 - OWN_WEIGHT) * side)
            weights += weight
    return c + total / weights


def _predict(c: Singles, site: Phase, other: Singles, beside: Phase) -> Singles:
    """Predict another channel at the samples c, from its samples `beside` them: eq. (2) with c as the guide."""
    line = _line(other, _between(c, site, beside))
    return _between(line.b, beside, site) + _between(line.a, beside, site) * c


def _line(c: Singles, g: Singles) -> Line:
    """Fit the line of c over g around each sample, eq. (1)."""
    c_mean, g_mean = _means(c), _means(g)
    # With e = MIN_REL_VARIANCE, <g g> - (1 - e) <g>^2 is var(g) + e <g>^2. The covariance gets e <c> <g> likewise.
    share = np.float32(1.0 - MIN_REL_VARIANCE)
    g_variance = _means(g * g) - share * g_mean * g_mean + _LEAST
    a = _means((_means(c * g) - share * c_mean * g_mean) / g_variance)
    return Line(a=a, b=c - a * g, g_mean=g_mean, g_variance=g_variance)


def _means(values: NDArray[Any]) -> Singles:
    """Return the means over 3x3 samples, 0 in the outermost lines."""
    means = np.zeros_like(values)
    rows = values[:-2] + values[1:-1] + values[2:]
    inside = np.add(rows[:, :-2], rows[:, 1:-1], out=means[1:-1, 1:-1])
    inside += rows[:, 2:]
    inside *= np.float32(1 / 9)
    return means


def _between(values: Singles, site: Phase, phase: Phase) -> Singles:
    """Return, at each pixel of `phase`, the mean of the nearest samples of `site`; the outermost lines wrap around."""
    for axis in (0, 1):
        if step := phase[axis] - site[axis]:
            values = 0.5 * (values + np.roll(values, -step, axis))
    return values
