"""Colours between their samples: lines of the guide, what stays as it is, strips, and strong colours of a mosaic."""

import numpy as np
import pytest

from isp.ple import pyramid, residual_lines
from isp.ple.prior import own_prior
from sensor.cfa import BAYER, MOSAICS, RGBW, Tile, channels, mask
from sensor.raw import RawImage


def planes_of(tile: Tile, shape: tuple[int, int] = (71, 62)) -> np.ndarray:
    rng = np.random.default_rng(8)
    return rng.uniform(50, 500, (*shape, len(channels(tile)))).astype(np.float32)


def coloured(values: np.ndarray) -> np.ndarray:
    """A light that isn't grey, whatever the values."""
    return np.float64(values) * np.linspace(1.0, 2.0, values.shape[-1])


def test_a_colour_that_is_a_line_of_the_guide_is_that_line_whatever_the_estimate_said():
    planes = planes_of(RGBW)
    names, white = channels(RGBW), planes[..., 3].copy()
    for c, name in enumerate(names[:3]):
        planes[..., c] = np.where(mask(RGBW, name, white.shape), (0.5, 1.0, 0.2)[c] * white + 30, planes[..., c])
    residual_lines.blend_with_lines(planes, RGBW, np.ones(4), [0.0] * 4, coloured)
    for c, (slope, least) in enumerate(((0.5, 30), (1.0, 30), (0.2, 30))):
        np.testing.assert_allclose(planes[..., c], slope * white + least, atol=2.0)


def test_an_estimate_stays_where_neighbouring_samples_say_opposites():
    # Samples of R alternate by 200, so their means say 300 of every pixel between, and nobody knows.
    planes = planes_of(RGBW)
    y, x = np.indices(planes.shape[:2]) // 2
    planes[..., 3], planes[..., 0] = 500, np.where(mask(RGBW, "R", y.shape), 200 + 200 * ((x + y) % 2), 310)
    residual_lines.blend_with_lines(planes, RGBW, np.ones(4), [0.0] * 4, coloured)
    inside = np.s_[8:-8, 8:-8]
    np.testing.assert_allclose(planes[..., 0][inside][~mask(RGBW, "R", y.shape)[inside]], 310, atol=0.2)


@pytest.mark.parametrize("tile", [RGBW, BAYER])
def test_samples_and_guide_stay_and_strips_change_nothing(monkeypatch, tile):
    planes = planes_of(tile)
    before, twice = planes.copy(), planes.copy()
    residual_lines.blend_with_lines(planes, tile, np.ones(4), [0.0] * 4, coloured)
    kept = np.stack([mask(tile, name, planes.shape[:2]) for name in channels(tile)], axis=-1)
    kept[..., channels(tile).index("W" if tile is RGBW else "G")] = True
    np.testing.assert_array_equal(planes[kept], before[kept])
    assert not np.any(planes[~kept] == before[~kept])
    monkeypatch.setattr(residual_lines, "TOGETHER", 20)
    residual_lines.blend_with_lines(twice, tile, np.ones(4), [0.0] * 4, coloured)
    np.testing.assert_array_equal(twice, planes)


@pytest.mark.parametrize("tile", [MOSAICS["quad_rgbw"], MOSAICS["rgbw_4x4"], ("W",), ("RB", "BR")])
def test_mosaics_without_a_guide_or_a_colour_on_one_site_are_left_alone(tile):
    planes = planes_of(tile)
    before = planes.copy()
    residual_lines.blend_with_lines(planes, tile, np.ones(4), [0.0] * 4, coloured)
    np.testing.assert_array_equal(planes, before)


@pytest.mark.parametrize("tile", [RGBW, BAYER])
def test_the_estimate_stays_where_the_light_is_grey(tile):
    planes = planes_of(tile)
    before = planes.copy()
    residual_lines.blend_with_lines(planes, tile, np.ones(4), [0.0] * 4, lambda values: np.full(values.shape, 7.0))
    np.testing.assert_array_equal(planes, before)


