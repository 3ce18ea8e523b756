"""Sharp edges and lamps smaller than the tile, by the best linear estimate from the nine samples around each pixel.

Each channel's plane is a mean over its own samples, one pixel in four, so that its edge falls on another pixel than the
edges of the others and a coloured fringe appears. Yet every pixel was read in some channel, and light and shade are
common to all channels (docs/decisions/0053-strong-edges.md).
"""

from typing import Any

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from isp.interleaved.kernel.edges import (
    APART,
    CORRELATION,
    EVEN,
    FAR,
    FEW,
    HIDDEN,
    MISSED,
    NEAR,
    REACH,
    SMALL,
    SPREAD,
    STEP,
    TINY,
    UNKNOWN,
    channel_noise,
    sharpen_frame,
)
from isp.interleaved.panchromatic import at_pixels
from isp.settings import WhiteReading
from isp.strips import strips
from rodcone.jit import backend
from rodcone.types import Floats
from sensor.cfa import mask
from sensor.raw import RawImage

STRIP_ROWS = 32  # rows that are computed together, with 2 kB per pixel


def sharpen(
    white: WhiteReading, planes: NDArray[np.floating], gains: Floats, noise_gain: NDArray[np.floating]
) -> NDArray[np.float32]:
    """Estimate every channel at each pixel from the nine samples around it.

    Let P be the channels' planes, m and C their mean and covariance over a window of 5 x 5 pixels, s the dark noise,
    and N = m + s^2 the variance of a sample's noise. The contrast of the window is

        e = sum_c C_cc / N_c / (1 + sum_c m_c^2 / N_c).

    The variance of light is assumed to be 2.5 times that of the planes, because these are means, and 0.7 of it to be
    shading of the mean colour: C' = 0.75 C + 1.75 e m m^T. At pixels that are r pixels apart, light is correlated by
    exp(-r^2 / 2). Let S_y be the nine samples, of channels o_y, at distances r_y from the pixel. The best linear
    estimate of the channels is

        E_c = m_c + sum_yz C'(c, o_y) exp(-r_y^2 / 2) [C'(o_y, o_z) exp(-r_yz^2 / 2) + N_y delta_yz]^-1 (S_z - m_o_z),

    where N_y = P(o_y, y) + s^2 is the noise variance of a sample on its plane; full samples don't count. Let chi^2 be
    the mean of the samples' squared distances from their planes over N_y, and chi_0^2 this mean with the weights
    exp(-2 r_y^2). If contrast is that of a lamp and the samples lie on their planes, the estimate counts less:

        F = P + max(0, 1 - e^4 / (1 + chi_0^2)) (E - P).

    Before this, if E_W is brighter or darker than all P_W of the window, by d, then d m / (m_W max(1, chi^2)) is
    subtracted from E, because otherwise noise would make dark pixels beside bright things. Here m_W counts as at least
    (nu_W N_W)^(1/2). A colour that noise hides is replaced by that of the surroundings,

        F_c -= min(1, 7 / (X max(1, X' / 3.5))) (A_c - r_c A_W),    X = sum_c <D_c^2> / (nu_c N_c),

        X' = sum_c <D_c^2>' / (nu_c N_c),    A = P + max(0, 1 - e) (F - P),

    where 1 / nu_c is the frame's mean of 1 / noise gain, <> the mean over the window, and D_c = P_c - r_c P_W. r_c is
    the ratio of channel c to W (at least (nu_W N_W)^(1/2)) in a weighted mean of the planes at 5 x 5 places that are 12
    pixels apart. The more a place resembles m, the larger is its weight; where it differs by one sample's noise in one
    channel, the weight is exp(-1/2). A lamp therefore hardly counts. <>' is the mean of the places by these weights. On
    an even surface X' is about 3.5 by noise alone; where like places differ in colour, less is hidden.

    In three cases the colour of light isn't known:

    - Light fills less than half of a window that is otherwise black, so that e > 1, and its planes miss the samples
      (chi^2), or it lies between the samples of a channel (l). With the mean n of P_W over the nine pixels, and the
      least mean b of P_W over one of the four lattices of every second pixel in the window, l = (n - 1.5 b) / m_W.
    - One of the nine samples of a channel is full. The light of this channel isn't known: q_c = 1.
    - One of the nine samples is full. Any hue is unknown as far as there is contrast: q = min(1, e) if the sample is a
      colour's, and q = min(1, e^4) if only W is full.

    Channels, balanced by the gains g, are then raised to the brightest one:

        F'_c = F_c + max((1 - 1 / e^2) min(1, max(chi^2 / 30, l)), q, q_c) (max_d g_d F_d / g_c - F_c).

    If light fills less than two fifths of the window, so that e > 1.5, and a plane averages only few samples of it, it
    is estimated from the pixel's own sample S of channel o, in the colour around. That colour is the shares u of the
    surroundings (`.panchromatic`), or a neutral's if S and a colour sample beside it are full. With v = S / u_o, its
    noise variance N_v, and the largest noise gain G of a channel,

        F''_c = F'_c + min(1, 4 G) (1 - 1 / (1 + (e / 1.5)^4)) (L_c - F'_c),

        L_c = u_c (P_W + max(0, 1 - 9 N_v / (v - P_W)^2) (v - P_W)).

    A wall beside a window has contrast too, but its planes average many samples, so that G is small.

    Of grey lines two pixels apart, the planes show a colour. As far as such lines are certain, by the weight p of
    `.panchromatic`, the result is L: F'''_c = F''_c + p (L_c - F''_c).

    Parameters
    ----------
    white : WhiteReading
        The frame, the shares u, and the weight p.
    planes : (h, w, 4) float
        R, G, B and W of `isp.interleaved.reconstruction.reconstruct` [e-].
    gains : (4,) float64
        White balance.
    noise_gain : (h, w, 4) float
        Noise gain of `isp.interleaved.reconstruction.reconstruct_with_noise`.

    Returns
    -------
    (h, w, 4) float32
        R, G, B and W, F''' [e-].
    """
    raw = white.raw
    nu = 1.0 / (1.0 / np.maximum(noise_gain, TINY)).mean(axis=0).mean(axis=0)
    if backend() != "numpy":
        single = [np.ascontiguousarray(values, dtype=np.float32) for values in (planes, noise_gain)]
        return sharpen_frame(white, single[0], single[1], np.stack([gains, nu]))
    border = (FAR, FAR), (FAR, FAR)
    site = np.argmax([mask(raw.cfa, name, raw.shape) for name in raw.channels], axis=0)
    padded = np.pad(planes.astype(np.float64), (*border, (0, 0)), mode="reflect")
    electrons, sites = (np.pad(values, border, mode="reflect") for values in (raw.electrons, site))
    parts = list[Floats]()
    of_tiles = np.concatenate([white.shares, white.lines[..., None]], axis=2)
    tiles = at_pixels(of_tiles, raw).astype(np.float64)
    for own in strips(raw.shape[0], STRIP_ROWS):
        rows = slice(own.start, own.stop + 2 * FAR)
        around = padded[rows], electrons[rows], sites[rows]
        parts.append(_sharpen(raw, gains, nu, tiles[own], noise_gain[own], *around))
    return np.concatenate(parts).astype(np.float32)


