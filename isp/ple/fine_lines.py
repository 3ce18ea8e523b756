"""Grey lines two pixels apart, which a mosaic of 2x2 pixels reads as a colour.

Every channel of such a mosaic samples the same phase of these lines, so that red, say, sees bright ones alone and blue
dark ones alone. The trained Gaussians hold next to no such lines and take them for an even surface, yellow or violet.
Two Gaussians more stand for them, upright ones with s(p) = (-1)^x and lying ones with s(p) = (-1)^y. The roots of
signal of a pixel p of channel c are

    u_c(p) = MEAN + a(p) + s(p) b(p) + q_c,

where a is what is even, b the lines' contrast, both Gaussian processes that change over some pixels, and q_c the little
colour that grey things have. Coarser scales take the lines for a colour as well, so that what they say counts for
nothing (`isp.ple.tables`). Only patches that are coloured in the way that lines would be are held against these two.
Lines that are exactly even over a whole patch fit an even surface as well, if W is full or a lamp of that hue is
thinkable, and stay coloured.
"""

from dataclasses import replace
from functools import cache

import numpy as np
from numpy.typing import NDArray

from isp.ple.prior import Mixture
from rodcone.types import Floats

WEIGHT = 3e-5  # of each; of a coloured surface the trained ones know much better what is likely
MEAN = 0.9  # root of a patch's own mean light is 1
EVEN, EVEN_PX = 0.3, 5.0  # standard deviation and length of a
CONTRAST, CONTRAST_PX = 0.6, 2.5  # of b; shorter: lines that aren't quite two pixels apart count too
GREY = 0.015  # standard deviation of q_c; more, and yellow or pale blue things become striped
REST, REST_OF_CHANNEL = 1e-4, 1e-5  # variance of each pixel beside these, of all channels alike and of each alone
LEAST_ALIASED = 0.05  # of a patch's mean: the difference between its channels from which it may be lines


def signs(size: int) -> Floats:
    """Return s(p) of upright and of lying lines over a patch's pixels, shape (2, size * size)."""
    y, x = np.indices((size, size)).reshape(2, -1)
    return np.where(np.stack([x, y]) % 2, -1.0, 1.0)


@cache
def with_fine_lines(mix: Mixture) -> Mixture:
    """Return a mixture with two Gaussians more, of fine lines, which come last."""
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
    """Return the mean of s(p) over each channel's samples, shape (2, 4): what lines of contrast 1 read as a colour.

    Parameters
    ----------
    rows : (sample,) intp
        Places of the samples in a patch's vector, 4 * pixel + channel.
    size : int
        Pixels a side of the patch.
    """
    counts = np.maximum(np.bincount(rows % 4, minlength=4), 1)
    return np.stack([np.bincount(rows % 4, s[rows // 4], 4) / counts for s in signs(size)])
