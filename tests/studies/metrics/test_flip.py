"""FLIP: even colours in the paper's closed form, and what holds for any picture."""

import flip_evaluator  # type: ignore[import-untyped]
import numpy as np
import pytest
from skimage.color import rgb2lab

from studies.metrics.appearance import flip
from studies.metrics.s_cielab import PIXELS_PER_DEGREE

RNG = np.random.default_rng(0)
FIRST, SECOND = RNG.uniform(0, 1, (2, 32, 48, 3))


def even_difference(first: tuple[float, ...], second: tuple[float, ...]) -> float:
    """FLIP of two even pictures, from the paper: no blur changes them and they have no features, so colour is left.

    Hunt-adjusted CIELAB, HyAB distance to the power 0.7, of which 0.4 of the largest maps to 0.95.
    """

    def hunt(colour: tuple[float, ...]) -> np.ndarray:
        lightness, a, b = rgb2lab(np.array(colour, dtype=np.float64))
        return np.array([lightness, 0.01 * lightness * a, 0.01 * lightness * b])

    def hyab(one: tuple[float, ...], other: tuple[float, ...]) -> float:
        difference = hunt(one) - hunt(other)
        return float((abs(difference[0]) + np.hypot(*difference[1:])) ** 0.7)

    most, found = hyab((0, 1, 0), (0, 0, 1)), hyab(first, second)
    knee = 0.4 * most
    return found / knee * 0.95 if found < knee else 0.95 + (found - knee) / (most - knee) * 0.05


def test_even_colours_differ_by_the_papers_closed_form() -> None:
    for first, second in [
        ((0.5, 0.5, 0.5), (0.52, 0.5, 0.47)),
        ((0.8, 0.2, 0.1), (0.2, 0.3, 0.7)),
        ((0.0, 0.0, 0.0), (1.0, 1.0, 1.0)),
    ]:
        pictures = [np.broadcast_to(colour, (24, 24, 3)).astype(np.float64) for colour in (first, second)]
        # scikit-image's white and matrix have other last digits, and FLIP computes in float32: 0.1 %.
        assert flip(*pictures) == pytest.approx(np.full((24, 24), even_difference(first, second)), rel=1e-3), (
            first,
            second,
        )


def test_equal_pictures_do_not_differ_and_order_does_not_count() -> None:
    assert flip(FIRST, FIRST).max() == 0.0
    assert flip(FIRST, SECOND) == pytest.approx(flip(SECOND, FIRST), abs=1e-6)
    found = flip(FIRST, SECOND)
    assert found.shape == (32, 48)
    assert 0 < found.min() <= found.max() <= 1


def test_the_mean_is_the_programs_own_under_its_own_defaults() -> None:
    _, mean, parameters = flip_evaluator.evaluate(SECOND.astype(np.float32), FIRST.astype(np.float32), "LDR")
    assert flip(FIRST, SECOND).mean() == pytest.approx(mean, rel=1e-5)  # float32 sums of 1536 pixels
    assert parameters["ppd"] == pytest.approx(PIXELS_PER_DEGREE, rel=1e-6)
