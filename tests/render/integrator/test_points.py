"""Points of paths: Sobol's sequence, even in every pixel, and pixels that know nothing of each other."""

import json
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import chi2, norm, qmc

from render.integrator.points import DIMENSIONS, DIRECTIONS, LOG2_POINTS, Points, pixel_keys, sequence
from render.loader import mitsuba_module

FALSE_ALARM = 1e-5


def published() -> np.ndarray:
    """The points by SciPy, which has the numbers of Joe and Kuo too, shape (dimension, point)."""
    points = qmc.Sobol(DIMENSIONS, scramble=False, bits=32).random_base2(LOG2_POINTS)
    return np.round(points.T * 2.0**32).astype(np.uint32)


def points_of(pixels: int, count: int, dimensions: int, seed: int = 1) -> np.ndarray:
    """First points of some pixels, shape (dimension, pixel, point)."""
    mi = mitsuba_module()
    pixel, index = np.divmod(np.arange(pixels * count, dtype=np.uint32), np.uint32(count))
    points = Points(mi, mi.UInt32(index), pixel_keys(mi, mi.UInt32(pixel), seed))
    return np.stack([points.at(dimension).numpy().reshape(pixels, count) for dimension in range(dimensions)])


def test_the_sequence_is_sobol_s() -> None:
    assert np.array_equal(sequence(), published())


@pytest.mark.sample(2)
@pytest.mark.parametrize("power", [0, 1, 3, 4, 7])
def test_a_pixel_has_one_point_in_each_of_as_many_intervals(power: int) -> None:
    """In every dimension, for powers of two; and in the film's plane one in each box of every shape."""
    count = 1 << power
    drawn = points_of(5, count, DIMENSIONS)
    assert drawn.min() >= 0
    assert drawn.max() < 1
    assert np.array_equal(np.sort(np.floor(drawn * count), axis=-1), np.broadcast_to(np.arange(count), drawn.shape))
    for wide in range(power + 1):
        boxes = np.floor(drawn[0] * 2**wide) * 2 ** (power - wide) + np.floor(drawn[1] * 2 ** (power - wide))
        assert np.array_equal(np.sort(boxes, axis=-1), np.broadcast_to(np.arange(count), boxes.shape))


def test_a_point_is_anywhere_and_pixels_seeds_and_dimensions_are_independent() -> None:
    """Chi-squared over 16 cells of 20 000 pixels' points; correlations of neighbours, seeds and dimensions."""
    dimensions, pixels = DIMENSIONS + 3, 20_000  # three more than the sequence has
    drawn, other = (points_of(pixels, 4, dimensions, seed) for seed in (1, 2))
    comparisons = dimensions * 4
    for of_dimension in drawn:
        for point in of_dimension.T:
            counts = np.bincount((point * 16).astype(int), minlength=16)
            assert ((counts - pixels / 16) ** 2).sum() / (pixels / 16) < chi2.isf(FALSE_ALARM / comparisons, 15)
    pairs = [(of[:-1, 0], of[1:, 0]) for of in drawn]
    pairs += [(one[:, 0], two[:, 0]) for one, two in zip(drawn, other, strict=True)]
    pairs += [(one[:, 0], two[:, 0]) for one, two in pairwise(drawn)]
    most = norm.isf(FALSE_ALARM / 2 / len(pairs)) / np.sqrt(pixels - 1)
    assert max(abs(np.corrcoef(one, two)[0, 1]) for one, two in pairs) < most


if __name__ == "__main__":
    # The direction of a bit is the point whose Gray code is that bit alone.
    found = published()[:, [(2 << bit) - 1 for bit in range(LOG2_POINTS)]]
    Path(DIRECTIONS).write_text(json.dumps(found.tolist()).replace("], [", "],\n[") + "\n", encoding="utf-8")
