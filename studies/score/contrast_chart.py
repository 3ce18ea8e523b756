"""Contrast transfer accuracy of pictures: the share of all pairs of pixels that measure the contrast of two patches.

The picture may be developed by any processor; its values must be proportional to light. For a camera's own samples
there is a formula (`studies.score.contrast`).
"""

from dataclasses import dataclass

import numpy as np

from rodcone.errors import InputError
from rodcone.types import Floats, Plane
from scenes.contrast_patches import PatchPair, patch_pairs
from studies.score.contrast import CONTRAST, EQUAL, TOLERANCE

MARGIN = 0.15  # share of a patch's width and height that isn't measured, at each of its borders


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
    """Measure the accuracy of each pair of patches in a square picture of the scene `contrast_patches`.

    Parameters
    ----------
    luminance : (side, side) float64
        The whole picture, proportional to light, such as `rodcone.luminance_of_srgb` of a developed one.
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
    """Return the share of all pairs, one pixel from each of two patches, that measure the contrast right.

    Beside a brighter value x, a value has at most the contrast c if it is at least x (1 - c) / (1 + c). So the pairs
    are counted in sorted values, without forming them.
    """
    lowest, highest = (contrast * (1 + sign * tolerance) + sign * EQUAL for sign in (-1, 1))
    values = np.sort(np.ravel(dark))
    known = np.ravel(bright)
    known = known[known > 0]  # a pair that measures a positive contrast has a brighter value above 0
    darkest, brightest = (known * (1 - c) / (1 + c) for c in (highest, lowest))
    right = np.searchsorted(values, brightest, side="right") - np.searchsorted(values, darkest, side="left")
    return float(right.sum() / (np.size(bright) * values.size))
