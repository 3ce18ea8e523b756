"""Bayer with a denoiser: non-local means as they are, the way into BM3D and back, and that it denoises."""

from types import SimpleNamespace

import numpy as np
import pytest
from builders import BAYER_PHASES, raw_image

from isp.interleaved import reconstruct
from isp.processors import bayer_denoised
from isp.processors.bayer_denoised import bm3d_mosaic
from isp.processors.catalogue import PROCESSORS
from sensor.cfa import BAYER, Tile, mask
from sensor.raw import RawImage


def raw(cfa: Tile, shape: tuple[int, int] = (33, 38), level_e: float = 400.0, seed: int = 1) -> RawImage:
    """Poisson exposure with 2 e- of read noise: G at the level, R at a half, B at 0.4 of it."""
    rng = np.random.default_rng(seed)
    expected = np.zeros(shape)
    for channel, share in (("R", 0.5), ("G", 1.0), ("B", 0.4)):
        expected[mask(cfa, channel, shape)] = share * level_e
    electrons = rng.poisson(expected) + 2.0 * rng.standard_normal(shape)
    return raw_image(np.rint(electrons + 100), cfa, read_noise_e=2.0, dsnu_e=0.0)


def test_non_local_means_are_those_of_the_interleaved_camera() -> None:
    image = raw(BAYER)
    planes = np.asarray(reconstruct(image), dtype=np.float64)
    picture = PROCESSORS["bayer_nlm"].develop(image, np.eye(3), balance=[0.5, 1.0, 0.4])
    assert picture.rgb == pytest.approx(planes / [0.5, 1.0, 0.4], rel=1e-12)


@pytest.mark.parametrize("cfa", BAYER_PHASES)
@pytest.mark.parametrize("shape", [(33, 38), (70, 64)])
def test_a_denoiser_that_does_nothing_gives_the_mosaic_back(
    cfa: Tile, shape: tuple[int, int], monkeypatch: pytest.MonkeyPatch
) -> None:
    # then only the unbiased inverse is left, 1/4 e- over the algebraic one and 3/8 (root^-1), 11/8 / root^2 of it less
    seen = []

    def nothing(planes: np.ndarray, sigma: float, profile: object) -> np.ndarray:
        seen.append((planes.shape, sigma, planes.copy()))
        return planes

    library = SimpleNamespace(bm3d=nothing, BM3DProfile=SimpleNamespace)
    monkeypatch.setattr(bayer_denoised, "optional_library", lambda name, extra: library)
    image = raw(cfa, shape)
    root = 2 * np.sqrt(image.electrons + 0.375 + image.dark_noise_e**2)
    correction = 0.25 + np.sqrt(1.5) / 4 / root - 1.375 / root**2 + 0.625 * np.sqrt(1.5) / root**3
    np.testing.assert_allclose(bm3d_mosaic(image), image.electrons + correction, rtol=0, atol=1e-9)
    ((size, sigma, mixed),) = seen
    assert (size, sigma) == ((max(-(-shape[0] // 2), 32), max(-(-shape[1] // 2), 32), 4), 1.0)
    assert mixed[..., 0].mean() == pytest.approx(2 * root.mean(), rel=0.01)  # mean of four sites, times 2
    assert np.std(mixed[..., 1:], axis=(0, 1)) == pytest.approx(np.ones(3), rel=0.15)  # still units of noise


def test_bm3d_takes_most_of_the_noise_of_a_flat_field_and_no_light() -> None:
    pytest.importorskip("bm3d", reason="rodcone[bm3d], whose licence excludes commercial use, is not installed")
    pytest.importorskip("colour_demosaicing", reason="rodcone[opponents] is not installed")
    image = raw(("GB", "RG"), (64, 64))
    picture = PROCESSORS["bayer_bm3d"].develop(image, np.eye(3), balance=[0.5, 1.0, 0.4])
    # 4096 samples: the mean of each colour is known to sigma / sqrt(n), and 5 of these allow 1 false alarm in 6e5
    for index, (share, count) in enumerate(((0.5, 1024), (1.0, 2048), (0.4, 1024))):
        sigma = np.sqrt(share * 400.0 + image.dark_noise_e**2) / share
        assert abs(picture.rgb[..., index].mean() - 400.0) <= 5 * sigma / np.sqrt(count)
        assert picture.rgb[..., index].std() < 0.25 * sigma  # 16 samples averaged at the least
