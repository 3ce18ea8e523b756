"""The whole reconstruction: flat fields, lamps, full samples, threads, and frames of any size."""

from dataclasses import replace

import numpy as np
import pytest
from builders import raw_image

from isp.ple import estimate, mosaic, overlap, pyramid, tables
from isp.ple.prior import LETTERS, PATCH, own_prior
from rodcone.colour_spaces import encode_srgb, luminance_of_srgb
from sensor.cfa import BAYER, MOSAICS, RGBW, channel_map, channels
from sensor.raw import RawImage

FULL_E, NOISE_E = 15_000.0, 1.5
RGBW_4X4, QUAD_BAYER, QUAD_RGBW = (MOSAICS[name] for name in ("rgbw_4x4", "quad_bayer", "quad_rgbw"))
UNEVEN = ("WWWW", "WWWW", "WWWR", "WWGB")  # four Ws in one cell of 2x2, one in another
TILES = [RGBW, BAYER, RGBW_4X4, QUAD_BAYER, QUAD_RGBW, UNEVEN, ("W",), ("RGBW", "WBGR")]


def reconstruct(raw):
    return pyramid.reconstruct(raw, own_prior(), own_prior().neutral_e)


def exposure(expected_e, tile, rng) -> RawImage:
    """Poisson, the well, then Gaussian noise; not rounded."""
    held = np.minimum(rng.poisson(expected_e), FULL_E) + rng.normal(0, NOISE_E, expected_e.shape)
    return RawImage(held + 200, tile, 200.0, 200 + FULL_E, 1.0, NOISE_E, 0.0, 0.0, 0.01)


def grey(level_e, tile, shape=(96, 96)):
    """Expected electrons of a grey scene whose green collects `level_e`."""
    share = own_prior().neutral_e[np.vectorize(LETTERS.index)(channel_map(tile, shape))]
    return np.broadcast_to(level_e, shape) * share


@pytest.mark.sample(1)
@pytest.mark.parametrize("tile", TILES)
@pytest.mark.parametrize("level_e", [0.01, 0.3, 10.0, 300.0, 10_000.0])
def test_a_flat_field_keeps_its_mean(tile, level_e):
    # at 10 000 e- W is full, and nothing is asked of it
    planes, _ = reconstruct(exposure(grey(level_e, tile), tile, np.random.default_rng(4)))
    for name, plane in zip(channels(tile), np.moveaxis(planes, -1, 0), strict=True):
        expected = own_prior().neutral_e[LETTERS.index(name)] * level_e
        if expected < FULL_E:
            samples = plane.size * "".join(tile).count(name) / len("".join(tile))
            error = np.sqrt((expected + NOISE_E**2 + 1 / 12) / samples)
            assert abs(plane.mean() - expected) < max(0.005 * expected, 4 * error), name


@pytest.mark.parametrize(("tile", "level_e", "most"), [(BAYER, 1.0, 2), (BAYER, 3.0, 6), (RGBW, 1.0, 11)])
def test_a_sample_far_under_0_leaves_no_dark_speck(tile, level_e, most):
    # One sample in 128 lies 4.5 dark noises under 0, on every site of the tile. A speck is a pixel whose encoded
    # luminance is more than 0.25 under the flat field's, as bright as a scene's grey at 0.05 cd/m2. Without a floor
    # under the readings 24 to 33, 50 to 74 and 111 to 117 of them.
    rng, shape, neutral = np.random.default_rng(3), (128, 128), own_prior().neutral_e[:3]
    raw = exposure(grey(level_e, tile, shape), tile, rng)
    low = raw.dn.copy()
    for row, column in ((8, 9), (24, 8), (9, 1), (25, 0)):
        low[row::32, column::16] = 200 - 4.5 * NOISE_E
    planes = reconstruct(replace(raw, dn=low))[0][..., :3] / neutral
    shown, truth = (encode_srgb(luminance / (3.5 * level_e)) for luminance in (luminance_of_srgb(planes), level_e))
    assert np.count_nonzero(shown < truth - 0.25) <= most


@pytest.mark.parametrize("tile", [BAYER, RGBW])
def test_thin_black_lines_in_grey_are_as_dark_as_the_root_of_the_signal_says(tile):
    # Three pixels wide, of 2 %: along a component's straight line they fall under 0 (errors of 0.13 and 0.14).
    lines = (np.arange(96) % 12 < 3) | (np.arange(96)[:, None] % 11 < 3)
    truth, grey_e, noise_e = np.where(lines, 0.02, 1.0), 1500.0, 30.0
    rng, expected_e = np.random.default_rng(5), grey(grey_e, tile) * truth
    held = rng.poisson(expected_e) + rng.normal(0, noise_e, truth.shape)
    raw = RawImage(held + 200, tile, 200.0, 200 + FULL_E, 1.0, noise_e, 0.0, 0.0, 0.01)
    shown = reconstruct(raw)[0][..., :3] / own_prior().neutral_e[:3] / grey_e
    error = encode_srgb(shown) - encode_srgb(truth)[..., None]
    assert np.sqrt(np.square(error[lines]).mean()) < 0.105


