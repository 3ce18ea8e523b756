"""Strong edges: one share for all channels from the pixel's own sample, and no colour for lamps smaller than 2 x 2."""

from itertools import product

import numpy as np
import pytest
from builders import RGBW_4X4, RGBW_PHASES, raw_image

from isp.colour import edges
from isp.colour.edges import even_edges
from isp.kernel import edges as kernel
from isp.pipeline import picture_interleaved
from rodcone.jit import backend
from sensor.cfa import RGBW, channels, mask, quad

DARK_E, LIGHT_E = np.array([10.0, 30.0, 8.0, 100.0]), np.array([1510.0, 3030.0, 1408.0, 10_100.0])
OPEN, MIXED = np.zeros((16, 16)), np.full((16, 16), 0.5)
MISPLACED = np.array([0.0, 0.9, 0.1, 1.0])


@pytest.fixture(autouse=True, params=["kernel", "numpy"])
def engine(request, monkeypatch):
    """Everything holds for both engines."""
    if request.param == "numpy":
        monkeypatch.setattr(edges, "backend", lambda: "numpy")
    elif backend() == "numpy":
        pytest.skip("needs LLVM or CUDA")
    return request.param


def frame(planes, tile=RGBW):
    """What the mosaic reads of a picture's channels."""
    electrons = np.zeros(planes.shape[:2])
    for index, name in enumerate(channels(tile)):
        electrons += np.where(mask(tile, name, electrons.shape), planes[..., index], 0.0)
    return raw_image(np.rint(electrons) + 100, tile)


def edge(shares, light_e=LIGHT_E):
    """Dark on the left, light on the right, and in column 8 each channel's own share of both."""
    planes = np.broadcast_to(DARK_E, (16, 16, 4)).copy()
    planes[:, 9:] = light_e
    planes[:, 8] = DARK_E + np.asarray(shares) * (light_e - DARK_E)
    return planes


def test_every_channel_gets_the_share_of_the_pixel_s_own_sample():
    """The picture, in whole electrons, comes back exactly up to the border, though each plane has its own edge."""
    for tile in [*RGBW_PHASES, RGBW_4X4, quad(RGBW)]:
        truth = edge([0.4] * 4)
        even = even_edges(frame(truth, tile), edge(MISPLACED), np.ones(4), OPEN)
        assert even == pytest.approx(truth, rel=1e-5), tile


def test_where_w_is_full_the_neighbours_tell_along_the_edge():
    """Across, shares are 0 and 1; along, 0.4: (2 (1 + s) 0.4 + s 1) / (2 (1 + s) + 2 s) with s = 0.001."""
    for tile in RGBW_PHASES:
        light_e = np.array([1510.0, 3030.0, 1408.0, 15_000.0])
        raw = frame(edge([0.4] * 4, light_e), tile)
        even = even_edges(raw, edge(MISPLACED, light_e), np.ones(4), np.ones((16, 16)))
        shares = ((even[:, 8] - DARK_E) / (light_e - DARK_E))[:, :3]
        filled = (2 * 1.001 * 0.4 + 0.001) / (2 * 1.001 + 0.002)
        expected = np.where(mask(tile, "W", (16, 16))[:, 8:9], filled, 0.4)
        assert shares == pytest.approx(np.broadcast_to(expected, (16, 3)), abs=1e-5), tile


def test_a_channel_of_little_contrast_has_no_say():
    """Green rises by 1200 of 4000 e-, at another place; red gets the others' 0.4 at green's pixels as well."""
    for tile in RGBW_PHASES:
        dark_e, light_e = np.array([10.0, 2800.0, 8.0, 100.0]), np.array([1510.0, 4000.0, 1408.0, 10_100.0])
        truth, planes = (
            np.where(np.arange(16)[:, None] < 8, dark_e, light_e)[None].repeat(16, axis=0) for _ in range(2)
        )
        truth[:, 8], planes[:, 8] = (
            dark_e + np.array(t) * (light_e - dark_e) for t in ([0.4, 0.9, 0.4, 0.4], MISPLACED)
        )
        even = even_edges(frame(truth, tile), planes, np.ones(4), OPEN)
        assert even[2:-2, 8, 0] == pytest.approx(610.0, rel=2e-3), tile  # 2 in 1000 of what lies across


