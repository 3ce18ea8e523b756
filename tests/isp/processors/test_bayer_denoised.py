"""Bayer with a denoiser: non-local means as they are; demosaicking first is right but for the denoiser."""

from types import SimpleNamespace

import numpy as np
import pytest
from builders import BAYER_PHASES, mosaic_of, raw_image

from isp.interleaved import reconstruct
from isp.processors import sub_images
from isp.processors.bayer_denoised import NOISE_AFTER_DEMOSAICKING
from isp.processors.catalogue import PROCESSORS
from sensor.cfa import BAYER, Tile
from sensor.raw import RawImage

SHARES = {"R": 0.5, "G": 1.0, "B": 0.4}


def expected_e(cfa: Tile, shape: tuple[int, int], level_e: float) -> np.ndarray:
    """Electrons of a neutral field: G at the level, R at a half, B at 0.4 of it."""
    return level_e * mosaic_of(SHARES, cfa, shape)


def exposure(electrons: np.ndarray, cfa: Tile) -> RawImage:
    return raw_image(np.rint(electrons + 100), cfa, read_noise_e=2.0, dsnu_e=0.0)


def test_non_local_means_are_those_of_the_interleaved_camera() -> None:
    expected = expected_e(BAYER, (33, 38), 400.0)
    rng = np.random.default_rng(1)
    image = exposure(rng.poisson(expected) + 2.0 * rng.standard_normal(expected.shape), BAYER)
    planes = np.asarray(reconstruct(image), dtype=np.float64)
    picture = PROCESSORS["bayer_nlm"].develop(image, np.eye(3), balance=[0.5, 1.0, 0.4])
    assert picture.rgb == pytest.approx(planes / [0.5, 1.0, 0.4], rel=1e-12)


@pytest.mark.parametrize("cfa", BAYER_PHASES)
def test_demosaicked_first_the_denoiser_sees_opponent_planes_and_what_their_noise_is(
    cfa: Tile, monkeypatch: pytest.MonkeyPatch
) -> None:
    # One that does nothing gives the light back, less what the unbiased inverse adds to a noise-free sample: 1/4 e-.
    seen = []

    def nothing(planes: np.ndarray, sigma: list[float], profile: object) -> np.ndarray:
        seen.append((planes, sigma))
        return planes

    library = SimpleNamespace(bm3d=nothing, BM3DProfile=SimpleNamespace)
    monkeypatch.setattr(sub_images, "optional_library", lambda name, extra: library)
    image = exposure(expected_e(cfa, (34, 38), 1000.0), cfa)
    picture = PROCESSORS["bayer_residual_bm3d"].develop(image, np.eye(3), balance=[0.5, 1.0, 0.4])
    for index, gain in enumerate((2.0, 1.0, 2.5)):
        assert picture.rgb[..., index] == pytest.approx(1000.0 + gain / 4, abs=0.05)
    ((planes, sigma),) = seen
    # 2 sqrt(1000 + gain (3/8 + 4)) in each, mean times sqrt(3): the two differences are a thousandth of it
    assert planes[..., 0] == pytest.approx(np.sqrt(3) * 2 * np.sqrt(1008.0), rel=1e-3)
    assert np.abs(planes[..., 1:]).max() < 0.15
    variances = np.array([(2 + 1 + 2.5) / 3, (2 + 2.5) / 2, (2 + 4 + 2.5) / 6])
    assert sigma == pytest.approx(NOISE_AFTER_DEMOSAICKING * np.sqrt(variances))
