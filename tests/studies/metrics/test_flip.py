"""LDR-FLIP: even colours in the paper's closed form, and each pixel beside the authors' own program."""

import flip_evaluator  # type: ignore[import-untyped]
import numpy as np
import pytest
from numpy.typing import NDArray
from skimage.color import rgb2lab

from studies.metrics.flip import flip, seen
from studies.metrics.s_cielab import PIXELS_PER_DEGREE

DRAWS = np.random.default_rng(0)
NOISE = DRAWS.uniform(0, 1, (32, 48, 3))
# Edges, corners, single bright pixels also at the border, a ramp: what the features look for.
DRAWN = np.full((32, 48, 3), 0.25)
DRAWN[8:20, 10:30] = (0.9, 0.2, 0.1)
DRAWN[::7, ::9] = (1.0, 1.0, 0.6)
DRAWN[:, 40:] *= np.linspace(0, 1, 8)[None, :, None]


def program(picture: NDArray[np.float64], truth: NDArray[np.float64], pixels_per_degree: float) -> NDArray[np.float64]:
    """LDR-FLIP by the authors' program, in float32."""
    first, second = truth.astype(np.float32), picture.astype(np.float32)
    error, _, _ = flip_evaluator.evaluate(
        first, second, "LDR", applyMagma=False, computeMeanError=False, parameters={"ppd": pixels_per_degree}
    )
    return np.asarray(error[..., 0], dtype=np.float64)


@pytest.mark.parametrize("pixels_per_degree", [PIXELS_PER_DEGREE, 25.0])
def test_each_pixel_is_the_programs_own(pixels_per_degree: float) -> None:
    for name, picture, truth in (
        ("noise", NOISE, DRAWN),
        ("darker", DRAWN * 0.6, DRAWN),
        ("a pixel aside", np.roll(DRAWN, 1, axis=1), DRAWN),
        ("black beside white", np.zeros((32, 48, 3)), np.ones((32, 48, 3))),
        ("a line", NOISE[:1], DRAWN[:1]),
    ):
        ours, theirs = flip(picture, truth, pixels_per_degree), program(picture, truth, pixels_per_degree)
        assert ours == pytest.approx(theirs, abs=1e-4), name
        assert ours.mean() > 0.01, name


def test_the_view_is_the_programs_own_default() -> None:
    _, mean, parameters = flip_evaluator.evaluate(DRAWN.astype(np.float32), NOISE.astype(np.float32), "LDR")
    assert flip(NOISE, DRAWN).mean() == pytest.approx(mean, rel=1e-5)  # float32 sums of 1536 pixels
    assert parameters["ppd"] == pytest.approx(PIXELS_PER_DEGREE, rel=1e-6)


def test_the_truths_half_is_kept_at_its_own_view() -> None:
    kept = seen(DRAWN, 25.0)
    assert np.array_equal(flip(NOISE, kept), flip(NOISE, DRAWN, 25.0))
    assert flip(DRAWN, DRAWN).max() == 0


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
        # scikit-image's white and matrix have other last digits: 0.1 %.
        assert flip(*pictures) == pytest.approx(np.full((24, 24), even_difference(first, second)), rel=1e-3), (
            first,
            second,
        )
