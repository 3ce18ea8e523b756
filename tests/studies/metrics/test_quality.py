"""PSNR, SSIM and CIEDE2000 against published values, and against the papers' equations written out plainly."""

import numpy as np
import pytest
from scipy.ndimage import correlate
from skimage.color import deltaE_ciede2000, rgb2lab

from rodcone.errors import InputError
from studies.metrics.appearance import appearance, true_picture
from studies.metrics.pu21 import pu21_psnr_db
from studies.metrics.quality import measure, psnr_db

# Sharma, Wu & Dalal, Color Res. Appl. 30(1), 2005, table 1: pairs 1, 4, 7, 10, 12, 13, 17, 18, 19, 25, 28, 34. They
# hold the hue's jumps at 180 and 360 degrees, greys, blues' rotation, large and small differences.
SHARMA = (
    ((50.0, 2.6772, -79.7751), (50.0, 0.0, -82.7485), 2.0425),
    ((50.0, -1.3802, -84.2814), (50.0, 0.0, -82.7485), 1.0000),
    ((50.0, 0.0, 0.0), (50.0, -1.0, 2.0), 2.3669),
    ((50.0, 2.4900, -0.0010), (50.0, -2.4900, 0.0010), 7.1792),
    ((50.0, 2.4900, -0.0010), (50.0, -2.4900, 0.0012), 7.2195),
    ((50.0, -0.0010, 2.4900), (50.0, 0.0009, -2.4900), 4.8045),
    ((50.0, 2.5, 0.0), (73.0, 25.0, -18.0), 27.1492),
    ((50.0, 2.5, 0.0), (61.0, -5.0, 29.0), 22.8977),
    ((50.0, 2.5, 0.0), (56.0, -27.0, -3.0), 31.9030),
    ((60.2574, -34.0099, 36.2677), (60.4626, -34.1751, 39.4387), 1.2644),
    ((35.0831, -44.1164, 3.7933), (35.0232, -40.0716, 1.5901), 1.8645),
    ((2.0776, 0.0795, -1.1350), (0.9033, -0.0636, -0.5514), 0.9082),
)


def test_the_formula_gives_sharmas_table_to_its_last_digit() -> None:
    first, second, published = (np.array(column) for column in zip(*SHARMA, strict=True))
    assert deltaE_ciede2000(first, second) == pytest.approx(published, abs=0.5001e-4)
    assert deltaE_ciede2000(second, first) == pytest.approx(published, abs=0.5001e-4)


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


def test_ssim_of_even_pictures_is_the_luminance_term_alone() -> None:
    first, second = np.full((20, 20, 3), 0.4), np.full((20, 20, 3), 0.6)
    closed = (2 * 0.4 * 0.6 + 1e-4) / (0.4**2 + 0.6**2 + 1e-4)
    assert measure(first, second).ssim == pytest.approx(closed, rel=1e-9)


def test_noise_of_a_hundredth_has_40_db() -> None:
    # The mean of n squares of normal numbers has the relative standard error sqrt(2 / n): 4.4 of them, 1 in 100 000.
    noise = np.random.default_rng(1).normal(0, 0.01, (100, 100, 3))
    bound_db = 10 / np.log(10) * 4.4 * np.sqrt(2 / noise.size)
    assert psnr_db(0.5 + noise, np.full_like(noise, 0.5)) == pytest.approx(40.0, abs=bound_db)


def test_the_95th_percentile_sees_what_the_median_does_not() -> None:
    truth = np.full((20, 20, 3), 0.5)
    picture = truth.copy()
    picture[:2] = (0.9, 0.5, 0.1)  # a tenth of the pixels
    quality = measure(picture, truth)
    plain = float(deltaE_ciede2000(rgb2lab(picture[0, 0]), rgb2lab(truth[0, 0])))
    assert plain > 20
    assert (quality.delta_e_median, quality.delta_e_p95) == (0.0, pytest.approx(plain))


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize(
    "metric",
    [
        psnr_db,
        measure,
        lambda picture, truth: appearance(picture, true_picture(truth), 40.0),
        lambda picture, truth: pu21_psnr_db(picture[..., 0], truth[..., 0]),
    ],
    ids=["psnr_db", "measure", "appearance", "pu21_psnr_db"],
)
def test_a_picture_that_is_not_finite_has_no_quality(metric, value) -> None:
    sound, broken = np.full((24, 24, 3), 0.5), np.full((24, 24, 3), 0.5)
    broken[3, 4, 0] = value
    for pictures in ((broken, sound), (sound, broken)):
        with pytest.raises(InputError, match=rf"^(picture|truth|luminance_cd_m2): {value} at \(3, 4.*finite numbers"):
            metric(*pictures)