def test_fine_grey_stripes_are_as_near_to_the_truth_as_the_prior_takes_them(monkeypatch):
    # A zone plate whose rings are as fine as the pixels: lines alone make it 7 dB worse.
    y, x = np.indices((512, 512)) / 4 - 64.3
    light = (0.5 + 0.45 * np.cos(np.pi * (x**2 + y**2) / 116)).reshape(128, 4, 128, 4).mean(axis=(1, 3))
    neutral_e = own_prior().neutral_e
    truth = 2000 * light[..., None] * neutral_e
    held = sum(mask(BAYER, name, light.shape) * truth[..., "RGBW".index(name)] for name in channels(BAYER))
    raw = RawImage(np.random.default_rng(3).poisson(held) + 200.0, BAYER, 200.0, 60_000.0, 1.0, 1.5, 0.0, 0.0, 0.01)
    errors = []
    for step in (residual_lines.blend_with_lines, lambda *_: None):
        monkeypatch.setattr(pyramid, "blend_with_lines", step)
        planes, _ = pyramid.reconstruct(raw, own_prior(), neutral_e)
        errors.append(np.mean(((planes - truth[..., :3]) / neutral_e[:3]) ** 2))
    assert errors[0] < 1.15 * errors[1]


RED, BLUE, GREEN, GREY, BLACK = (1, 0.1, 0.1, 0.4), (0.1, 0.2, 0.9, 0.35), (0.1, 0.8, 0.1, 0.5), (0.5,) * 4, (0.05,) * 4


@pytest.mark.parametrize(("tile", "other"), [(BAYER, BLUE), (BAYER, GREEN), (BAYER, GREY), (RGBW, BLACK)])
def test_slanted_stripes_of_strong_colours_are_nearer_to_the_truth(monkeypatch, tile, other):
    # Root mean square error beside that of the prior's own estimate.
    y, x = np.indices((384, 384)) / 4
    surfaces = 2000 * np.array([RED, other]) * own_prior().neutral_e
    truth = surfaces[((3 * x + y) // 24 % 2).astype(int)].reshape(96, 4, 96, 4, 4).mean(axis=(1, 3))
    names = channels(tile)
    truth = truth[..., ["RGBW".index(name) for name in names]]
    held = sum(mask(tile, name, (96, 96)) * truth[..., c] for c, name in enumerate(names))
    held = np.random.default_rng(2).poisson(held)
    raw = RawImage(held + 200.0, tile, 200.0, 60_000.0, 1.0, 1.5, 0.0, 0.0, 0.01)
    errors = []
    for step in (residual_lines.blend_with_lines, lambda *_: None):
        monkeypatch.setattr(pyramid, "blend_with_lines", step)
        planes, _ = pyramid.reconstruct(raw, own_prior(), own_prior().neutral_e)
        errors.append(np.sqrt(np.mean(((planes - truth)[..., :3] / own_prior().neutral_e[:3]) ** 2)))
    assert errors[0] < 0.93 * errors[1]


@pytest.mark.parametrize("tile", [BAYER, RGBW])
def test_dark_beside_bright_is_not_less_than_no_light(tile):
    red_e = own_prior().neutral_e * (1.0, 0.5, 0.4, 0.6)
    y, x = np.indices((64, 64)) - 31.4
    light = np.where(np.sin(18 * np.arctan2(y, x)) > 0, 300.0, 6.0)
    held = sum(mask(tile, name, light.shape) * red_e["RGBW".index(name)] for name in channels(tile))
    held = np.random.default_rng(1).poisson(light * held)
    raw = RawImage(held + 200.0, tile, 200.0, 60_000.0, 1.0, 1.5, 0.0, 0.0, 0.01)
    planes, _ = pyramid.reconstruct(raw, own_prior(), own_prior().neutral_e)
    assert planes.min() >= -1e-4