@pytest.mark.sample(1)
def test_black_beside_grey_stays_black_behind_noise_of_the_1_e_and_of_the_30_e_kind():
    # Squares of 8 pixels, black of 5 %: where samples say what is dark, it isn't lifted (8.9 % by 30 e- once).
    squares = np.kron(np.indices((12, 12)).sum(axis=0) % 2, np.ones((8, 8)))
    inside = np.kron(np.ones((12, 12)), np.pad(np.ones((4, 4)), 2)) * (1 - squares) > 0
    neutral = own_prior().neutral_e[:3]
    for noise_e, grey_e in ((NOISE_E, 40.0), (30.0, 300.0)):
        rng, expected_e = np.random.default_rng(5), grey(grey_e, BAYER) * (0.05 + 0.95 * squares)
        held = rng.poisson(expected_e) + rng.normal(0, noise_e, expected_e.shape)
        raw = RawImage(held + 200, BAYER, 200.0, 200 + FULL_E, 1.0, noise_e, 0.0, 0.0, 0.01)
        black = (reconstruct(raw)[0] / neutral)[inside].mean()
        assert black < 0.07 * grey_e


@pytest.mark.thorough
@pytest.mark.parametrize("tile", [RGBW, BAYER, RGBW_4X4, QUAD_BAYER, QUAD_RGBW])
@pytest.mark.parametrize("side", [1, 4])
def test_a_lamp_in_the_dark_has_no_frame_around_it(tile, side):
    # Frames alike but for the lamp, which lies on each site of a 2x2 tile in turn, and on four of a 4x4 one. No coarse
    # scale helps beside it, and a patch's own 16 Ws, or 32 greens, are what its estimate rests on.
    moved = []
    for seed in range(4):
        at = (32 + seed % 2, 32 + seed // 2) if len(tile) == 2 else (32 + seed, 32 + 5 * seed % 4)
        rng = np.random.default_rng(seed)
        raw = exposure(np.full((64, 64), 0.1), tile, rng)
        lit = raw.dn.copy()
        lit[at[0] : at[0] + side, at[1] : at[1] + side] = 200 + FULL_E + rng.normal(0, NOISE_E, (side, side))
        without, within = (reconstruct(each)[0] for each in (raw, replace(raw, dn=lit)))
        moved.append(np.roll(within - without, (-at[0], -at[1]), axis=(0, 1)))
    lines = np.arange(64)
    away = np.where(lines < side, 0, np.minimum(lines - side + 1, 64 - lines))
    beyond = np.maximum(away[:, None], away) > 3
    mean = np.mean(moved, axis=0)[beyond]
    assert np.abs(mean).max() < 4.5 * NOISE_E / np.sqrt(16 * len(moved))
    assert np.abs(mean.mean(axis=0)).max() < 0.05


@pytest.mark.sample(1)
@pytest.mark.parametrize("tile", [RGBW, RGBW_4X4, QUAD_RGBW])
def test_a_full_sample_is_a_lower_bound(tile):
    # W fills along a ramp, in the middle of patches; above, the colours say how far
    ramp = np.linspace(1500, 6000, 96)
    raw = exposure(grey(ramp, tile), tile, np.random.default_rng(5))
    planes, variance = reconstruct(raw)
    full = raw.saturated & (channel_map(tile, raw.shape) == "W")
    assert 0.2 < full.mean() * len("".join(tile)) / "".join(tile).count("W") < 0.88
    least = FULL_E - 4 * np.sqrt(variance[3] * FULL_E)
    assert (planes[full][:, 3] > least).mean() > 0.999
    above = planes[..., 3][:, ramp > 4500].mean(axis=0)
    assert above == pytest.approx(own_prior().neutral_e[3] * ramp[ramp > 4500], rel=0.1)


@pytest.mark.thorough
def test_threads_change_nothing(monkeypatch):
    raw = exposure(grey(np.linspace(1, 200, 128), RGBW, (96, 128)), RGBW, np.random.default_rng(7))
    monkeypatch.setattr(estimate, "TOGETHER", 500)
    found = []
    for count in (1, 3):
        monkeypatch.setattr(estimate, "cpu_count", lambda count=count: count)
        found.append(reconstruct(raw)[0])
    assert np.array_equal(*found)


def test_within_one_frame_the_result_is_the_same():
    raw = exposure(grey(np.linspace(1, 200, 32), RGBW, (16, 32)), RGBW, np.random.default_rng(7))
    planes, _ = reconstruct(raw)
    made = tables.table.cache_info().currsize
    with tables.one_frame():
        again, _ = reconstruct(raw)
        assert np.array_equal(again, planes)
    assert tables.table.cache_info().currsize == made
    assert np.array_equal(reconstruct(raw)[0], planes)


@pytest.mark.sample(5)
@pytest.mark.parametrize("shape", [(2, 2), (3, 5), (9, 16), (16, 9), (31, 33)])
@pytest.mark.parametrize("tile", [RGBW, RGBW_4X4, QUAD_RGBW])
def test_any_size_of_frame_will_do(tile, shape):
    shape = np.maximum(shape, len(tile))
    planes, _ = reconstruct(raw_image(np.full(shape, 600), tile))
    assert planes.shape == (*shape, 4)
    assert np.isfinite(planes).all()


@pytest.mark.sample(6)
@pytest.mark.parametrize("tile", TILES)
@pytest.mark.parametrize(("stride", "size"), [(1, PATCH), (2, mosaic.CELLS)])
def test_a_patchs_own_light_is_the_frames_up_to_its_border_and_varies_as_stated(tile, stride, size):
    level_e, shape, white_e = 50.0, (61, 54), own_prior().neutral_e
    means = []
    for raw in (
        replace(exposure(np.ones(shape), tile, np.random.default_rng(1)), dn=200 + grey(level_e, tile, shape)),
        *(exposure(grey(level_e, tile, shape), tile, np.random.default_rng(seed)) for seed in range(40)),
    ):
        cells = mosaic.pyramid(raw, white_e, raw.electrons.astype(np.float32), np.zeros(shape, bool))[0]
        sides = pyramid._sides(shape, cells.full.shape, PATCH)
        sides = sides if size == PATCH else [overlap.border(length, size) for length in cells.full.shape[:2]]
        light = pyramid._light_of_sums(cells, sides, stride)
        means.append(light.mean)
    assert means[0] == pytest.approx(np.full(means[0].shape, level_e), rel=1e-5)
    inside = (slice(4, -4), slice(4, -4))
    stated = (light.shot * level_e + light.floor)[inside].mean()
    # patches overlap: one in sixteen is counted, in 40 frames
    draws = 40 * means[0][inside].size / 16
    assert np.var(means[1:], axis=0)[inside].mean() * 40 / 39 == pytest.approx(stated, rel=4.5 * np.sqrt(2 / draws))


@pytest.mark.thorough
@pytest.mark.parametrize("tile", [RGBW, BAYER])
@pytest.mark.parametrize("times", [(2, 2), (2, 1), (1, 2)])
def test_a_tile_written_twice_is_the_same_mosaic(tile, times):
    level_e = np.geomspace(0.1, 5000, 61) * np.linspace(0.5, 1, 47)[:, None]
    raw = exposure(grey(level_e, tile, (47, 61)), tile, np.random.default_rng(8))
    twice = replace(raw, cfa=tuple(row * times[1] for row in tile) * times[0])
    for once, again in zip(reconstruct(raw), reconstruct(twice), strict=True):
        assert np.array_equal(once, again)


@pytest.mark.thorough
@pytest.mark.parametrize("shift", [(1, 0), (2, 3)])
def test_a_4x4_mosaic_that_begins_elsewhere_gives_as_good_a_picture(shift):
    # the same samples, less the first rows and columns: patches and cells fall on other phases
    level_e = np.geomspace(20, 500, 67) * (1 + 0.5 * np.sin(np.arange(67)[:, None] / 3))
    expected_e = grey(level_e, QUAD_RGBW, (67, 67))
    raw = exposure(expected_e, QUAD_RGBW, np.random.default_rng(9))
    moved = tuple("".join(row) for row in np.roll([list(row) for row in QUAD_RGBW], (-shift[0], -shift[1]), (0, 1)))
    later = replace(raw, dn=raw.dn[shift[0] :, shift[1] :], cfa=moved)
    green = [planes[..., 1] for planes, _ in map(reconstruct, (raw, later))]
    error = [
        (each - level_e[-len(each) :, -each.shape[1] :]) / level_e[-len(each) :, -each.shape[1] :] for each in green
    ]
    assert error[1][8:-8, 8:-8].std() == pytest.approx(error[0][shift[0] :, shift[1] :][8:-8, 8:-8].std(), rel=0.1)
