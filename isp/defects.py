"""Defective pixels of a raw image's list, replaced before anything else is done with it."""

from dataclasses import replace
from functools import cache

import numpy as np
from numpy.typing import NDArray

from sensor.cfa import letter_map
from sensor.raw import RawImage

_RINGS = 3  # tiles around a pixel that are searched for its letter before the whole frame's median serves


def mend(raw: RawImage) -> RawImage:
    """Replace each listed pixel by the median of the nearest sound samples of its letter; the list is gone then.

    Nearest: all in a window of one tile's period to either side, which grows until it holds one. A median, since a
    cluster may hold a defect that isn't listed.
    """
    if raw.defects is None:
        return raw
    dn = raw.dn.copy()
    bad = np.zeros(raw.shape, dtype=np.bool_)
    bad[tuple(raw.defects.T)] = True
    letters = letter_map(raw.cfa, raw.shape)
    of_frame = cache(lambda letter: _median_dn(raw, raw.dn[~bad & (letters == letter)]))
    for row, column in raw.defects:
        found = _neighbours(raw, bad, letters, int(row), int(column))
        dn[row, column] = _median_dn(raw, found) if found.size else of_frame(str(letters[row, column]))
    return replace(raw, dn=dn, defects=None)


def _neighbours(
    raw: RawImage, bad: NDArray[np.bool_], letters: NDArray[np.str_], row: int, column: int
) -> NDArray[np.uint16]:
    """Sound samples of the pixel's letter in the smallest window that holds some [DN]; none where none does."""
    found = np.empty(0, dtype=np.uint16)
    for ring in range(1, _RINGS + 1):
        window = tuple(
            slice(max(at - ring * period, 0), at + ring * period + 1)
            for at, period in ((row, len(raw.cfa)), (column, len(raw.cfa[0])))
        )
        found = np.asarray(raw.dn[window][~bad[window] & (letters[window] == letters[row, column])])
        if found.size:
            break
    return found


def _median_dn(raw: RawImage, samples: NDArray[np.uint16]) -> float:
    """Median of samples, black where there are none."""
    return float(np.rint(np.median(samples))) if samples.size else float(np.rint(raw.black_dn))
