"""PSNR, SSIM and CIEDE2000 against published values, and against the papers' equations written out plainly."""

from itertools import product

import numpy as np
import pytest
from refusal import refusal
from scipy.ndimage import correlate
from skimage.color import deltaE_ciede2000, rgb2lab

from studies.metrics.quality import appearance, measure, psnr_db, pu21_psnr_db, true_picture


def ssim(first: np.ndarray, second: np.ndarray) -> float:
    """Wang, Bovik, Sheikh & Simoncelli 2004, equations 13-17, as printed: 11x11 window, 1.5 px, where it fits."""
    offset = np.arange(11) - 5
    window = np.exp(-(offset[:, None] ** 2 + offset[None, :] ** 2) / (2 * 1.5**2))
    window /= window.sum()

    def mean(values: np.ndarray) -> np.ndarray:
        return correlate(values, window[..., None], mode="constant")[5:-5, 5:-5]

    c1, c2 = 0.01**2, 0.03**2
    one, two = mean(first), mean(second)
    variances = mean(first**2) - one**2 + mean(second**2) - two**2
    shared = mean(first * second) - one * two
    return float(np.mean((2 * one * two + c1) * (2 * shared + c2) / ((one**2 + two**2 + c1) * (variances + c2))))


def test_ssim_is_the_papers_equation() -> None:
    rng = np.random.default_rng(0)
    first = rng.uniform(0, 1, (28, 36, 3))
    second = np.clip(first + rng.normal(0, 0.2, first.shape), 0, 1)
    assert measure(second, first).ssim == pytest.approx(ssim(second, first), rel=1e-9)


def test_the_95th_percentile_sees_what_the_median_does_not() -> None:
    truth = np.full((20, 20, 3), 0.5)
    picture = truth.copy()
    picture[:2] = (0.9, 0.5, 0.1)  # a tenth of the pixels
    quality = measure(picture, truth)
    plain = float(deltaE_ciede2000(rgb2lab(picture[0, 0]), rgb2lab(truth[0, 0])))
    assert plain > 20
    assert (quality.delta_e_median, quality.delta_e_p95) == (0.0, pytest.approx(plain))


def test_a_picture_that_is_not_finite_has_no_quality() -> None:
    for metric, value in product(
        [
            psnr_db,
            measure,
            lambda picture, truth: appearance(picture, picture, true_picture(truth), 40.0),
            lambda picture, truth: pu21_psnr_db(picture[..., 0], truth[..., 0]),
        ],
        [np.nan, np.inf, -np.inf],
    ):
        sound, broken = np.full((24, 24, 3), 0.5), np.full((24, 24, 3), 0.5)
        broken[3, 4, 0] = value
        for pictures in ((broken, sound), (sound, broken)):
            refusal(metric, *pictures, match=rf"^(picture|truth|luminance_cd_m2): {value} at \(3, 4.*finite numbers")
