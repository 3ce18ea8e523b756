"""How bright a sample may be to count at a pixel: as its channel's brightest near there, and noise on top.

What guides the similarity doesn't see all light. Where W's SNR is under 1 the similarity fades, and a lamp of one pixel
on a colour's site never reaches W. Without this bound either would be spread over all of Omega
(docs/decisions/0037-lamps-in-the-dark.md).
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from isp.planes import BLOCK_ROWS
from isp.settings import SIGMA_S, Settings
from sensor.raw import RawImage

# Of a flat field's samples 3 in 10 000 or fewer are left out at a pixel, and 0.3 % of the light at most, at 0.2 e-.
SIGMAS = 2.5  # over the brightest of 9
MOST_SIGMAS = 1e3  # beyond it there is no bound
FEWEST_E = 2.25  # 1 and 2 electrons count where 9 samples hold none


def brightest_allowed(electrons: NDArray[Any], raw: RawImage, settings: Settings) -> NDArray[Any]:
    """Electrons up to which a sample counts at pixels near each site of its channel.

    With m the brightest sample of the site's channel in 3 x 3 tiles around it, s the dark noise and p the PRNU

        B = m + z sqrt(m + s^2 + (p m)^2) + 2.25 / (1 + s^2)^2.

    z is `SIGMAS` up to the default sigma_s and rises with it: who lets all patches count as similar gets no bound, nor
    does who takes the paper's distance.

    Parameters
    ----------
    electrons : (h, w) float32 or float64
        The mosaic of `raw`, or a part of it that begins at the tile's first phase.

    Returns
    -------
    (h + th - 1, w + tw - 1) of the same type
        A pixel x with a sample y reads the site at x + (y - x) mod (th, tw): y's channel, less than a tile away.
    """
    (down, across), (height, width) = (len(raw.cfa), len(raw.cfa[0])), electrons.shape
    z = max(SIGMAS, settings.sigma_s * (SIGMAS / SIGMA_S))
    result = np.full((height + down - 1, width + across - 1), np.inf, electrons.dtype)
    if settings.distance == "raw" or z > MOST_SIGMAS:
        return result
    allowed = np.full((height + 3 * down - 1, width + 3 * across - 1), -np.inf, electrons.dtype)
    for first in range(0, height, BLOCK_ROWS):
        part = electrons[first : first + BLOCK_ROWS]
        light = np.maximum(part, 0.0)
        bound = light * raw.prnu
        bound *= bound
        bound += light
        bound += raw.dark_noise_e**2
        np.sqrt(bound, out=bound)
        bound *= z
        bound += FEWEST_E / (1.0 + raw.dark_noise_e**2) ** 2
        # B rises with m: the largest m has the largest B.
        np.add(bound, part, out=allowed[down + first : down + first + len(part), across : across + width])
    for first in range(0, len(result), BLOCK_ROWS):
        last = min(first + BLOCK_ROWS, len(result))
        lines = np.maximum(allowed[first:last], allowed[first + down : last + down])
        np.maximum(lines, allowed[first + 2 * down : last + 2 * down], out=lines)
        columns = lines[:, : -2 * across], lines[:, across:-across], lines[:, 2 * across :]
        np.maximum(np.maximum(columns[0], columns[1]), columns[2], out=result[first:last])
    return result