def test_a_channel_whose_contrast_is_noise_stays():
    dark_e, light_e = np.array([10.0, 30.0, 1000.0, 100.0]), np.array([1510.0, 3030.0, 1090.0, 10_100.0])  # 2.7 sigmas
    planes = np.where(np.arange(16)[:, None] < 8, dark_e, light_e)[None].repeat(16, axis=0)
    truth = planes.copy()
    truth[:, 8] = dark_e
    even = even_edges(frame(truth), planes, np.ones(4), OPEN)
    assert np.array_equal(even[..., 2], planes[..., 2])
    assert even[:, 8, :2] == pytest.approx(truth[:, 8, :2], abs=3.0)


def test_where_samples_lie_on_their_planes_no_edge_was_missed():
    for alpha in [0.0, 1.0]:
        planes = edge(MISPLACED)
        even = even_edges(frame(planes), planes, np.ones(4), np.full((16, 16), alpha))
        assert even == pytest.approx(planes, rel=1e-6), alpha


def test_contrast_within_the_noise_changes_nothing():
    noise = np.random.default_rng(0).normal(0.0, 0.2 * np.sqrt(1000.0), (16, 16, 4))  # 3 sigmas apart: once in 10^20
    planes = 1000.0 + noise
    raw = frame(planes + np.random.default_rng(1).normal(0.0, np.sqrt(1000.0), (16, 16, 4)))
    assert np.array_equal(even_edges(raw, planes, np.ones(4), OPEN), planes.astype(np.float32))


def test_a_sample_s_own_noise_beside_a_lamp_is_not_drawn():
    """A hundred times the sample's noise is the lamp's; in the dark beside it the planes stay, for they hold less."""
    light_e = np.array([4000.0, 4000.0, 4000.0, 4000.0])
    planes = edge([0.0] * 4, light_e)
    raw = frame(planes + np.random.default_rng(1).normal(0.0, 0.9, (16, 16, 4)) * (planes < 1000.0))  # noise 1.4 e-
    even = even_edges(raw, planes, np.ones(4), OPEN)
    assert even[:, :9] == pytest.approx(planes[:, :9], rel=1e-5)


def test_in_rims_light_of_fewer_than_2_x_2_pixels_stays_where_it_is():
    """A lamp of 5 x 1 on sites of B and W; in rims that took the colours' mean share it was a block of 11 x 7."""
    planes = np.random.default_rng(0).uniform(0.0, 3.0, (16, 16, 4))
    planes[5:10, 7] = [3.0, 3.0, 4000.0, 15_000.0]
    even = even_edges(frame(planes), planes, np.ones(4), MIXED)
    lamp = np.zeros((16, 16), bool)
    lamp[5:10, 7] = True
    assert even[~lamp] == pytest.approx(planes[~lamp], abs=1e-3)
    assert (even[lamp] > 1000.0).all()


def test_a_colour_that_is_full_nearby_is_not_lowered():
    for alpha in [OPEN, MIXED, OPEN + 1.0]:
        light_e = LIGHT_E * [1.0, 5.0, 1.0, 1.4]  # green and W: 15 000 e-
        planes = edge([0.2, 1.0, 0.2, 1.0], light_e)
        even = even_edges(frame(edge([0.6] * 4, light_e)), planes, np.ones(4), alpha)
        assert np.array_equal(even[:, 8, 1], planes[:, 8, 1]), alpha
        assert (even[:, 8, [0, 2]] > planes[:, 8, [0, 2]]).all(), alpha


def test_colours_that_do_not_rise_together_keep_their_own_edges():
    """Orange beside green: red rises by 1400 e- where green and blue fall by 600, so the light does by 200 of 2600."""
    planes = np.broadcast_to([500.0, 1500.0, 1000.0, 14_000.0], (16, 16, 4)).copy()
    planes[:, 8:] = [1900.0, 900.0, 400.0, 15_000.0]
    assert np.array_equal(even_edges(frame(planes), planes, np.ones(4), MIXED), planes)


def test_a_lamp_smaller_than_2_x_2_has_no_colour_in_rims():
    """Channels become the colours' balanced mean M by v^2 = (1 - 2 sqrt(f + s^2) / f)^2 of the largest v."""
    gains, lamp_e = np.array([2.0, 1.0, 3.0, 0.2]), np.array([4000.0, 2000.0, 1000.0, 15_000.0])
    for width in (1, 2):
        planes = np.zeros((16, 16, 4))
        planes[5 : 5 + width, 5 : 5 + width] = lamp_e
        raw = frame(planes)
        balanced = even_edges(raw, planes, gains, MIXED)[5, 5] * gains
        over = (width == 1) * (1.0 - 2.0 * np.sqrt(4000.0 + raw.dark_noise_e**2) / 4000.0) ** 2
        assert balanced == pytest.approx(gains * lamp_e + over * (13_000.0 / 3 - gains * lamp_e), rel=1e-5), width