def _sharpen(
    raw: RawImage,
    gains: Floats,
    nu: Floats,
    tiles: Floats,
    noise_gain: NDArray[np.floating],
    planes: Floats,
    *samples: NDArray[Any],
) -> Floats:
    """Sharpen in double precision (`.kernel.edges` uses single); planes and samples reach `FAR` pixels further.

    `tiles` holds u and p.
    """
    far = sliding_window_view(planes, (2 * FAR + 1,) * 2, axis=(0, 1))[..., ::STEP, ::STEP]
    middle = slice(FAR - REACH, REACH - FAR)
    planes, electrons, sites = (values[middle, middle] for values in (planes, *samples))
    window = sliding_window_view(planes, (2 * REACH + 1,) * 2, axis=(0, 1))
    shot, dark, full_e = channel_noise(raw)
    height, width = window.shape[:2]
    inner = slice(REACH - 1, 1 - REACH)
    sample = sliding_window_view(electrons[inner, inner], (3, 3)).reshape(height, width, 9)
    site = sliding_window_view(sites[inner, inner], (3, 3)).reshape(height, width, 9)
    plane = window[..., REACH, REACH]
    near = window[..., inner, inner].reshape(height, width, 4, 9)

    # What the window holds: m, C, N, e (contrast), r (tint), <D^2> (apart), and the share that noise hides.
    mean = window.mean(axis=(3, 4))
    away = window - mean[..., None, None]
    covariance = np.einsum("...cij,...dij->...cd", away, away) / away[0, 0, 0].size
    light = np.maximum(mean, 0.0)
    noise = np.maximum(shot * light + dark, TINY)
    variance = np.einsum("...cc->...c", covariance)
    contrast = (variance / noise).sum(axis=2, keepdims=True) / (1.0 + (light**2 / noise).sum(axis=2, keepdims=True))

    def in_noise(values: Floats) -> Floats:
        return np.asarray(2.0 / shot * np.sqrt(shot * np.maximum(values, 0.0) + dark))

    beside = np.moveaxis(far, 2, -1)  # (h, w, 5, 5, channel)
    alike = np.exp(-0.5 * ((in_noise(beside) - in_noise(mean)[:, :, None, None]) ** 2).sum(axis=-1))
    around = (alike[..., None] * beside).sum(axis=(2, 3))
    faint = np.maximum(alike.sum(axis=(2, 3)) * np.sqrt(nu[3] * noise[..., 3]), TINY)
    tint = np.maximum(around, 0.0) / np.maximum(around[..., 3], faint)[..., None]
    tint[..., 3] = 1.0
    apart = variance + tint * (tint * variance[..., 3:] - 2.0 * covariance[..., 3]) + (mean - tint * mean[..., 3:]) ** 2
    differences = (alike[..., None] * (beside - tint[:, :, None, None] * beside[..., 3:]) ** 2).sum(axis=(2, 3))
    differences /= np.maximum(alike.sum(axis=(2, 3)), TINY)[..., None]
    coloured = np.maximum((differences / (nu * noise)).sum(axis=2, keepdims=True) / EVEN, 1.0)
    hidden = HIDDEN / np.maximum(coloured * (apart / (nu * noise)).sum(axis=2, keepdims=True), HIDDEN)
    shading = contrast[..., None] * light[..., :, None] * light[..., None, :]
    covariance = SPREAD[0] * covariance + SPREAD[1] * shading

    # The best linear estimate E.
    value = np.take_along_axis(near, site[..., None, :], axis=2)[:, :, 0]
    to_samples = np.take_along_axis(covariance, site[..., None, :], axis=3)  # (h, w, channel, sample)
    among_samples = np.take_along_axis(to_samples, site[..., None], axis=2)  # (h, w, sample, sample)
    sample_noise = np.maximum(shot[site] * np.maximum(value, 0.0) + dark[site], TINY)
    is_full = sample >= full_e[site]
    counted = np.where(is_full, UNKNOWN, sample_noise)
    residual = sample - np.take_along_axis(mean, site, axis=2)
    weights = np.linalg.solve(CORRELATION * among_samples + counted[..., None] * np.eye(9), residual[..., None])
    estimate = mean + ((CORRELATION[4] * to_samples) @ weights)[..., 0]

    # If E_W is brighter or darker than all P_W of the window, by d, keep this only as far as it isn't noise.
    squares = (sample - value) ** 2 / sample_noise
    of_white = window[:, :, 3]
    within = np.clip(estimate[..., 3], of_white.min(axis=(2, 3)), of_white.max(axis=(2, 3)))
    beyond = (within - estimate[..., 3]) / np.maximum(squares.mean(axis=2), 1.0)
    seen = np.maximum(light[..., 3], np.sqrt(nu[3] * noise[..., 3]))
    estimate = estimate + (beyond / seen)[..., None] * light

    # F: the estimate counts less if contrast is that of a lamp and the samples lie on their planes.
    sharp = plane + np.maximum(1.0 - contrast**4 / (1.0 + squares @ NEAR[:, None]), 0.0) * (estimate - plane)

    # F_c minus A_c - r_c A_W: a colour that noise hides is replaced by that of the surroundings.
    even = plane + np.maximum(1.0 - contrast, 0.0) * (sharp - plane)
    sharp -= hidden * (even - tint * even[..., 3:])

    # F': light of unknown colour; `hue` is q or the first case, q_c is 1 where `full`, and l is `between`.
    full = (is_full[..., None] & (site[..., None] == np.arange(4))).any(axis=2)
    lit = np.maximum(of_white, 0.0)
    least = np.min([lit[..., i::2, j::2].mean(axis=(2, 3)) for i in (0, 1) for j in (0, 1)], axis=0)
    between = (lit[..., 1:-1, 1:-1].mean(axis=(2, 3)) - 1.5 * least) / np.maximum(light[..., 3], TINY)
    missed = np.minimum(np.maximum(squares.mean(axis=2) / MISSED, between), 1.0)[..., None]
    lamp = (1.0 - 1.0 / np.maximum(contrast, 1.0) ** 2) * missed
    black = np.minimum(contrast, 1.0)
    hue = np.where(full[..., :3].any(axis=2, keepdims=True), black, np.where(full[..., 3:], black**4, lamp))
    unknown = np.where(full, 1.0, hue)
    sharp += unknown * ((sharp * gains).max(axis=2, keepdims=True) / gains - sharp)

    # F'': light that fills less than two fifths of the window, from the pixel's own sample; L is `small`.
    no_hue = is_full[..., 4] & (is_full & (site != 3)).any(axis=2)
    shares = np.where(no_hue[..., None], gains[3] / gains, tiles[..., :4])
    own = np.take_along_axis(shares, site[..., 4:5], axis=2)[..., 0]
    of_w, here = plane[..., 3], site[..., 4]
    as_white_noise = np.maximum((shot[here] * np.maximum(of_w, 0.0) + dark[here] / own) / own, TINY)
    difference = sample[..., 4] / own - of_w
    seen = np.maximum(1.0 - APART * as_white_noise / np.maximum(difference**2, TINY), 0.0)
    small = (of_w + seen * difference)[..., None] * shares
    few = np.minimum(FEW * noise_gain.max(axis=2, keepdims=True), 1.0)
    sharp += few * (1.0 - 1.0 / (1.0 + (contrast / SMALL) ** 4)) * (small - sharp)
    return np.asarray(sharp + tiles[..., 4:] * (small - sharp))
