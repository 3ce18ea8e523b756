"""Strong edges: one share of light and dark for all channels, from the pixel's own sample.

Each channel's plane is a mean over its own samples, one pixel in four, and its edge falls on another pixel than the
others': a fringe. Yet every pixel was read in some channel, and how far its sample lies between the dark and the light
around tells how far all channels do (docs/decisions/0053-strong-edges.md). Around saturated places a lamp smaller than
the tile has no colour (docs/decisions/0051-unseen-light.md).
"""

from collections.abc import Callable
from itertools import product
from typing import Any, NamedTuple

import numpy as np
import scipy
from numpy.typing import NDArray

from isp.kernel.edges import (
    EVEN,
    FILLS,
    FULL,
    NOISE,
    OFF,
    OVER_SIGMAS,
    REACH,
    RELATIVE,
    SIGMAS,
    TINY_E,
    TOGETHER,
    even_strips,
)
from render.spectrum import Floats
from rodcone.jit import backend
from sensor.cfa import channels, mask
from sensor.raw import RawImage


class Window(NamedTuple):
    """Around each pixel, (h, w, channel)."""

    least: Floats
    step: Floats  # the most less the least
    contrast: Floats  # step over the sum of both
    sigmas: Floats  # step over the noise of a sample in the light
    full: NDArray[np.bool_]


def even_edges(raw: RawImage, planes: NDArray[np.floating], gains: Floats, alpha: Floats) -> NDArray[np.float32]:
    """Give all channels one share of light and dark at strong edges.

    With l and h the least and the most of a channel f up to 2 pixels away along either axis, its contrast
    c = (h - l) / (h + l), and e the pixel's own sample, of channel o,

        t = (e - l_o) / (h_o - l_o), within 0 and 1;    f' = l + t (h - l).

    A sample within its noise of its plane stands on it. Where o is full nearby, or its contrast small beside the
    others', the four neighbours' t stand for it, rather along the axis on which they are alike. A channel moves as far
    as its h - l is over the noise of a sample, where the colours rise together, as between red and green they don't,
    and where samples around lie off their planes: where they don't, no edge was missed.

    In rims, 0 < alpha < 1, W is full nearby. With q the most that all pixels of some 2 x 2 in the window hold, a lamp
    fills 2 x 2 pixels as far as (q - l) / (h - l), the least of the colours', goes from 0.25 to 0.5. So far it has an
    edge, of the pixel's share where no colour is full, else of the colours' mean (f - l) / (h - l), by c^2. As far as
    it doesn't, its pixels stay where they are and have no colour, but the mean of the balanced ones, over the dark
    around: by v^2, the largest v = (f - l - 2 sqrt(f + s^2)) / (f + l), where s is the dark noise. A colour that is
    full isn't lowered by an edge.

    Parameters
    ----------
    planes : (h, w, 4) float
        R, G, B and W of `isp.interleaved.reconstruct` [e-].
    gains : (4,) float64
        White balance.
    alpha : (h, w) float64
        Of `isp.similarity.guide.saturated_fraction`.

    Returns
    -------
    (h, w, 4) float32
    """
    if backend() != "numpy":
        return even_strips(raw, np.ascontiguousarray(planes, dtype=np.float32), gains, alpha)
    return _even_edges(raw, planes.astype(np.float64), gains, alpha).astype(np.float32)


def _even_edges(raw: RawImage, planes: Floats, gains: Floats, alpha: Floats) -> Floats:
    """In double precision; `isp.kernel.edges` is the same in single."""
    window = _window(raw, planes)
    share, known = _shares(raw, planes, window)

    # Each channel as far as it counts.
    light, colours = planes[..., :3] @ gains[:3], window.step[..., :3] @ gains[:3]
    brightest, darkest = _around(scipy.ndimage.maximum_filter, light), _around(scipy.ndimage.minimum_filter, light)
    together = _ramp((brightest - darkest) / colours, TOGETHER)
    rims = (alpha > 0.0) & (alpha < 1.0)
    evened = window.least + share[..., None] * window.step
    _hold(evened, planes, window)
    result = planes + (known * together)[..., None] * _ramp(window.sigmas, SIGMAS) * (evened - planes)
    result[rims] = _rims(raw, planes, window, share, known, gains, together)[rims]
    return np.asarray(result)


def _ramp(values: Floats, limits: tuple[float, float]) -> Floats:
    """0 up to the first limit, 1 from the second on."""
    return np.clip((values - limits[0]) / (limits[1] - limits[0]), 0.0, 1.0)


def _around(extreme: Callable[..., Any], values: Floats) -> Floats:
    """Least or most of the window around each pixel, which goes on by reflection beyond the border."""
    return np.asarray(extreme(values, size=2 * REACH + 1, axes=(0, 1), mode="mirror"))


