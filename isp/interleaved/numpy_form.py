"""The interleaved reconstruction as the paper writes it, in NumPy and double precision.

Parmar & Wandell, "Interleaved imaging", Proc. SPIE 7250, 2009. Channel i at a pixel x is a weighted mean of its samples
g_i(y) in the neighbourhood Omega of x, where S_i(y) is 1 at the sites of i and 0 elsewhere,

    f_i(x) = (1 / W_y) sum_{y in Omega} G(beta_d, sigma_d) G(beta_s, sigma_s) S_i(y) g_i(y),        (1)
    G(beta, sigma) = exp(-beta^2 / (2 sigma^2)),                                                    (2)
    W_y = sum_{y in Omega} G(beta_d, sigma_d) G(beta_s, sigma_s) S_i(y),                            (3)
    beta_d = ||x - y||,                                                                             (4)
    beta_s = alpha(y) ||h_i(x) - h_i(y)|| + (1 - alpha(y)) ||h_W(x) - h_W(y)||,                     (5)

where h_i(x) is the patch around x in channel i's filled plane, and alpha comes from eq. (6)
(`isp.interleaved.saturation`). If one guide serves all channels, h is that guide's patch, and alpha is 0.

This form is slow and plain. The kernel is tested against it, and it runs where Dr.Jit can't.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from isp.interleaved.brightest import brightest_allowed
from isp.interleaved.saturation import saturated_fraction
from isp.planes import fill
from isp.settings import PAPER, Reconstruction, Settings
from rodcone.types import Mosaic, Plane
from sensor.cfa import mask
from sensor.raw import RawImage

LEFT_OUT = -1e28  # log weight of a sample that doesn't count; it is finite, because the first sample may be such a one


@dataclass(frozen=True)
class _Inputs:
    """Arrays that eqs. (1)-(6) read."""

    electrons: Mosaic  # g_i(y) of the channel i that is sampled at y
    channel: NDArray[np.intp]  # that channel's number: where it is i, S_i(y) is 1
    h: Plane  # planes that patches are read from, padded by half a patch: one per channel, or one guide for all
    alpha: Plane  # alpha(y) of eq. (6)
    brightest: Plane  # electrons up to which a sample counts (`isp.interleaved.brightest`)
    white: int  # number of h_W among the planes


@dataclass(frozen=True)
class ReferenceSums:
    """Sums over y for each (x, channel), in units of the largest weight so far."""

    largest: Plane  # logarithm of the largest weight G G so far
    weight: Plane  # sum of G G S_i, W_y of eq. (3)
    square: Plane  # sum of (G G S_i)^2, which is the noise gain once it is divided by W_y^2
    value: Plane  # sum of G G S_i g_i, of eq. (1)


def reference_with_noise(
    raw: RawImage, settings: Settings = PAPER, guide: NDArray[Any] | None = None
) -> Reconstruction:
    """Reconstruct every channel at every pixel in float64: estimate and noise gain.

    Parameters
    ----------
    guide : (h, w) float64, optional
        The plane from which all patches are read, as `isp.interleaved.panchromatic.read_as_white` returns it. If it is
        left out, the paper's method applies: each channel has its own plane, eq. (6) mixes it with that of W, and
        distances are in electrons.

    Raises
    ------
    InputError
        If Omega may miss a channel of the tile.
    """
    settings.check_reaches(raw.cfa)
    sums = sum_weights(raw, settings, guide)
    return Reconstruction(sums.value / sums.weight, sums.square / sums.weight**2, "numpy")


def sum_weights(raw: RawImage, settings: Settings, guide: NDArray[Any] | None = None) -> ReferenceSums:
    """Compute the sums of eqs. (1) and (3) in float64, one offset y - x of the neighbourhood after the other."""
    inputs = _inputs(raw, settings, guide)
    shape = (*raw.shape, len(raw.channels))
    sums = ReferenceSums(np.full(shape, -np.inf), np.zeros(shape), np.zeros(shape), np.zeros(shape))
    reach = range(-settings.reach, settings.reach + 1)
    for row in (d for d in reach if abs(d) < raw.shape[0]):
        for column in (d for d in reach if abs(d) < raw.shape[1]):
            _add_offset(sums, inputs, settings, (row, column))
    return sums


def _inputs(raw: RawImage, settings: Settings, guide: NDArray[Any] | None) -> _Inputs:
    names = raw.channels
    half = settings.patch // 2
    planes = [fill(raw.electrons, raw.cfa, name) for name in names] if guide is None else [guide]
    return _Inputs(
        electrons=raw.electrons,
        channel=np.argmax([mask(raw.cfa, name, raw.shape) for name in names], axis=0),
        h=np.pad(np.stack(planes), ((0, 0), (half, half), (half, half)), mode="reflect"),
        alpha=saturated_fraction(raw, settings.patch) if guide is None else np.zeros(raw.shape),
        brightest=brightest_allowed(raw.electrons, raw, settings),
        white=names.index("W") if guide is None and "W" in names else 0,
    )


def _add_offset(sums: ReferenceSums, inputs: _Inputs, settings: Settings, offset: tuple[int, int]) -> None:
    """Add y = x + offset to the sums of each x whose y lies in the frame."""
    shape = inputs.electrons.shape
    x = tuple(np.arange(max(-d, 0), size - max(d, 0)) for d, size in zip(offset, shape, strict=True))
    y = tuple(line + d for line, d in zip(x, offset, strict=True))
    distance2 = [_squared_distance(h_i, settings, x, offset) for h_i in inputs.h]
    beta_d2 = offset[0] ** 2 + offset[1] ** 2  # eq. (4)
    log_spatial = -beta_d2 / (2.0 * settings.sigma_d**2)  # eq. (2)
    phase = tuple(d % size for d, size in zip(offset, inputs.brightest.shape[:2], strict=True))
    bound = inputs.brightest[phase][np.ix_(*x)]
    channel, alpha, electrons = (a[np.ix_(*y)] for a in (inputs.channel, inputs.alpha, inputs.electrons))
    for i in range(sums.weight.shape[2]):
        at = np.nonzero(channel == i)  # S_i(y) of eq. (1)
        own = distance2[min(i, len(distance2) - 1)][at]
        beta_s = alpha[at] * np.sqrt(own) + (1.0 - alpha[at]) * np.sqrt(distance2[inputs.white][at])  # eq. (5)
        log_weight = log_spatial - beta_s**2 / (2.0 * settings.sigma_s**2)  # eq. (2)
        log_weight[electrons[at] > bound[at]] = LEFT_OUT
        _accumulate(sums, (x[0][at[0]], x[1][at[1]], np.full(at[0].shape, i)), log_weight, electrons[at])


def _squared_distance(h: Plane, settings: Settings, x: tuple[NDArray[np.intp], ...], offset: tuple[int, int]) -> Plane:
    """Return ||h_i(x) - h_i(x + offset)||^2 for a grid of x."""
    half = settings.patch // 2
    # The patch around (r, c) of the frame is [r, r + patch) x [c, c + patch) of the padded plane.
    grown = [np.arange(line[0], line[-1] + 2 * half + 1) for line in x]
    squares = (h[np.ix_(*grown)] - h[np.ix_(grown[0] + offset[0], grown[1] + offset[1])]) ** 2
    for axis in (0, 1):
        squares = scipy.ndimage.convolve1d(squares, np.ones(settings.patch), axis, mode="constant")
    return np.asarray(squares[half : half + len(x[0]), half : half + len(x[1])])


def _accumulate(sums: ReferenceSums, at: tuple[NDArray[np.intp], ...], log_weight: Plane, value: Plane) -> None:
    """Add one weighted sample to the sums of eqs. (1) and (3); the largest weight stays 1, so W_y is never 0."""
    largest = np.maximum(sums.largest[at], log_weight)
    old = np.exp(sums.largest[at] - largest)
    new = np.exp(log_weight - largest)
    sums.value[at] = sums.value[at] * old + new * value
    sums.weight[at] = sums.weight[at] * old + new
    sums.square[at] = sums.square[at] * old**2 + new**2
    sums.largest[at] = largest
