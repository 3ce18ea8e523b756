"""Highlights: where samples are saturated, and colours held at green's full well, so that a highlight stays neutral."""

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter

from sensor.cfa import channel_map, colour_channels
from sensor.raw import RawImage


def saturated_nearby(raw: RawImage, channels: str, reach: int | None = None) -> NDArray[np.bool_]:
    """Pixels with a saturated sample of one of `channels` within `reach` pixels along either axis, shape (h, w).

    Left out, the reach is one tile.
    """
    hit = raw.saturated & np.isin(channel_map(raw.cfa, raw.shape), list(channels))
    tile = max(len(raw.cfa), len(raw.cfa[0]))
    return np.asarray(maximum_filter(hit, size=2 * (tile - 1 if reach is None else reach) + 1))


def clip_highlights(raw: RawImage, balanced: NDArray[np.float64], reach: int | None = None) -> NDArray[np.float64]:
    """Hold every balanced colour at green's full well near a saturated colour sample: highlights stay neutral.

    Without green it is the full well of `sensor.cfa.unit_channel`.
    `reach` as in `saturated_nearby`: that of the filter which made the planes.
    """
    clipped = saturated_nearby(raw, "".join(colour_channels(raw.cfa)), reach)
    return np.where(clipped[..., None], np.minimum(balanced, raw.full_well_e), balanced)
