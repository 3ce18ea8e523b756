"""Conversion of every sample to what W would read there, which gives one plane that guides all channels.

A channel's own plane is made of its samples alone, one pixel in four, and its edges fall on other pixels than those of
the other channels. Yet light and shade are common to all channels. Therefore a sample S of channel o is divided by the
ratio r_o of that channel to W around the pixel. The result v = S / r_o is what W would read
(docs/decisions/0057-every-sample-as-w.md). In a mosaic without W, the unit channel (`sensor.cfa.unit_channel`) is used
in its place.
"""

from dataclasses import replace
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from isp.anscombe import stabilise_channel
from isp.interleaved.kernel.edges import TINY, channel_noise
from isp.interleaved.kernel.panchromatic import (
    BELOW,
    DETAIL_PX,
    DIM,
    FAINT,
    LEAST_LIGHT,
    LEAST_SHARE,
    LINE_CONTRAST,
    LINE_ERRORS,
    OTHER_PATTERNS,
    guide_frame,
    line_signs,
    surroundings_steps,
    tent_radii,
    window_steps,
)
from isp.planes import tent
from isp.settings import WhiteReading
from rodcone.jit import backend
from rodcone.types import Floats
from sensor.cfa import mask
from sensor.raw import RawImage


def white_channel(raw: RawImage) -> str:
    """Return the channel that is used as W: W itself, or the mosaic's unit channel."""
    return "W" if "W" in raw.channels else raw.unit_channel


def read_as_white(raw: RawImage, neutral: Floats) -> WhiteReading:
    """Read every sample of a frame as W.

    Let n_c be a neutral's electrons in channel c per electron of W, and s_W the dark noise of W. Let tent be the mean
    over 3 x 3 pixels with the weights [1 2 1] (wider for larger tiles, so that all cells weigh the same), and <>_c the
    mean over channel c's samples in 3 x 3 tiles (7 x 7 tiles of one pixel). A sample S of channel o is divided by the
    light around it, so that a lamp has no more influence than any other pixel:

        x = S / max(tent(S / n_o), 12 s_W),    m_c = <x>_c,    s_c^2 = (<x^2>_c - m_c^2) / samples.

    A thin bright line misses the sites of whole channels. Therefore s_c^2 is increased by e^3 m_c^2 / samples, where e
    is the relative variance of S / n_o in the window. The share m_c / m_W is used as far as it is certain by s_c, and
    for the rest the share q_c = f_c / f_W of the surroundings, where f is the mean of m at 5 x 5 places that are 6
    pixels apart. With a_c = m_c - q_c m_W,

        m_c -= a_c min(1, 1 / chi^2),    chi^2 = sum_c a_c^2 / (s_c^2 + q_c^2 s_W^2).

    Before this, grey lines two pixels apart are subtracted, of which each channel of a 2 x 2 tile samples one phase, so
    that they look like a colour (docs/decisions/0065-lines-in-the-guide.md). With w_c = m_c / q_c, the four channels
    show A = sum_c w_c / 4 and three patterns b_k = sum_c s_k(c) w_c / 4, where s_k is +1 or -1: upright lines, lying
    lines, and a checkerboard. Hardly any real colour shows lines alone, because W sees the light of R, G and B. With
    V = sum_c s_c^2 / (16 q_c^2), the lines k, upright or lying, count by

        p_k = [1 - (b_1^2 + b_2^2 + b_3^2 - b_k^2) / (0.3 b_k^2)] min(1, (|b_k| / A - 0.3) / 0.15) [1 - V / b_k^2],

    where each factor is at least 0, and p_k s_k(c) b_k q_c is subtracted from m_c. V counts as at least 25 times what
    noise alone would make it, so that noise isn't taken for lines.

    Where m_W is below 0.3, light is too faint to show a colour. Therefore a neutral's (0.3 - m_W) n_c is added to m_c,
    and likewise to f_c. The ratio is then r_c = m_c / m_W, but at least 0.02 n_c.

    The guide is a weighted mean of v = S / r_o and of t. At light L, v has the variance
    N = (k_o L + s_o^2 / r_o) / r_o, where k_o is the variance of shot noise per electron, which is 1 in most channels.
    t is the mean of v over the eight samples around, weighted by the tent and by 1 / N, and T is its variance:

        g = t + (D + T) / (D + T + N) (v - t),    D = max(0, <(v - t)^2 / (N + T)> - 1) / <1 / (N + T)>,

    where D is the variance of detail that t misses, and <> the mean over 5 x 5 pixels. Beside a lamp D is large, so
    that g would be v with all its noise. The dark pixels there would then be compared only with those whose noise is as
    negative as their own (docs/decisions/0070-noise-beside-lamps.md). Therefore, if g is below the least t of the 3 x 3
    pixels around, b, this counts as far as it isn't noise, where N is that of the light b:

        g' = g + max(0, 1 - b^2 / (3 N)) min(1, 4 N / (b - g)^2) (b - g).

    The first factor is 0 in good light, where a dark pixel is known by a single sample.

    Parameters
    ----------
    raw : RawImage
    neutral : (channel,) float64
        Response to a neutral in any unit, in the order of `sensor.cfa.channels`.
    """
    white = raw.channels.index(white_channel(raw))
    ratios = np.asarray(neutral, np.float64) / neutral[white]
    raw = with_full_white(raw, ratios)
    if backend() == "numpy":
        shares, guide_e, lines, of_window = _read_numpy(raw, ratios, white)
        return WhiteReading(raw, shares, stabilise_channel(guide_e, raw, raw.channels[white]), lines, of_window)
    return WhiteReading(raw, *guide_frame(raw, ratios, white))


