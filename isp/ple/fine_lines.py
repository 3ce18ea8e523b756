"""Fine grey lines, which a mosaic of 2x2 pixels reads as a colour.

Each channel of such a mosaic samples only one phase of lines two pixels apart, so that red, for example, sees only
bright lines and blue only dark ones. The trained Gaussians contain hardly any such lines, and explain them by an even
surface, yellow or violet. Therefore two more Gaussians model them: upright lines with s(p) = (-1)^x, and lying ones
with s(p) = (-1)^y. At pixel p = (x, y), channel c has the root of signal

    u_c(p) = MEAN + a(p) + s(p) b(p) + q_c,

where a is the part without lines, b the contrast of the lines, and q_c the slight colour of grey things; a and b are
Gaussian processes, which vary over some pixels. Coarser scales see the lines as a colour too. For these two Gaussians
the pilot therefore counts for nothing (`isp.ple.tables`). Both are tried only for patches of a colour that lines would
have. Lines of exactly the same contrast over a whole patch stay coloured if W is full or if a lamp of that hue is
possible, because an even surface then explains them equally well.

Oblique lines, and lines up to `PERIODS_PX` apart, have Gaussians of their own, each for a sector of `SECTORS` of the
half circle of directions. In place of s(p) b(p) they have a process whose covariance at a distance d is
`WAVES`^2 <cos(k d)>, the mean over the wave vectors k of the sector. They are tried only for patches that none of the
other Gaussians explains (`isp.ple.pick`).
"""

from dataclasses import replace
from functools import cache

import numpy as np
from numpy.typing import NDArray

from isp.ple.prior import Mixture
from rodcone.types import Floats

WEIGHT = 3e-5  # weight of each: small, because the trained Gaussians know better which coloured surfaces are likely
MEAN = 0.9  # mean root of signal; the root of a patch's mean light is 1
EVEN, EVEN_PX = 0.3, 5.0  # standard deviation of the process a, and its length [pixels]
CONTRAST, CONTRAST_PX = 0.6, 2.5  # the same of b; so short that lines not quite two pixels apart are included
GREY = 0.015  # standard deviation of q_c; with a larger one, yellow or pale blue things become striped
REST, REST_OF_CHANNEL = 1e-4, 1e-5  # further variance of each pixel: common to its channels, and of each channel alone
SECTORS = 6  # number of sectors of directions
PERIODS_PX = (1.6, 6.0)  # smallest and largest distance from line to line in a sector [pixels]
WAVES = 0.4  # standard deviation of a sector's process
SECTOR_WEIGHT = 0.01 / SECTORS  # weight of each sector, which hardly matters
_ANGLES, _NUMBERS = 9, 25  # wave vectors of a sector: directions, and wave numbers in each direction
LEAST_ALIASED = 0.05  # lines are tried if the means of a patch's channels show them with this relative contrast or more


def signs(size: int) -> Floats:
    """Return s(p) of upright and of lying lines over a patch's pixels, shape (2, size * size)."""
    y, x = np.indices((size, size)).reshape(2, -1)
    return np.where(np.stack([x, y]) % 2, -1.0, 1.0)


@cache
def with_fine_lines(mix: Mixture) -> Mixture:
    """Append the Gaussians of fine lines to a mixture: upright ones, lying ones, and those of each sector."""
    y, x = np.indices((mix.size, mix.size)).reshape(2, -1)
    square_px2 = (x[:, None] - x) ** 2.0 + (y[:, None] - y) ** 2.0

    def process(deviation: float, length_px: float) -> Floats:
        return np.asarray(deviation**2 * np.exp(-0.5 * square_px2 / length_px**2))

    own = np.eye(len(x))
    even, contrast = process(EVEN, EVEN_PX) + REST * own, process(CONTRAST, CONTRAST_PX)
    colour = np.kron(GREY**2 + REST_OF_CHANNEL * own, np.eye(4))
    lines = [np.outer(s, s) * contrast for s in signs(mix.size)]
    lines += [WAVES**2 * waves(sector, mix.size) for sector in range(SECTORS)]
    covariances = np.array([np.kron(even + line, np.ones((4, 4))) + colour for line in lines], np.float32)
    return replace(
        mix,
        log_weights=np.concatenate([mix.log_weights, np.log([WEIGHT] * 2 + [SECTOR_WEIGHT] * SECTORS)]),
        means=np.concatenate([mix.means, np.full((len(lines), mix.means.shape[1]), MEAN)]),
        covariances=np.concatenate([mix.covariances, covariances]),
        lines=len(lines),
    )


def waves(sector: int, size: int) -> Floats:
    """Return <cos(k d)> between a patch's pixels, the mean over a sector's wave vectors, (size * size, size * size)."""
    angles = (sector + (np.arange(_ANGLES) + 0.5) / _ANGLES - 0.5) * np.pi / SECTORS
    numbers = 2.0 * np.pi * np.linspace(1.0 / PERIODS_PX[1], 1.0 / PERIODS_PX[0], _NUMBERS)
    y, x = np.indices((size, size)).reshape(2, -1)
    phases = np.cos(angles)[:, None] * x + np.sin(angles)[:, None] * y
    every = (numbers[:, None, None] * phases).reshape(-1, size * size)
    # cos(a - b) = cos(a) cos(b) + sin(a) sin(b)
    return np.asarray((np.cos(every).T @ np.cos(every) + np.sin(every).T @ np.sin(every)) / len(every))


def aliased(rows: NDArray[np.intp], size: int) -> Floats:
    """Return the mean of s(p) over each channel's samples, shape (2, 4): the colour that lines of contrast 1 show.

    Parameters
    ----------
    rows : (sample,) intp
        Places of the samples in a patch's vector, 4 * pixel + channel.
    size : int
        Side of the patch [pixels].
    """
    counts = np.maximum(np.bincount(rows % 4, minlength=4), 1)
    return np.stack([np.bincount(rows % 4, s[rows // 4], 4) / counts for s in signs(size)])
