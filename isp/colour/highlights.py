"""Highlights: where samples are saturated, and colours held where the first is full, so that they stay neutral."""

import numpy as np
from numpy.typing import NDArray

from isp.planes import box_sums, rows_at
from sensor.cfa import colour_channels, mask
from sensor.raw import RawImage


def saturated_nearby(raw: RawImage, channels: str, reach: int | None = None) -> NDArray[np.bool_]:
    """Pixels with a saturated sample of one of `channels` within `reach` pixels along either axis, shape (h, w).

    Left out, the reach is one tile.
    """
    hit = raw.saturated & mask(raw.cfa, channels, raw.shape)
    if not hit.any():
        return hit
    reach = max(len(raw.cfa), len(raw.cfa[0])) - 1 if reach is None else reach
    return box_sums(np.pad(hit, reach).astype(np.uint16), (2 * reach + 1, 2 * reach + 1)) > 0


def highlight_level(raw: RawImage, gains: NDArray[np.float64]) -> float:
    """Balanced electrons at which the first colour is full: green's well, or less of one that sees the light better."""
    wells_e = {name: raw.noise_of(name).full_well_e for name in colour_channels(raw.cfa)}
    return float(min(gains[raw.channels.index(name)] * well_e for name, well_e in wells_e.items()))


def clip_highlights(
    raw: RawImage, balanced: NDArray[np.float64], level: float, reach: int | None = None
) -> NDArray[np.float64]:
    """Hold every balanced colour at `highlight_level` near a saturated colour sample: highlights stay neutral.

    `reach` as in `saturated_nearby`: that of the filter which made the planes. Where nothing is held the array itself
    is returned.
    """
    clipped = saturated_nearby(raw, "".join(colour_channels(raw.cfa)), reach)
    if not clipped.any():
        return balanced
    limited = balanced.copy()
    limited[clipped] = np.minimum(rows_at(balanced, clipped), level)
    return limited