def with_full_white(raw: RawImage, ratios: Floats) -> RawImage:
    """Raise each full sample of W to what W would read if the colour samples around were of a neutral, if that is more.

    Only the colours show how much light there is beyond W's well. With the colour samples S, n of `read_as_white`, and
    a tent t that reaches one pixel less than the tile's side, the value is sum(t S) / sum(t n).
    """
    if not {"W", "G"} <= set(raw.channels):
        return raw
    row, column = np.nonzero(raw.saturated & mask(raw.cfa, "W", raw.shape))
    if not row.size:
        return raw
    reach = max(len(raw.cfa), len(raw.cfa[0])) - 1
    response = np.array(
        [[0.0 if name == "W" else ratios[raw.channels.index(name)] for name in line] for line in raw.cfa]
    )
    rows, columns = (np.pad(np.arange(length), reach, mode="reflect") for length in raw.shape)
    light, share = np.zeros((2, row.size))
    for (i, j), weight in np.ndenumerate(np.outer(tent(reach), tent(reach))):
        y, x = rows[row + i], columns[column + j]
        of_colour = weight * (response[y % len(raw.cfa), x % len(raw.cfa[0])] > 0.0)
        light += of_colour * (raw.dn[y, x] - float(raw.black_dn))
        share += of_colour * response[y % len(raw.cfa), x % len(raw.cfa[0])]
    dn: NDArray[Any] = raw.dn.astype(np.float32)
    dn[row, column] = np.maximum(dn[row, column], light / np.maximum(share, TINY) + raw.black_dn)
    return replace(raw, dn=dn)


def _mean(values: Floats, weights: Floats, across: Floats | None = None) -> Floats:
    """Average around each pixel, down and across, with weights of sum 1; planes are mirrored at the border."""
    lines = scipy.ndimage.correlate1d(values, weights, 0, mode="mirror")
    return np.asarray(scipy.ndimage.correlate1d(lines, weights if across is None else across, 1, mode="mirror"))


def _box(values: Floats, size: int) -> Floats:
    return _mean(values, np.full(size, 1.0 / size))


def _comb(steps: range) -> Floats:
    """Return equal weights at some steps from the middle, 0 elsewhere."""
    weights = (np.arange(steps[0], steps[-1] + 1) - steps[0]) % steps.step == 0
    return np.asarray(weights / weights.sum())


