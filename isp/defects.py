"""Replacement of a raw image's listed defective pixels, before anything else is done with it."""

from dataclasses import replace
from functools import cache

import numpy as np
from numpy.typing import NDArray

from sensor.cfa import channel_map
from sensor.raw import RawImage

_RINGS = 3  # distance [tiles] up to which sound samples are searched for; beyond, the whole frame's median is used


def interpolate_defects(raw: RawImage) -> RawImage:
    """Replace each listed pixel by the median of the nearest sound samples of its channel, and drop the list.

    The nearest samples are all those in a window that reaches one tile to either side, or two or three tiles if it
    holds none; after that the median of the whole frame is used. A median is used because a cluster may include
    a defect that isn't listed. A channel without any sound sample gets the black level.
    """
    if raw.defects is None:
        return raw
    sound = np.ones(raw.shape, dtype=np.bool_)
    sound[tuple(raw.defects.T)] = False
    names = channel_map(raw.cfa, raw.shape)

    def sound_dn(window: tuple[slice, ...], name: str) -> NDArray[np.uint16]:
        return np.asarray(raw.dn[window][sound[window] & (names[window] == name)])

    def median_dn(samples: NDArray[np.uint16]) -> float:
        return float(np.rint(np.median(samples) if samples.size else raw.black_dn))

    of_frame = cache(lambda name: median_dn(sound_dn((slice(None), slice(None)), name)))
    down, across = len(raw.cfa), len(raw.cfa[0])
    dn = raw.dn.copy()
    for row, column in raw.defects.tolist():
        name = str(names[row, column])
        for ring in range(1, _RINGS + 1):
            rows = slice(max(row - ring * down, 0), row + ring * down + 1)
            columns = slice(max(column - ring * across, 0), column + ring * across + 1)
            samples = sound_dn((rows, columns), name)
            if samples.size:
                break
        dn[row, column] = median_dn(samples) if samples.size else of_frame(name)
    return replace(raw, dn=dn, defects=None)
