"""What the eye sees of a difference: each figure against the module that computes it, and where one scale matters."""

import flip_evaluator  # type: ignore[import-untyped]
import numpy as np
import pytest
from skimage.color import rgb2lab

from rodcone.colour_spaces import encode_srgb, luminance_of_srgb
from studies.metrics.quality import appearance, flip, pu21_psnr_db, true_picture
from studies.metrics.s_cielab import PIXELS_PER_DEGREE, s_cielab

RNG = np.random.default_rng(3)
TRUTH = RNG.uniform(0.0, 1.4, (24, 32, 3))  # brighter than white here and there
PICTURE = TRUTH + RNG.normal(0, 0.1, TRUTH.shape)


def test_each_figure_is_its_own_module_s() -> None:
    picture, truth = encode_srgb(PICTURE), encode_srgb(TRUTH)
    found = appearance(PICTURE, picture, true_picture(TRUTH), 40.0)
    seen = s_cielab(picture, truth)
    assert found.s_cielab_median == pytest.approx(np.median(seen), rel=1e-12)
    assert found.s_cielab_p95 == pytest.approx(np.percentile(seen, 95), rel=1e-12)
    assert found.flip_mean == pytest.approx(flip(picture, truth).mean(), rel=1e-12)
    luminances = 40.0 * luminance_of_srgb(PICTURE), 40.0 * luminance_of_srgb(TRUTH)
    assert found.pu21_psnr_db == pytest.approx(pu21_psnr_db(*luminances), rel=1e-12)
    assert 0 < found.flip_mean < 1
    assert found.s_cielab_median < found.s_cielab_p95


def test_absolute_luminance_counts_for_pu21_alone_and_an_error_above_white_too() -> None:
    encoded, truth = encode_srgb(PICTURE), true_picture(TRUTH)
    dim, bright = (appearance(PICTURE, encoded, truth, white) for white in (0.4, 4000.0))
    assert (dim.flip_mean, dim.s_cielab_p95) == (bright.flip_mean, bright.s_cielab_p95)
    assert dim.pu21_psnr_db > bright.pu21_psnr_db + 10  # at 0.4 cd/m^2 the eye tells few steps apart
    glaring = np.full((24, 32, 3), 2.0)
    above = appearance(glaring, encode_srgb(glaring), true_picture(glaring * 1.5), 40.0)
    assert above.flip_mean == 0.0  # a display clips both
    assert 10 < above.pu21_psnr_db < 30


# FLIP: even colours in the paper's closed form, and what holds for any picture.

DRAWS = np.random.default_rng(0)
FIRST, SECOND = DRAWS.uniform(0, 1, (2, 32, 48, 3))


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


def test_the_mean_is_the_programs_own_under_its_own_defaults() -> None:
    _, mean, parameters = flip_evaluator.evaluate(SECOND.astype(np.float32), FIRST.astype(np.float32), "LDR")
    assert flip(FIRST, SECOND).mean() == pytest.approx(mean, rel=1e-5)  # float32 sums of 1536 pixels
    assert parameters["ppd"] == pytest.approx(PIXELS_PER_DEGREE, rel=1e-6)
