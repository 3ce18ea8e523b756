"""What of a mosaic lies where: cells, patches, and the samples beyond the frame."""

import numpy as np
import pytest

from isp.ple import mosaic
from isp.ple.curve import over_black
from isp.ple.prior import LETTERS, PATCH
from isp.ple.units import readings, transform
from sensor.cfa import BAYER, MOSAICS, RGBW, channel_map
from sensor.raw import RawImage

TILES = [RGBW, BAYER, *(MOSAICS[name] for name in ("rgbw_4x4", "quad_bayer", "quad_rgbw", "mono"))]
TILES += [("RRGG", "GGBB"), ("RGGR", "GBBG", "GBBG", "RGGR"), ("WWWW", "WWWW", "WWWR", "WWGB")]
WHITE_E = np.array([0.5, 1.0, 0.45, 4.9])


def white(tile, shape) -> RawImage:
    """Frame of white at 1 electron of green, without noise."""
    electrons = WHITE_E[np.vectorize(LETTERS.index)(channel_map(tile, shape))]
    return RawImage(electrons, tile, 0.0, 1e4, 1.0, 1.5, 0.0, 0.0, 0.01)


def test_each_patch_of_pixels_has_the_sampling_of_its_phase():
    for tile in TILES:
        numbers = np.vectorize(LETTERS.index)(channel_map(tile, (20, 20)))
        raw = white(tile, (20, 20))
        scale = mosaic.scale_of_pixels(raw, WHITE_E, raw.electrons.astype(np.float32), np.zeros(raw.shape, bool))
        wide, _ = mosaic.pad_mosaic(tile, numbers, numbers)
        for i, j in np.ndindex(10, 10):
            patch = wide[2 * i : 2 * i + PATCH, 2 * j : 2 * j + PATCH]
            rows = np.array(scale.samplings[i % len(scale.samplings)][j % len(scale.samplings[0])].rows)
            assert np.array_equal(rows // 4, np.arange(PATCH**2)), tile
            assert np.array_equal(rows % 4, patch.ravel()), tile
        assert len({sampling for row in scale.samplings for sampling in row}) <= 4, tile


def test_a_full_w_is_a_bound_beside_g_alone():
    for tile, some in [(RGBW, True), (("GW",), True), (("W",), False), (("RW",), False)]:
        raw = RawImage(np.full((8, 8), 500.0), tile, 0.0, 400.0, 1.0, 1.5, 0.0, 0.0, 0.01)
        assert mosaic.full_white(raw).any() == some, (tile, some)


# Readings in units of noise: their curves beside drawn samples, and the way back to electrons.


DRAWS, SIGMAS = 400_000, 4.5


@pytest.mark.sample(4)
@pytest.mark.parametrize("dark_e", [0.0, 0.3, 1.8, 14.0])
@pytest.mark.parametrize("electrons", [0.0, 0.1, 1.0, 10.0, 300.0, 10_000.0])
def test_mean_and_variance_of_a_reading_are_those_of_drawn_samples(dark_e, electrons):
    rng = np.random.default_rng(1)
    drawn = transform(rng.poisson(electrons, DRAWS) + rng.normal(0.0, dark_e, DRAWS), dark_e)
    curves, expected = readings(dark_e), np.array(electrons)
    error = SIGMAS * drawn.std() / np.sqrt(DRAWS)
    assert curves.mean(expected) == pytest.approx(drawn.mean(), abs=error + 2e-4)
    # 2 % in the middle, where the distribution of X is told by its first three moments
    assert curves.variance(expected) == pytest.approx(drawn.var(), rel=0.02, abs=1e-9)


@pytest.mark.parametrize("dark_e", [0.0, 0.3, 1.8, 14.0])
def test_electrons_are_those_whose_mean_reading_it_is_and_the_slope_is_the_curves(dark_e):
    curves, electrons = readings(dark_e), np.geomspace(0.05, 20_000.0, 60)
    # curves are looked up at the nearest step: to 1 % of the dark noise
    error_e = max(4e-3, 0.01 * dark_e)
    assert curves.electrons(curves.mean(electrons)) == pytest.approx(electrons, rel=1e-3, abs=error_e)
    electrons = np.geomspace(1.0, 100.0, 30) * max(dark_e, 1.0) ** 2
    step = 0.1 * electrons
    slope = (curves.mean(electrons + step) - curves.mean(electrons - step)) / (2 * step)
    assert curves.slope(electrons) == pytest.approx(slope, rel=0.02)


def test_electrons_fall_with_the_reading_under_that_of_no_light_to_minus_the_dark_noise_squared():
    least = readings(1.8).electrons(np.linspace(-3.0, 7.5, 50))
    assert np.all(np.diff(least) >= 0.0)
    assert least[0] > -14.0


def test_channels_side_by_side_read_over_black_as_by_the_curve_of_each():
    dark_e, electrons = (0.5, 1.8, 6.0, 30.0), np.geomspace(0.05, 20_000.0, 60)
    roots = np.repeat(2.0 * np.sqrt(electrons), 4).reshape(3, -1).astype(np.float32)
    expected = [readings(noise_e).mean(electrons) - readings(noise_e).mean(np.zeros(1)) for noise_e in dark_e]
    over = over_black(roots.copy(), dark_e).reshape(-1, 4).T
    assert over == pytest.approx(np.array(expected), rel=1e-4, abs=1e-3)
    assert over_black(-roots, dark_e) == pytest.approx(0.0, abs=1e-4)