def _window(raw: RawImage, planes: Floats) -> Window:
    least, most = (_around(extreme, planes) for extreme in (scipy.ndimage.minimum_filter, scipy.ndimage.maximum_filter))
    step = np.maximum(most - least, TINY_E)
    return Window(
        least=least,
        step=step,
        contrast=step / np.maximum(most + least, TINY_E),
        sigmas=step / np.sqrt(np.maximum(most, 0.0) + raw.dark_noise_e**2),
        full=most >= FULL * raw.saturation_e,
    )


def _shares(raw: RawImage, planes: Floats, window: Window) -> tuple[Floats, Floats]:
    """Share t of each pixel, and how far it is known and needed, (h, w)."""
    # By the pixel's own channel; its step is 0 where it is full.
    site = np.argmax([mask(raw.cfa, name, raw.shape) for name in channels(raw.cfa)], axis=0)[..., None]
    steps, contrast = (np.where(window.full, 0.0, part) for part in (window.step, window.contrast))
    value, least, step = (np.take_along_axis(part, site, 2)[..., 0] for part in (planes, window.least, steps))
    away = raw.electrons - value
    away = away * _ramp(np.abs(away) / np.sqrt(np.maximum(value, 0.0) + raw.dark_noise_e**2), NOISE)
    trust = _ramp(step / np.sqrt(np.maximum(least + step, 0.0) + raw.dark_noise_e**2), SIGMAS)
    own_contrast = step / np.maximum(2.0 * least + step, TINY_E)
    trust *= _ramp(own_contrast / np.maximum(contrast.max(axis=2), TINY_E), RELATIVE)
    share = np.clip((value + away - least) / np.maximum(step, TINY_E), 0.0, 1.0)
    off = np.where(step > 0.0, np.minimum(np.abs(away) / np.maximum(step, TINY_E), 1.0), 0.0)

    # By the neighbours: each axis counts by the other's difference.
    shares, trusts, offs = (np.pad(part, 1, mode="reflect") for part in (share, trust, off))
    at = slice(1, -1)
    across, along = ((at, slice(0, -2)), (at, slice(2, None))), ((slice(0, -2), at), (slice(2, None), at))
    sums, count, trusted = np.zeros((3, *share.shape))
    for axis, other in ((across, along), (along, across)):
        even = (shares[other[0]] - shares[other[1]]) ** 2 + EVEN
        for side in axis:
            sums += even * trusts[side] * shares[side]
            count += even * trusts[side]
            trusted += trusts[side]
    known = trust + (1.0 - trust) * np.minimum(trusted, 1.0)

    # Where no sample around lies off its plane no edge was missed.
    missed = _ramp(np.sqrt(_moved(np.add, offs**2, 3) / 9.0), OFF)
    return trust * share + (1.0 - trust) * sums / np.maximum(count, TINY_E), known * missed


def _moved(combine: np.ufunc, values: Floats, size: int) -> Floats:
    """Sum, least or most of each square of `size` pixels a side that lies in an array."""
    height, width = (length - size + 1 for length in values.shape[:2])
    return np.asarray(
        combine.reduce([values[i : i + height, j : j + width] for i, j in product(range(size), repeat=2)])
    )


def _rims(
    raw: RawImage, planes: Floats, window: Window, share: Floats, known: Floats, gains: Floats, together: Floats
) -> Floats:
    """Channels of `even_edges` in rims, (h, w, channel), computed everywhere."""
    least, step, colours, full = window.least[..., :3], window.step[..., :3], planes[..., :3], window.full[..., :3]
    padded = np.pad(colours, ((REACH, REACH), (REACH, REACH), (0, 0)), mode="reflect")
    filled = _moved(np.maximum, _moved(np.minimum, padded, 2), 2 * REACH)
    fills = _ramp(((filled - least) / step).min(axis=2), FILLS)

    # An edge where the lamp is large.
    contrast = window.contrast[..., :3] ** 2
    mean = (contrast * (colours - least) / step).sum(axis=2) / np.maximum(contrast.sum(axis=2), TINY_E)
    large = np.where(full.any(axis=2), 0.0, fills * known)
    evened = window.least + (large * share + (1.0 - large) * mean)[..., None] * window.step
    _hold(evened, planes, window)

    moved = planes + (fills * together)[..., None] * _ramp(window.sigmas, SIGMAS) * (evened - planes)

    # No colour where it is smaller than 2 x 2 pixels.
    light = moved[..., :3]
    noise = OVER_SIGMAS * np.sqrt(np.maximum(light, 0.0) + raw.dark_noise_e**2)
    over = ((light - least - noise) / np.maximum(light + least, TINY_E)).max(axis=2)
    grey = (light @ gains[:3] / 3.0)[..., None] / gains
    colourless = (1.0 - fills) * together * np.clip(over, 0.0, 1.0) ** 2
    return np.asarray(moved + colourless[..., None] * (grey - moved))


def _hold(evened: Floats, planes: Floats, window: Window) -> None:
    """Lower no colour, in place, that is full nearby."""
    np.maximum(evened[..., :3], planes[..., :3], out=evened[..., :3], where=window.full[..., :3])