def _read_numpy(raw: RawImage, ratios: Floats, white: int) -> tuple[Floats, Floats, Floats, Floats]:
    """Compute the surroundings' shares, the guide [e-], the weight of lines, and the windows' shares.

    This form uses double precision, `.kernel.panchromatic` single.
    """
    site = np.argmax([mask(raw.cfa, name, raw.shape) for name in raw.channels], axis=0)
    shot, dark, _ = channel_noise(raw)
    electrons = raw.electrons
    down, across = len(raw.cfa), len(raw.cfa[0])
    tent_3 = tent(1) / tent(1).sum()
    wide_tents = [tent(size) / tent(size).sum() for size in tent_radii(raw.cfa)]

    def of_tiles(values: Floats) -> Floats:
        """Sum each channel's values over every tile and its neighbours in the window."""
        missing = (0, -raw.shape[0] % down), (0, -raw.shape[1] % across)
        planes = np.stack([np.pad(np.where(site == c, values, 0.0), missing) for c in range(len(ratios))])
        sums = planes.reshape(len(ratios), -(-raw.shape[0] // down), down, -1, across).sum(axis=(2, 4))
        rows, columns = window_steps(down), window_steps(across)
        return _mean(np.moveaxis(sums, 0, -1), _comb(rows), _comb(columns)) * len(rows) * len(columns)

    # Means over each channel's samples, and the variances of these means.
    neutral = electrons / ratios[site]
    light = _mean(neutral, *wide_tents)
    beside = electrons / np.maximum(light, FAINT * np.sqrt(dark[white]) + TINY)
    samples = of_tiles(np.ones(raw.shape))
    means = of_tiles(beside) / samples
    squares = of_tiles(beside**2) / samples
    all_samples = samples.sum(axis=2)
    mean, mean_square = (of_tiles(x).sum(axis=2) / all_samples for x in (neutral, neutral**2))
    contrast = np.maximum(mean_square / np.maximum(mean, np.sqrt(dark[white]) + TINY) ** 2 - 1.0, 0.0)
    error = (np.maximum(squares - means**2, 0.0) + contrast[..., None] ** 3 * means**2) / samples

    # Shares: those of the window as far as its samples are certain, and for the rest those of the surroundings.
    far = np.maximum(_mean(means, _comb(surroundings_steps(down)), _comb(surroundings_steps(across))), 0.0)
    far += np.maximum(LEAST_LIGHT - far[..., white, None], 0.0) * ratios
    share = far / far[..., white, None]
    surroundings = np.maximum(share, LEAST_SHARE * ratios)
    means, lines = _without_lines(means, error, surroundings, np.maximum(mean, np.sqrt(dark[white]) + TINY), raw)
    away = means - share * means[..., white, None]
    chi_squared = (away**2 / np.maximum(error + share**2 * error[..., white, None], TINY)).sum(axis=2, keepdims=True)
    means = np.maximum(means - away * np.minimum(1.0 / np.maximum(chi_squared, TINY), 1.0), 0.0)
    means += np.maximum(LEAST_LIGHT - means[..., white, None], 0.0) * ratios
    shares = np.maximum(means / means[..., white, None], LEAST_SHARE * ratios)

    # v of the sample itself, and t, the mean of v over the eight samples around it.
    own = np.take_along_axis(at_pixels(shares, raw), site[..., None], axis=-1)[..., 0]
    value = electrons / own

    def noise(light: Floats) -> Floats:
        """Return the variance of a sample that is read as W [e-^2], at some light."""
        return np.asarray(np.maximum((shot[site] * np.maximum(light, 0.0) + dark[site] / own) / own, TINY))

    weight = 1.0 / noise(light)
    middle = tent_3[1] ** 2
    total = _mean(weight, tent_3) - middle * weight
    around = (_mean(weight * value, tent_3) - middle * weight * value) / total
    around_variance = (_mean(weight, tent_3**2) - middle**2 * weight) / total**2
    own_variance = noise(around)
    difference = value - around
    inverse = 1.0 / (own_variance + around_variance)
    detail = np.maximum(_box(difference**2 * inverse, DETAIL_PX) - 1.0, 0.0) / _box(inverse, DETAIL_PX)
    trusted = detail + around_variance
    guide = around + trusted / (trusted + own_variance) * difference
    least = scipy.ndimage.minimum_filter(around, 3, mode="mirror")
    below = np.maximum(least - guide, 0.0)
    dim = np.maximum(1.0 - np.maximum(least, 0.0) ** 2 / (DIM * noise(least)), 0.0)
    hidden = np.minimum(BELOW * noise(least) / np.maximum(below**2, TINY), 1.0)
    return surroundings, guide + dim * hidden * below, lines, shares


def _without_lines(means: Floats, error: Floats, around: Floats, light: Floats, raw: RawImage) -> tuple[Floats, Floats]:
    """Subtract from the channels' means what grey lines two pixels apart would show, and return their weight too."""
    signs = line_signs(raw)
    if signs is None:
        return means, np.zeros(means.shape[:2])
    as_white = means / around
    level = np.maximum(as_white.mean(axis=2), TINY)[..., None]
    shot, dark, _ = channel_noise(raw)
    light = light[..., None]
    noise = (shot * np.maximum(means, 0.0) + dark / light) / light / len(window_steps(2)) ** 2
    scatter, noise_variance = ((x / around**2).sum(axis=2, keepdims=True) / 16.0 for x in (error, noise))
    variance = np.maximum(scatter, LINE_ERRORS**2 * noise_variance)
    patterns = as_white @ signs.T / 4.0
    lines = patterns[..., :2]
    square = np.maximum(lines**2, TINY)
    alone = 1.0 - ((patterns**2).sum(axis=2, keepdims=True) - square) / (OTHER_PATTERNS * square)
    clear = np.minimum((np.abs(lines) / level - LINE_CONTRAST[0]) / np.ptp(LINE_CONTRAST), 1.0)
    weights = np.maximum(alone, 0.0) * np.maximum(clear, 0.0) * np.maximum(1.0 - variance / square, 0.0)
    return means - around * ((weights * lines) @ signs[:2]), weights.max(axis=2)


def at_pixels(shares: NDArray[np.floating], raw: RawImage) -> NDArray[Any]:
    """Repeat the shares of each tile for all its pixels, shape (h, w, channel)."""
    repeated = shares.repeat(len(raw.cfa), axis=0).repeat(len(raw.cfa[0]), axis=1)
    return repeated[: raw.shape[0], : raw.shape[1]]
