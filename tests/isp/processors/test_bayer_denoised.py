"""Bayer with a denoiser: non-local means as they are; demosaicking first is right but for the denoiser."""

import sys
from itertools import product
from types import SimpleNamespace

import numpy as np
import pytest
from builders import BAYER_PHASES, RGBW_4X4, RGBW_PHASES, behind, mosaic_of, raw_image
from refusal import refusal
from skimage import data

from isp.colour.colour_fit import ColourFit
from isp.interleaved.reconstruction import reconstruct
from isp.processors import sub_images
from isp.processors.bayer_denoised import NOISE_AFTER_DEMOSAICKING
from isp.processors.catalogue import PROCESSORS
from isp.processors.demosaic import menon
from isp.processors.residual import REACH, residual_interpolation
from isp.processors.sub_images import Mix, bm3d_mosaic, hadamard, principal_components
from isp.substitution import PLANE_ERROR
from sensor.cfa import BAYER, Tile
from sensor.raw import RawImage
from studies.metrics.appearance import psnr_db

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
    balance = [0.5, 1.0, 0.4]
    planes = np.asarray(reconstruct(image, neutral=np.array(balance)), dtype=np.float64)
    picture = PROCESSORS["bayer_nlm"].develop(image, np.eye(3), balance=balance)
    assert picture.rgb == pytest.approx(planes / [0.5, 1.0, 0.4], rel=1e-12)


def test_its_colours_are_as_uncertain_without_noise_as_those_of_the_interleaved_camera() -> None:
    """Without noise the matrix is that of the error that is none, decision 0069; the plain camera's counts none."""
    rng = np.random.default_rng(3)
    signals, target = rng.uniform(0, 1, (30, 3)), rng.uniform(0, 1, (30, 3))
    fit = ColourFit(tuple("RGB"), signals.mean(axis=0), signals.T @ signals / 30, signals.T @ target / 30)
    image = raw_image(np.full((16, 16), 2100), BAYER, read_noise_e=0.0, dsnu_e=0.0, gain_e_per_dn=1e7)
    for name, error in (("bayer_nlm", PLANE_ERROR), ("bayer", 0.0)):
        shown = PROCESSORS[name].develop(image, fit, balance=[0.5, 1.0, 0.4]).rgb[8, 8]
        light = 2000 * 1e7
        assert shown == pytest.approx(fit.matrix(noise=error) @ [light / 0.5, light, light / 0.4], rel=1e-5), name


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


# Residual interpolation: pictures that its model describes come back, and padding reaches as far as it does.


def test_stripes_of_any_width_come_back_where_colours_are_linear_in_green() -> None:
    for turned, cfa in product([False, True], BAYER_PHASES):
        # Along the stripes green is known, the gradient there is 0; red and blue are then what the guide says,
        # everywhere.
        green = np.broadcast_to(np.random.default_rng(6).uniform(100, 1000, 46), (40, 46))
        picture = np.stack([0.5 * green + 100, green, 2 * green - 30], axis=-1)
        picture = picture.transpose(1, 0, 2) if turned else picture
        assert residual_interpolation(behind(picture, cfa), cfa) == pytest.approx(picture, abs=1e-6), (cfa, turned)


def test_samples_stay_what_they_are() -> None:
    for cfa in BAYER_PHASES:
        mosaic = np.random.default_rng(7).uniform(0, 1000, (37, 34))
        np.testing.assert_allclose(behind(residual_interpolation(mosaic, cfa), cfa), mosaic, rtol=0, atol=1e-9)


def test_darkness_beside_a_bright_lamp_stays_dark() -> None:
    # sums that run along the rows would leave some 1e-8 of the lamp's Laplacian behind, and divide by it
    mosaic = np.full((80, 96), 3.0)
    mosaic[40, 20] = 1e6
    planes = residual_interpolation(mosaic, ("RG", "GB"))
    assert planes[:, 20 + REACH + 1 :] == pytest.approx(np.full((80, 96 - 21 - REACH, 3), 3.0), abs=1e-9)


def test_a_lamp_in_the_dark_leaks_little_beyond_three_pixels() -> None:
    # 15 000 e- in a field of 0 +- 1.5 e-: windows averaged alike leave up to 340 e- there, weighted ones 6 at most
    dark = 1.5 * np.random.default_rng(8).standard_normal((64, 64))
    for size in (1, 2, 4):
        lit = dark.copy()
        lit[30 : 30 + size, 30 : 30 + size] = 15_000.0
        leaked = residual_interpolation(lit, ("RG", "GB")) - residual_interpolation(dark, ("RG", "GB"))
        leaked[27 : 33 + size, 27 : 33 + size] = 0.0
        assert np.abs(leaked).max() < 8.0


def test_on_photographs_it_is_ahead_of_menon_as_published() -> None:
    # The paper's own pictures come in no wheel; on these two it reads 39.1 dB, Menon 38.1 and 37.4.
    pytest.importorskip("colour_demosaicing", reason="rodcone[opponents] is not installed")
    for picture in (data.astronaut()[:256, :256] * 1.0, data.coffee()[:256, 100:356] * 1.0):
        mosaic = behind(picture, ("RG", "GB"))
        theirs, ours = (
            psnr_db(demosaic(mosaic, ("RG", "GB")) / 255, picture / 255) for demosaic in (menon, residual_interpolation)
        )
        assert ours > theirs + 0.5


# The way into a mosaic's sub-images and back, and what their principal components keep.


NEUTRAL = {"R": 0.5, "G": 1.0, "B": 0.4, "W": 5.0}


def raw(cfa: Tile, shape: tuple[int, int], level_e: float = 400.0) -> RawImage:
    """Poisson exposure of a neutral field with 2 e- of read noise, green at the level."""
    rng = np.random.default_rng(1)
    electrons = rng.poisson(level_e * mosaic_of(NEUTRAL, cfa, shape)) + 2.0 * rng.standard_normal(shape)
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