SHAPES = [(129, 9), (2, 2), (2, 7), (5, 2), (4, 3)]


@pytest.mark.sample(3)
@pytest.mark.parametrize("engine", ["kernel"], indirect=True)
@pytest.mark.parametrize(("tile", "shape"), [*product([RGBW], SHAPES), (RGBW_4X4, (129, 9)), (RGBW_4X4, (4, 5))])
def test_both_engines_agree(monkeypatch, tile, shape):
    """Noise and rims everywhere; single precision beside double, and the same bits in strips of any size."""
    rng = np.random.default_rng(2)
    planes, alpha = rng.uniform(0.0, 5000.0, (*shape, 4)), rng.choice([0.0, 0.5, 1.0], shape)
    planes[:, shape[1] // 2 :] += [0.0, 10_000.0, 0.0, 12_000.0]
    raw, gains = frame(rng.uniform(0.0, 5000.0, (*shape, 4)), tile), np.array([1.5, 1.0, 2.0, 0.3])
    with monkeypatch.context() as patch:
        patch.setattr(edges, "backend", lambda: "numpy")
        expected = even_edges(raw, planes, gains, alpha)
    assert shape in SHAPES[1:] or (np.abs(expected / planes - 1.0) > 0.01).mean() > 0.1
    whole = even_edges(raw, planes, gains, alpha)
    assert whole == pytest.approx(expected, rel=1e-5, abs=1e-3)
    for pixels in (1, 30):
        monkeypatch.setattr(kernel, "STRIP_PIXELS", pixels)
        assert np.array_equal(even_edges(raw, planes, gains, alpha), whole), pixels


def test_tiny_frames():
    for shape in SHAPES[1:]:
        rng = np.random.default_rng(2)
        planes, raw = rng.uniform(0.0, 5000.0, (*shape, 4)), frame(rng.uniform(0.0, 5000.0, (*shape, 4)))
        for alpha in (0.0, 0.5, 1.0):
            even = even_edges(raw, planes, np.ones(4), np.full(shape, alpha))
            assert np.isfinite(even).all(), shape
            assert (even >= 0.0).all(), shape


def test_a_frame_of_no_contrast_in_its_colours_moves_w_alone():
    """By each pixel: what lies elsewhere in the frame, as an edge of all colours far away, has no say."""
    dark_e, light_e = np.array([5.0, 5.0, 5.0, 100.0]), np.array([10.0, 10.0, 10.0, 1000.0])
    planes = np.where(np.arange(40)[:, None] < 9, dark_e, light_e)[None].repeat(40, axis=0)
    planes[:, 9] = 7.0, 7.0, 7.0, 557.0  # a column that has samples of W
    truth = planes.copy()
    truth[:, 9, 3] = 120.0
    alone = even_edges(frame(truth), planes, np.ones(4), np.zeros((40, 40)))
    assert np.array_equal(alone[..., :3], planes[..., :3].astype(np.float32))
    assert (alone[3:-3:2, 9, 3]) == pytest.approx(120.0, rel=1e-5)
    truth[:, 30:], planes[:, 30:] = 5000.0, 5000.0
    assert np.array_equal(even_edges(frame(truth), planes, np.ones(4), np.zeros((40, 40)))[:, :20], alone[:, :20])


def test_a_small_full_patch_shows_no_tile():
    """The smallest case: a neutral patch, full in W, in a field of a hundredth of it.

    Green, red and blue agree within a tenth of the patch at every pixel; before, they differed by up to 0.8 of it.
    """
    for size, row, column in product((3, 4, 5), (0, 1), (0, 1)):
        levels, shape = dict(zip(channels(RGBW), (0.1, 0.2, 0.1, 1.0), strict=True)), (32, 32)
        light = np.full(shape, 400.0)
        light[14 + row : 14 + row + size, 14 + column : 14 + column + size] = 40_000.0
        electrons = np.zeros(shape)
        for name, level in levels.items():
            electrons[mask(RGBW, name, shape)] = level * light[mask(RGBW, name, shape)]
        raw = raw_image(np.minimum(np.rint(electrons), 15_000) + 100)
        rgb = picture_interleaved(raw, np.eye(3), balance=np.array(list(levels.values()))).rgb
        assert np.ptp(rgb, axis=2).max() < 0.1 * 8000.0, (size, row, column)
