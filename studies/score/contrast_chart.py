"""Contrast transfer accuracy of pictures: the share of all pairs of pixels that measure the contrast of two patches.

Of a picture by any processor, in numbers in proportion to light. A camera's own samples have a closed form
(`studies.score.contrast`).
"""

from dataclasses import dataclass

import numpy as np

from rodcone.errors import InputError
from rodcone.types import Floats, Plane
from scenes.contrast_patches import PatchPair, patch_pairs
from studies.score.contrast import CONTRAST, EQUAL, TOLERANCE

MARGIN = 0.15  # share of a patch's side that is left off on each side


@dataclass(frozen=True)
class PairAccuracy:
    """Accuracy of one pair of the chart.

    Attributes
    ----------
    pair : PatchPair
    accuracy : float
        0 to 1.
    """

    pair: PatchPair
    accuracy: float


def chart_accuracy(luminance: Plane, tolerance: float = TOLERANCE) -> list[PairAccuracy]:
    """Measure a square picture of the scene `contrast_patches`, shape (side, side), in proportion to light.

    Parameters
    ----------
    luminance : (side, side) float64
        The whole picture, such as `rodcone.luminance_of_srgb` makes of a developed one.
    tolerance : float
        Share by which a contrast that counts as right may differ from the patches' own.

    Returns
    -------
    list of PairAccuracy
        In the chart's order: contrasts of 0.1, 0.2 and 0.4, from the brightest row down.

    Raises
    ------
    InputError
        For a picture that isn't square, or less than 64 pixels wide.
    """
    side = luminance.shape[0]
    if luminance.ndim != 2 or luminance.shape[1] != side or side < 64:
        raise InputError(
            f"luminance: shape {luminance.shape} is no picture of the chart; allowed: (side, side) of 64 pixels or "
            "more; crop it to the chart's square"
        )
    found = []
    for pair in patch_pairs():
        bright, dark = (_patch(luminance, pair, column) for column in (pair.bright_column, pair.dark_column))
        found.append(PairAccuracy(pair, pair_accuracy(bright, dark, pair.contrast, tolerance)))
    return found


def _patch(luminance: Plane, pair: PatchPair, column: float) -> Plane:
    side = luminance.shape[0]
    half = (0.5 - MARGIN) * pair.side
    down, across = (slice(int(np.ceil((at - half) * side)), int((at + half) * side)) for at in (pair.row, column))
    return luminance[down, across]


def pair_accuracy(bright: Floats, dark: Floats, contrast: float = CONTRAST, tolerance: float = TOLERANCE) -> float:
    """Return the share of all pairs of a pixel of one patch and a pixel of the other that measure the contrast right.

    A value has at most the contrast c to a brighter value x if it is at least x (1 - c) / (1 + c). Therefore sorted
    values are counted, and no pairs are formed.
    """
    lowest, highest = (contrast * (1 + sign * tolerance) + sign * EQUAL for sign in (-1, 1))
    values = np.sort(np.ravel(dark))
    known = np.ravel(bright)
    known = known[known > 0]  # the brighter one of a pair with a positive sum is above 0
    darkest, brightest = (known * (1 - c) / (1 + c) for c in (highest, lowest))
    right = np.searchsorted(values, brightest, side="right") - np.searchsorted(values, darkest, side="left")
    return float(right.sum() / (np.size(bright) * values.size))
