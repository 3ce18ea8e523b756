"""Estimate a camera's gain and dark noise from one photograph whose file doesn't state them."""

from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

_BINS = 24  # number of bins of brightness
_SMOOTHEST = 0.2  # share of a bin's blocks that is used: those with the least structure around them
_LEAST_BLOCKS = 100  # least blocks used in a bin: the median's standard error is then about 12 %, the variance's 24 %
_LEAST_BINS = 4
_MAD_TO_SIGMA = 1.4826  # standard deviation of a normal variable over its median deviation, 1 / Phi^-1(3/4)


@dataclass(frozen=True)
class NoiseEstimate:
    """Electrons per digital number, and the standard deviation of a dark pixel [e-]."""

    gain_e_per_dn: float
    dark_noise_e: float


def estimate_noise(above_black_dn: NDArray[np.float64], full_dn: float) -> NoiseEstimate | None:
    """Fit variance = mean / gain + dark variance to a Bayer frame; None where it doesn't hold enough.

    Each site of the 2x2 tile makes a picture of its own. In these four pictures, blocks of 2x2 give a mean and a
    diagonal difference. Bins of the mean use the fifth of their blocks with the least structure around them, which is
    measured by other differences than the block's own diagonal one. There the median of the difference's size gives the
    variance; the line is fitted with a loss that gives single bins little weight. It is the photon transfer of one
    picture, in a simpler form than A. Foi et al., "Practical Poissonian-Gaussian noise modeling and fitting for
    single-image raw-data", IEEE Trans. Image Process. 17(10), 2008. Fine texture all over the frame passes for noise.

    Parameters
    ----------
    above_black_dn : (h, w) float64
        Mosaic above black [DN].
    full_dn : float
        White level above black [DN]; blocks that touch its last twentieth, or 0, are left out: they are clipped.
    """
    means, differences, structure = _blocks(above_black_dn, full_dn)
    bins = min(_BINS, int(means.size * _SMOOTHEST) // _LEAST_BLOCKS)
    if bins < _LEAST_BINS:
        return None
    parts = []
    for part in np.array_split(np.argsort(means), bins):
        count = int(part.size * _SMOOTHEST)
        parts.append(part[np.argpartition(structure[part], count)[:count]])
    level = np.array([means[part].mean() for part in parts])
    variance = np.array([(_MAD_TO_SIGMA * np.median(np.abs(differences[part]))) ** 2 for part in parts])
    kept = variance > 0
    if kept.sum() < _LEAST_BINS or level[kept].max() < 1.5 * level[kept].min():
        return None  # no line through one level
    return _fit(level[kept], variance[kept])


def _blocks(
    above_black_dn: NDArray[np.float64], full_dn: float
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return the mean, the diagonal difference and the structure around every 2x2 block of one site's samples.

    The diagonal difference has the variance of a sample. The structure is the sum of squared differences: across and
    down over 3x3 blocks, and along the diagonal in the eight outer ones of these.
    """
    height, width = (size // 4 * 4 for size in above_black_dn.shape)
    sites = above_black_dn[:height, :width].reshape(height // 4, 2, 2, width // 4, 2, 2)
    sites = sites.transpose(2, 5, 1, 4, 0, 3).reshape(4, 4, height // 4, width // 4)  # site, position in the block
    a, b, c, d = sites.swapaxes(0, 1)
    diagonal = (a - b - c + d) / 2
    around = np.full((1, 3, 3), 1.0)
    structure = (
        scipy.ndimage.convolve(((a + b - c - d) ** 2 + (a - b + c - d) ** 2) / 4 + diagonal**2, around) - diagonal**2
    )
    inside = (sites.min(axis=1) > 0) & (sites.max(axis=1) < 0.95 * full_dn)
    return ((a + b + c + d) / 4)[inside], diagonal[inside], structure[inside]


def _fit(level: NDArray[np.float64], variance: NDArray[np.float64]) -> NoiseEstimate | None:
    """Fit a line to variances by their relative errors, with neither its slope nor its dark variance below 0."""

    def residuals(parameters: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.asarray(np.log((parameters[0] * level + parameters[1]) / variance))

    from scipy.optimize import least_squares  # imported here: a tenth of a second that no other raw file needs

    slope = max(float(np.median(variance / level)), 1e-12)
    start = [slope, 0.1 * float(variance.min())]
    bounds = ([1e-15, 1e-15], [np.inf, np.inf])
    fit = least_squares(residuals, start, bounds=bounds, loss="soft_l1", f_scale=0.1, x_scale=start)
    gain = 1.0 / float(fit.x[0])
    if not fit.success or not 1e-3 < gain < 1e4:
        return None
    return NoiseEstimate(gain, gain * float(np.sqrt(fit.x[1])))
