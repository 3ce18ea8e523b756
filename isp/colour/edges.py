"""Strong edges: one share of light and dark for all channels, from the pixel's own sample.

Each channel's plane is a mean over its own samples, one pixel in four, and its edge falls on another pixel than the
others': a fringe. Yet every pixel was read in some channel, and how far its sample lies between the dark and the light
around tells how far all channels do (docs/decisions/0053-strong-edges.md). Around saturated places a lamp smaller than
the tile has no colour (docs/decisions/0051-unseen-light.md).
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from isp.planes import box_sums
from render.spectrum import Floats
from sensor.cfa import channels
from sensor.raw import RawImage

REACH = 2  # pixels of a window to either side; 1 and 3 leave more error
HALO = REACH + 1  # whose neighbours have windows too
BLOCK_PIXELS, LEAST_ROWS = 2**15, 32  # that are computed together
# From the first number on something counts, from the second on fully.
SIGMAS = 3.0, 10.0  # a channel's contrast, in noise of a sample
TOGETHER = 0.5, 0.8  # rise of the light over the colours' together: 1 where they rise alike
RELATIVE = 0.4, 0.7  # contrast of a pixel's own channel, over the largest
NOISE = 2.0, 4.0  # distance of a sample from its plane, in its noise
OFF = 0.05, 0.15  # distance of the samples around from their planes, over the channel's contrast
FULL = 0.9  # of saturation, from which on there may be more light than was read
EVEN = 1e-3  # squared difference of shares that is none
TINY_E = 1e-9  # where nothing differs
Values = NDArray[np.float32]


class Window(NamedTuple):
    """Around each pixel of a block; float32 but for `full`, channels first."""

    values: NDArray[Any]  # the planes themselves
    least: NDArray[Any]
    step: NDArray[Any]  # most - least
    contrast: NDArray[Any]  # step / (most + least)
    sigmas: NDArray[Any]  # step over the noise of a sample in the light
    full: NDArray[Any]


def even_edges(raw: RawImage, planes: Floats, gains: Floats, alpha: Floats) -> None:
    """Give all channels one share of light and dark at strong edges, in place.

    With l and h the least and the most of a channel f up to 2 pixels away along either axis, its contrast
    c = (h - l) / (h + l), and e the pixel's own sample, of channel o,

        t = (e - l_o) / (h_o - l_o), within 0 and 1;    f' = l + t (h - l).

    A sample within its noise of its plane stands on it. Where o is full nearby, or its contrast small beside the
    others', the four neighbours' t stand for it, rather along the axis on which they are alike. A channel moves as far
    as its h - l is over the noise of a sample, where the colours rise together, as between red and green they don't,
    and where samples around lie off their planes: where they don't, no edge was missed.

    In rims, 0 < alpha < 1, W is full nearby. With q the most that all pixels of some 2 x 2 in the window hold, a lamp
    fills 2 x 2 pixels as far as (q - l) / (h - l), the least of the colours', is 1. As far as it doesn't, its pixels'
    samples say little of each other: the share is the mean of the colours' (f - l) / (h - l), by c^2; and over the dark
    around its colour isn't known: it gets the mean of its balanced colours. A colour that is full isn't lowered.

    Parameters
    ----------
    planes : (h, w, channel) float64
        Of `isp.interleaved.reconstruct` [e-].
    gains : (channel,) float64
        White balance.
    alpha : (h, w) float64
        Of `isp.similarity.guide.saturated_fraction`.
    """
    height, width = raw.shape
    names, gains = channels(raw.cfa), gains.astype(np.float32)  # W comes last
    cells = np.array([[names.index(name) for name in line] for line in raw.cfa])
    mirrored, columns = (np.pad(np.arange(length), HALO, mode="reflect") for length in raw.shape)
    count, beyond = max(BLOCK_PIXELS // width, LEAST_ROWS), np.r_[:HALO, width + HALO : width + 2 * HALO]
    before = np.zeros((len(names), 0, width), np.float32)
    for first in range(0, height, count):
        # The planes as they were, mirrored at the borders.
        rows = mirrored[first : first + count + 2 * HALO]
        lowest = int(rows.min())
        lines = np.moveaxis(planes[lowest : rows.max() + 1], 2, 0).astype(np.float32, order="C")
        lines[:, : before.shape[1]] = before
        before = lines[:, count + first - HALO - lowest :][:, :HALO].copy()
        around = np.empty((len(names), rows.size, columns.size), np.float32)
        around[:, :, HALO:-HALO] = lines[:, rows - lowest]
        around[:, :, beyond] = around[:, :, columns[beyond] + HALO]
        window = _window(raw, around)
        if not (window.sigmas[:-1] > SIGMAS[0]).any():
            continue

        # One share for every pixel, from its own sample or the neighbours'.
        inner = slice(REACH, -REACH)
        site = cells[(rows[inner] % len(cells))[:, None], columns[inner] % len(cells[0])]
        samples = raw.dn[rows[inner][:, None], columns[inner]].astype(np.float32)
        samples = (samples - np.float32(raw.black_dn)) * np.float32(raw.gain_e_per_dn)
        share, known = _shares(window, samples, site, raw.dark_noise_e)

        # Each channel as far as it counts.
        window, colours = Window(*(part[:, 1:-1, 1:-1] for part in window)), around[:-1, 1:-1, 1:-1]
        mixed = alpha[first : first + count]
        rims = (mixed > 0.0) & (mixed < 1.0)
        weight = np.where(rims, np.float32(1.0), known) * _together(colours, window.step[:-1], gains[:-1])
        evened = share * window.step
        evened += window.least
        _hold(evened, window)
        if rims.any():
            filled = _moving(np.maximum, _moving(np.minimum, colours, 2), 2 * REACH)[:, rims]
            of_rims = Window(*(part[:, rims] for part in window))
            evened[:, rims] = _evened_rims(of_rims, filled, share[rims], known[rims], gains)
        evened -= window.values
        evened *= _ramp(window.sigmas, SIGMAS)
        evened *= weight
        planes[first : first + count] += np.moveaxis(evened, 0, 2)


def _ramp(values: NDArray[Any], limits: tuple[float, float]) -> NDArray[Any]:
    """0 up to the first limit, 1 from the second on."""
    result = values - np.float32(limits[0])
    result *= np.float32(1.0 / (limits[1] - limits[0]))
    return np.asarray(np.clip(result, 0.0, 1.0, out=result))


def _moving(extreme: np.ufunc, values: Values, size: int) -> Values:
    """Least or most of the windows of `size` pixels a side that lie in an array (channel, h, w)."""
    reach = 1  # pixels of the window so far
    while reach < size:
        step = min(reach, size - reach)
        values = extreme(values[:, :-step], values[:, step:])
        values, reach = extreme(values[:, :, :-step], values[:, :, step:]), reach + step
    return values


def _window(raw: RawImage, around: Values) -> Window:
    """Of every pixel whose window lies in an array (channel, h, w) of the planes."""
    least, most = (_moving(extreme, around, 2 * REACH + 1) for extreme in (np.minimum, np.maximum))
    step = most - least
    np.maximum(step, np.float32(TINY_E), out=step)
    contrast, noise_e = most + least, np.maximum(most, np.float32(0.0))
    np.maximum(contrast, np.float32(TINY_E), out=contrast)
    noise_e += np.float32(raw.dark_noise_e**2)
    np.sqrt(noise_e, out=noise_e)
    return Window(
        values=np.ascontiguousarray(around[:, REACH:-REACH, REACH:-REACH]),
        least=least,
        step=step,
        contrast=np.divide(step, contrast, out=contrast),
        sigmas=np.divide(step, noise_e, out=noise_e),
        full=most >= np.float32(FULL * raw.saturation_e),
    )


def _shares(window: Window, samples: Values, site: NDArray[np.int_], dark_noise_e: float) -> tuple[Values, Values]:
    """Share t of each pixel but the border's, and how far it is known and needed.

    Parameters
    ----------
    samples : (h, w) float32
        [e-].
    site : (h, w) int
        Their channels.
    """
    # By the pixel's own channel; its step is 0 where it is full.
    steps, contrast = window.step, window.contrast
    if window.full.any():
        steps, contrast = (np.where(window.full, np.float32(0.0), part) for part in (steps, contrast))
    places = site * site.size + np.arange(site.size).reshape(site.shape)
    value, least, step = (np.take(part, places) for part in (window.values, window.least, steps))
    noise_e = np.sqrt(np.maximum(value, np.float32(0.0)) + np.float32(dark_noise_e**2))
    samples = value + (samples - value) * _ramp(np.abs(samples - value) / noise_e, NOISE)
    trust = _ramp(step / np.sqrt(np.maximum(least + step, np.float32(0.0)) + np.float32(dark_noise_e**2)), SIGMAS)
    relative = (
        step
        / np.maximum(least + least + step, np.float32(TINY_E))
        / np.maximum(contrast.max(axis=0), np.float32(TINY_E))
    )
    trust *= _ramp(relative, RELATIVE)
    divisor = np.maximum(step, np.float32(TINY_E))
    share = np.clip((samples - least) / divisor, np.float32(0.0), np.float32(1.0))
    off = np.where(step > 0.0, np.minimum(np.abs(samples - value) / divisor, np.float32(1.0)), np.float32(0.0))

    # By the neighbours: each axis counts by the other's difference.
    at = slice(1, -1)
    left, right, above, below = (at, slice(0, -2)), (at, slice(2, None)), (slice(0, -2), at), (slice(2, None), at)
    sums, count, trusted = np.zeros((3, *share[at, at].shape), np.float32)
    for axis, other in (((left, right), (above, below)), ((above, below), (left, right))):
        even = np.square(share[other[0]] - share[other[1]]) + np.float32(EVEN)
        for side in axis:
            sums += even * trust[side] * share[side]
            count += even * trust[side]
            trusted += trust[side]
    own = trust[at, at]
    filled = sums / np.maximum(count, np.float32(TINY_E))
    known = own + (1.0 - own) * np.minimum(trusted, np.float32(1.0))

    # Where no sample around lies off its plane no edge was missed.
    missed = _ramp(np.sqrt(box_sums(np.square(off), (3, 3)) / np.float32(9.0)), OFF)
    return own * share[at, at] + (1.0 - own) * filled, known * missed


def _together(colours: Values, step: Values, gains: NDArray[Any]) -> Values:
    """How far the colours rise together in a window, 0 to 1, shape (h, w)."""
    light = np.tensordot(gains, colours, 1)[None]
    rise = _moving(np.maximum, light, 2 * REACH + 1)[0] - _moving(np.minimum, light, 2 * REACH + 1)[0]
    return np.asarray(_ramp(rise / np.tensordot(gains, step, 1), TOGETHER))


def _hold(evened: Values, window: Window) -> None:
    """Lower no colour, in place, that is full nearby."""
    if window.full[:-1].any():
        np.maximum(evened[:-1], window.values[:-1], out=evened[:-1], where=window.full[:-1])


def _evened_rims(window: Window, filled: Values, share: Values, known: Values, gains: NDArray[Any]) -> Values:
    """Channels of `even_edges` in rims, (channel, pixel); `filled` is q of the colours."""
    least, step, balance = window.least[:-1], window.step[:-1], gains[:, None]
    fills = ((filled - least) / step).min(axis=0)

    # Its own share where the lamp is large, else the colours' mean.
    contrast = np.square(window.contrast[:-1])
    mean = np.sum(contrast * (window.values[:-1] - least) / step, axis=0)
    mean /= np.maximum(contrast.sum(axis=0), np.float32(TINY_E))
    large = np.where(window.full[:-1].any(axis=0), np.float32(0.0), fills * known)
    evened = window.least + (large * share + (1.0 - large) * mean) * window.step
    _hold(evened, window)

    # No colour where it is smaller than 2 x 2 pixels.
    light = evened[:-1]
    over = ((light - least) / np.maximum(light + least, np.float32(TINY_E))).max(axis=0)
    grey = (light * balance[:-1]).mean(axis=0) / balance
    return np.asarray(evened + (1.0 - fills) * np.square(np.clip(over, 0.0, 1.0)) * (grey - evened))
