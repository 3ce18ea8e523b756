"""Grey lines two pixels apart, which a mosaic of 2x2 pixels reads as a colour.

Each channel of such a mosaic samples only one phase of these lines, so that red, for example, sees only bright lines
and blue only dark ones. The trained Gaussians contain hardly any such lines, and explain them by an even surface,
yellow or violet. Therefore two more Gaussians model them: upright lines with s(p) = (-1)^x, and lying ones with
s(p) = (-1)^y. At pixel p = (x, y), channel c has the root of signal

    u_c(p) = MEAN + a(p) + s(p) b(p) + q_c,

where a is the part without lines, b the contrast of the lines, and q_c the slight colour of grey things; a and b are
Gaussian processes, which vary over some pixels. Coarser scales see the lines as a colour too. For these two Gaussians
the pilot therefore counts for nothing (`isp.ple.tables`). Both are tried only for patches of a colour that lines would
have. Lines of exactly the same contrast over a whole patch stay coloured if W is full or if a lamp of that hue is
possible, because an even surface then explains them equally well.
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
LEAST_ALIASED = 0.05  # lines are tried if the means of a patch's channels show them with this relative contrast or more


def signs(size: int) -> Floats:
    """Return s(p) of upright and of lying lines over a patch's pixels, shape (2, size * size)."""
    y, x = np.indices((size, size)).reshape(2, -1)
    return np.where(np.stack([x, y]) % 2, -1.0, 1.0)


@cache
def with_fine_lines(mix: Mixture) -> Mixture:
    """Append two Gaussians of fine lines, upright and lying ones, to a mixture."""
    y, x = np.indices((mix.size, mix.size)).reshape(2, -1)
    square_px2 = (x[:, None] - x) ** 2.0 + (y[:, None] - y) ** 2.0

    def process(deviation: float, length_px: float) -> Floats:
        return np.asarray(deviation**2 * np.exp(-0.5 * square_px2 / length_px**2))

    own = np.eye(len(x))
    even, contrast = process(EVEN, EVEN_PX) + REST * own, process(CONTRAST, CONTRAST_PX)
    colour = np.kron(GREY**2 + REST_OF_CHANNEL * own, np.eye(4))
    both = [np.kron(even + np.outer(s, s) * contrast, np.ones((4, 4))) + colour for s in signs(mix.size)]
    return replace(
        mix,
        log_weights=np.concatenate([mix.log_weights, np.full(2, np.log(WEIGHT))]),
        means=np.concatenate([mix.means, np.full((2, mix.means.shape[1]), MEAN)]),
        covariances=np.concatenate([mix.covariances, np.array(both, np.float32)]),
        lines=2,
    )


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
