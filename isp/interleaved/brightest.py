"""Upper limit of the samples that count at a pixel: the brightest sample of their channel near the pixel, plus noise.

The similarity misses some light: it fades where W's SNR is below 1, and a lamp of one pixel on a colour's site leaves
no trace in W. Without this limit the light of such a lamp would be spread over all of Omega
(docs/decisions/0037-lamps-in-the-dark.md).
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from isp.planes import BLOCK_ROWS
from isp.settings import SIGMA_S, Settings
from sensor.raw import RawImage, noise_at_sites

# With these numbers, at most 3 of 10 000 samples of a flat field lie above the limit, and at most 0.3 % of its light is
# lost: most at a mean of 0.2 e- per sample without dark noise.
SIGMAS = 2.5  # standard deviations that a sample may lie above the brightest of the 9 or more samples around
MOST_SIGMAS = 1e3  # from this number on there is no limit
FEWEST_E = 2.25  # without dark noise, samples of 1 and 2 electrons count even where all samples around hold none


def brightest_allowed(electrons: NDArray[np.floating], raw: RawImage, settings: Settings) -> NDArray[Any]:
    """Compute the electrons up to which samples count at each pixel, for each position of a sample in the tile.

    With m the brightest sample of the channel that is less than 2 tiles away along either axis, s the dark noise and p
    the PRNU, the limit is

        B = m + z sqrt(m + s^2 + (p m)^2) + 2.25 / (1 + s^2)^2.

    z is `SIGMAS` up to the default sigma_s, and grows in proportion beyond it. If settings let all patches count as
    similar, and for the paper's distance, there is no limit. The noise is that of `sensor.raw.noise_at_sites`.

    Parameters
    ----------
    electrons : (h, w) float32 or float64
        The mosaic of `raw`, or a part of it that begins at the tile's first phase.

    Returns
    -------
    (th, tw, h, w) of the same type
        The limit of a sample y at a pixel x stands at [(y - x) mod (th, tw), x].
    """
    tile = (len(raw.cfa), len(raw.cfa[0]))
    shape = electrons.shape
    z = max(SIGMAS, settings.sigma_s * (SIGMAS / SIGMA_S))
    if settings.distance == "raw" or z > MOST_SIGMAS:
        return np.full((*tile, *shape), np.inf, electrons.dtype)
    ends = 2 * tile[0] - 1, 2 * tile[1] - 1
    allowed = np.full((shape[0] + 2 * ends[0], shape[1] + 2 * ends[1]), -np.inf, electrons.dtype)
    block = max(BLOCK_ROWS // tile[0], 1) * tile[0]
    for first in range(0, shape[0], block):
        part = electrons[first : first + block]
        bound = noise_at_sites(raw, part)
        np.sqrt(bound, out=bound)
        bound *= z
        bound += FEWEST_E / (1.0 + raw.dark_noise_e**2) ** 2
        # B increases with m, so that the largest m has the largest B.
        np.add(bound, part, out=allowed[ends[0] + first : ends[0] + first + len(part), ends[1] : ends[1] + shape[1]])
    result = np.empty((*tile, *shape), electrons.dtype)
    # Steps from x to the samples at each phase, counted from -(2 tiles - 1).
    rows, columns = ([range((p - 1) % n, 2 * end + 1, n) for p in range(n)] for n, end in zip(tile, ends, strict=True))
    for first in range(0, shape[0], BLOCK_ROWS):
        last = min(first + BLOCK_ROWS, shape[0])
        for a, steps in enumerate(rows):
            lines = _most([allowed[first + i : last + i] for i in steps], np.empty_like(allowed[first:last]))
            for b, more in enumerate(columns):
                _most([lines[:, j : j + shape[1]] for j in more], result[a, b, first:last])
    return result


def _most(parts: list[NDArray[np.floating]], out: NDArray[np.floating]) -> NDArray[Any]:
    """Return the largest of two or more arrays, element by element; `np.maximum.reduce` would copy all of them."""
    np.maximum(parts[0], parts[1], out=out)
    for part in parts[2:]:
        np.maximum(out, part, out=out)
    return out
