"""The way into a mosaic's sub-images and back, and what their principal components keep."""

import sys
from itertools import product
from types import SimpleNamespace

import numpy as np
import pytest
from builders import BAYER_PHASES, RGBW_4X4, RGBW_PHASES, mosaic_of, raw_image
from refusal import refusal

from isp.processors import sub_images
from isp.processors.catalogue import PROCESSORS
from isp.processors.sub_images import Mix, bm3d_mosaic, hadamard, principal_components
from sensor.cfa import Tile
from sensor.raw import RawImage

SHARES = {"R": 0.5, "G": 1.0, "B": 0.4, "W": 5.0}


def raw(cfa: Tile, shape: tuple[int, int], level_e: float = 400.0) -> RawImage:
    """Poisson exposure of a neutral field with 2 e- of read noise, green at the level."""
    rng = np.random.default_rng(1)
    electrons = rng.poisson(level_e * mosaic_of(SHARES, cfa, shape)) + 2.0 * rng.standard_normal(shape)
    return raw_image(np.rint(electrons + 100), cfa, read_noise_e=2.0, dsnu_e=0.0)


@pytest.mark.parametrize("mix", [hadamard, principal_components])
def test_a_denoiser_that_does_nothing_gives_the_mosaic_back(mix: Mix, monkeypatch: pytest.MonkeyPatch) -> None:
    # then only the unbiased inverse is left, 1/4 e- over the algebraic one and 3/8 (root^-1), 11/8 / root^2 of it less
    seen = []

    def nothing(planes: np.ndarray, sigma: list[float], profile: SimpleNamespace) -> np.ndarray:
        seen.append((planes, sigma, profile.num_threads))
        return planes

    library = SimpleNamespace(bm3d=nothing, BM3DProfile=SimpleNamespace)
    monkeypatch.setattr(sub_images, "optional_library", lambda name, extra: library)
    for cfa, shape in product(BAYER_PHASES + RGBW_PHASES, [(33, 38), (70, 64)]):
        image = raw(cfa, shape)
        root = 2 * np.sqrt(image.electrons + 0.375 + image.dark_noise_e**2)
        correction = 0.25 + np.sqrt(1.5) / 4 / root - 1.375 / root**2 + 0.625 * np.sqrt(1.5) / root**3
        np.testing.assert_allclose(bm3d_mosaic(image, mix), image.electrons + correction, rtol=0, atol=1e-8)
        mixed, sigma, threads = seen.pop()
        assert mixed.shape == (max(-(-shape[0] // 2), 32), max(-(-shape[1] // 2), 32), 4), (cfa, shape)
        assert (sigma, threads) == ([1.0] * 4, 1)
        assert np.std(mixed, axis=(0, 1)) == pytest.approx(np.ones(4), rel=0.15)  # still units of noise


def test_components_are_orthonormal_so_independent_noise_stays_so_and_as_strong() -> None:
    # closed form: noise of covariance s^2 I has M s^2 I M^T = s^2 I afterwards
    sites = np.random.default_rng(2).standard_normal((20, 24, 4)) @ np.random.default_rng(3).uniform(-1, 1, (4, 4))
    matrix = principal_components(sites)
    assert matrix @ matrix.T == pytest.approx(np.eye(4), abs=1e-12)
    covariance = np.cov((sites @ matrix.T).reshape(-1, 4), rowvar=False)
    assert covariance == pytest.approx(np.diag(np.diag(covariance)), abs=1e-12)
    assert np.all(np.diff(np.diag(covariance)) < 0)  # most in the first


def test_what_all_sub_images_share_stands_in_one_component_which_alone_gives_them_back() -> None:
    picture = np.random.default_rng(4).uniform(0, 9, (12, 10))
    sites = np.repeat(picture[..., None], 4, axis=-1)
    matrix = principal_components(sites)
    assert np.abs(matrix[0]) == pytest.approx(np.full(4, 0.5))
    assert (sites @ matrix[:1].T) @ matrix[:1] == pytest.approx(sites)


def test_a_tile_of_more_sites_is_refused_in_one_line_before_anything_is_denoised(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setitem(sys.modules, "bm3d", None)
    large = raw_image(np.full((16, 16), 500), RGBW_4X4)
    match = r"^cfa: .* is not 2x2 RGBW; allowed here: R, G, B and W once each"
    refusal(PROCESSORS["rgbw_park"].develop, large, np.eye(3), match=match)
