"""Every sample read as W: closed forms of shares and guide, both engines, and what a person sees of it."""

import math
from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from builders import RGBW_4X4, RGBW_PHASES, mosaic_of, raw_image

from isp.interleaved import panchromatic
from isp.interleaved.panchromatic import read_as_white, with_full_white
from isp.processors.catalogue import PROCESSORS
from rodcone.jit import backend
from sensor.cfa import BAYER, RGBW, channel_map
from sensor.raw import RawImage

NEUTRAL = {"R": 0.5, "G": 1.0, "B": 0.45, "W": 4.8}
RATIOS = np.array([*NEUTRAL.values()])
DARK_E = 1.5


@pytest.fixture(autouse=True, params=["kernel", "numpy"])
def engine(request, monkeypatch):
    """Everything holds for both engines."""
    if request.param == "numpy":
        monkeypatch.setattr(panchromatic, "backend", lambda: "numpy")
    elif backend() == "numpy":
        pytest.skip("needs LLVM or CUDA")
    return request.param


def exposed(light, colour=NEUTRAL, tile=RGBW, seed=None, well_e=15_000.0) -> RawImage:
    """What a mosaic reads of light (h, w) in one colour [e- in G]; with a seed, with its noise."""
    light = np.asarray(light, float)
    electrons = mosaic_of({name: light * colour[name] for name in colour}, tile, light.shape)
    if seed is not None:
        rng = np.random.default_rng(seed)
        electrons = rng.poisson(electrons) + rng.normal(0.0, DARK_E, light.shape)
    dn = np.minimum(electrons, well_e) + 100.0
    raw = raw_image(dn, tile, white_dn=100.0 + well_e, read_noise_e=DARK_E, dsnu_e=0.0, prnu=0.0)
    return replace(raw, dn=dn.astype(np.float32))


def guide_e(raw, ratios=RATIOS):
    """The guide in electrons: the transform taken back, without PRNU."""
    return (read_as_white(raw, ratios).guide / 2.0) ** 2 - 0.375 - raw.dark_noise_e**2


def neutral_of(raw):
    return np.array([NEUTRAL[name] for name in raw.channels])


def test_even_light_of_any_colour_has_its_own_shares_and_a_flat_guide():
    colours = (NEUTRAL, {"R": 0.55, "G": 1.0, "B": 0.03, "W": 3.0}, {"R": 0.05, "G": 0.3, "B": 1.5, "W": 2.0})
    for colour, tile in product(colours, (*RGBW_PHASES, RGBW_4X4)):
        raw = exposed(np.full((23, 18), 200.0), colour, tile)
        white = read_as_white(raw, RATIOS)
        expected = np.array([*colour.values()]) / colour["W"]
        rel = 2e-2 if tile == RGBW_4X4 else 1e-4  # mirrored at the border its tents don't take all channels alike
        assert white.shares == pytest.approx(np.broadcast_to(expected, white.shares.shape), rel=rel), (colour, tile)
        assert guide_e(raw) == pytest.approx(np.full(raw.shape, 200.0 * colour["W"]), rel=10 * rel), (colour, tile)


def test_an_edge_of_light_is_an_edge_of_the_guide():
    """The nearest samples of W are two columns apart; the guide rises within one, at every place of the tile."""
    for column, tile in product((11, 12), RGBW_PHASES):
        light = np.where(np.arange(24) < column, 50.0, 1000.0) * np.ones((24, 24))
        guide = guide_e(exposed(light, tile=tile))
        expected = light * NEUTRAL["W"]
        # Next to the edge the window's shares, whose samples lie on either side, may be 40 % off; W's plane has half.
        step = expected.max() - expected.min()
        assert (guide[6:-6, :column] < expected.min() + 0.1 * step).all(), (column, tile)
        assert (guide[6:-6, column:] > expected.min() + 0.6 * step).all(), (column, tile)


def test_a_window_that_noise_fills_takes_the_surroundings_share():
    """Of 0.6 e- in G, whose window of 9 samples a channel knows no colour, shares spread by less than a quarter."""
    raw = exposed(np.full((96, 96), 0.6), seed=0)
    shares = read_as_white(raw, RATIOS).shares
    spread = (shares / (RATIOS / RATIOS[3])).std(axis=(0, 1))
    assert (spread[:3] < 0.25).all()


def test_noise_of_the_guide_on_even_light_is_less_than_a_sample_s():
    """W's own samples have 1; the eight around a pixel tell most of what it is where there is no detail."""
    guide = read_as_white(exposed(np.full((128, 128), 100.0), seed=1), RATIOS).guide[8:-8, 8:-8]
    assert 0.3 < guide.std() < 0.75


def test_detail_that_the_eight_around_miss_stays():
    """Columns of one pixel: their mean knows nothing of them, the samples do."""
    light = np.where(np.arange(48) % 2, 400.0, 100.0) * np.ones((48, 48))
    guide = guide_e(exposed(light))[8:-8, 8:-8]
    # Two channels see the bright columns and two the dark ones: shares take stripes for a colour, the guide is flat.
    assert guide.std() < 0.1 * guide.mean()
    light = np.where(np.arange(48) // 2 % 2, 400.0, 100.0) * np.ones((48, 48))
    guide, expected = guide_e(exposed(light))[8:-8, 8:-8], NEUTRAL["W"] * light[8:-8, 8:-8]
    assert guide == pytest.approx(expected, rel=0.3)


def test_pixels_beside_a_window_in_the_dark_resemble_the_wall():
    """Of 14 e- of W, colour samples beside light of 1900 say nothing; 18 % were read as under a quarter of the wall."""
    light = np.full((64, 64), 3.0)
    ring = np.zeros(light.shape, bool)
    for row, column in product((14, 42), (15, 44)):
        light[row : row + 8, column : column + 5] = 400.0
        ring[row - 2 : row + 10, column - 2 : column + 7] = True
    beside = [guide_e(exposed(light, seed=seed))[ring & (light < 400.0)] for seed in range(4)]
    assert (np.concatenate(beside) < 0.25 * 3.0 * NEUTRAL["W"]).mean() < 0.08


def test_a_dark_pixel_in_good_light_stays():
    """A pixel of a tenth of the light around it is known by its own sample, whatever its channel."""
    light = np.full((48, 48), 2000.0)
    dots = np.zeros(light.shape, bool)
    dots[np.ix_([9, 20, 31], [10, 21, 34])] = True
    light[dots] = 200.0
    for tile in RGBW_PHASES:
        assert (guide_e(exposed(light, tile=tile, seed=5))[dots] < 0.25 * 2000.0 * NEUTRAL["W"]).all(), tile


def lines_on_grey(axis, tile, seed=None) -> tuple[RawImage, np.ndarray]:
    """Grey lines two pixels apart, 75 to 525 e- in G, on 10 x 10 pixels of an even grey of 300, and their light."""
    light = np.full((64, 64), 300.0)
    bright = np.indices((10, 10))[axis] % 2 == 0
    light[27:37, 27:37] = np.where(bright, 525.0, 75.0)
    return exposed(light, tile=tile, seed=seed), light


@pytest.mark.parametrize("axis", [0, 1], ids=["lying", "upright"])
def test_grey_lines_two_pixels_apart_stand_in_the_guide(axis):
    """Each channel samples bright lines or dark ones alone; until decision 0065 the guide was even there."""
    for tile in RGBW_PHASES:
        raw, light = lines_on_grey(axis, tile)
        guide, bright = guide_e(raw)[30:34, 30:34], light[30:34, 30:34] > 300.0
        assert guide[bright].min() > 4.0 * guide[~bright].max(), tile  # light has 7, and the guide had 1
        weights = read_as_white(raw, neutral_of(raw)).lines
        assert (weights[15:17, 15:17] > 0.95).all(), tile
        assert (weights[:8] == 0.0).all(), tile


@pytest.mark.parametrize("axis", [0, 1], ids=["lying", "upright"])
@pytest.mark.parametrize("engine", ["kernel"], indirect=True)
def test_grey_lines_two_pixels_apart_are_developed_grey(axis):
    for number, tile in enumerate(RGBW_PHASES):
        raw, _ = lines_on_grey(axis, tile, seed=[axis, number])
        rgb = PROCESSORS["interleaved"].develop(raw, np.eye(3), balance=RATIOS).rgb[31:34, 31:34]
        assert np.median(np.ptp(rgb, axis=2) / rgb.mean(axis=2)) < 0.3, tile  # 1.2 before


def test_noise_in_even_light_is_no_lines():
    """Light at 555 nm, where B reads 0.9 e-: its noise over its share is as large as lines would be."""
    at_555_nm = {"R": 13.5 / 27.5, "G": 1.0, "B": 0.9 / 27.5, "W": 7.8 / 27.5}
    ratios = np.array([0.102, 0.205, 0.092, 1.0])
    for seed, tile in enumerate(RGBW_PHASES):
        raw = exposed(np.full((64, 64), 27.5), at_555_nm, tile, seed)
        order = ["RGBW".index(name) for name in raw.channels]
        assert read_as_white(raw, ratios[order]).lines.mean() < 0.02, tile  # 0.34 by the scatter of samples alone


def test_colours_of_things_are_no_lines():
    """Red, yellow, blue, leaves (bright in near infrared), sodium and a blue LED on grey; W sees light of all."""
    relative = {  # to a neutral, R, G, B and W
        "red": (1.5, 0.4, 0.4, 1.0),
        "yellow": (1.3, 1.2, 0.3, 1.05),
        "blue": (0.4, 0.6, 1.4, 0.7),
        "leaf": (0.6, 1.1, 0.5, 1.1),
        "sodium": (1.1, 1.0, 0.07, 0.63),
        "LED": (0.1, 0.3, 3.3, 0.42),
    }
    for (name, colour), tile in product(relative.items(), RGBW_PHASES):
        factors = dict(zip(NEUTRAL, colour, strict=True))
        planes = {channel: np.full((64, 64), 300.0 * NEUTRAL[channel]) for channel in NEUTRAL}
        for channel, plane in planes.items():
            plane[26:37, 26:37] *= factors[channel]
        raw = exposed(np.ones((64, 64)), planes, tile)
        assert read_as_white(raw, neutral_of(raw)).lines.max() < 0.1, (name, tile)


def test_a_full_w_reads_what_the_colours_around_say_of_a_neutral():
    raw = exposed(np.full((16, 18), 5000.0))
    assert raw.saturated.any()
    whites = channel_map(RGBW, raw.shape) == "W"
    filled = with_full_white(raw, RATIOS / RATIOS[3]).electrons
    assert filled[whites] == pytest.approx(np.full(whites.sum(), 24_000.0), rel=1e-5)
    assert np.array_equal(filled[~whites], raw.electrons[~whites])
    assert guide_e(raw) == pytest.approx(np.full(raw.shape, 24_000.0), rel=2e-3)
    dark = exposed(np.full((16, 18), 50.0))
    assert with_full_white(dark, RATIOS / RATIOS[3]) is dark


def test_a_full_w_stays_full_where_the_colours_say_less():
    colour = {"R": 0.1, "G": 0.1, "B": 0.1, "W": 16.0}  # infrared, say
    raw = exposed(np.full((16, 18), 1000.0), colour)
    whites = channel_map(RGBW, raw.shape) == "W"
    assert with_full_white(raw, RATIOS / RATIOS[3]).electrons[whites] == pytest.approx(np.full(whites.sum(), 15_000.0))


@pytest.mark.parametrize("engine", ["kernel"], indirect=True)
@pytest.mark.parametrize("tile", [RGBW, BAYER, RGBW_4X4, ("RW",), ("W",), ("RGB", "WWR", "GBW")])
def test_both_engines_agree(tile, monkeypatch):
    """Noise, edges and full samples; in bands of the frame too, whose bits are the whole frame's."""
    for shape in ((len(tile), len(tile[0])), (5, 7), (61, 50)):
        if shape[0] < len(tile) or shape[1] < len(tile[0]):
            continue
        light = 20.0 * (1.0 + 30.0 * (np.indices(shape).sum(0) // 9 % 2))
        light[shape[0] // 2 :, : shape[1] // 3] = 1e5
        raw = exposed(light, tile=tile, seed=2)
        kernel = read_as_white(raw, neutral_of(raw))
        with monkeypatch.context() as patch:
            patch.setattr(panchromatic, "backend", lambda: "numpy")
            twin = read_as_white(raw, neutral_of(raw))
        assert kernel.shares == pytest.approx(twin.shares, rel=1e-4), shape
        assert kernel.guide == pytest.approx(twin.guide, rel=1e-4, abs=1e-3), shape
        assert kernel.lines == pytest.approx(twin.lines, abs=1e-3), shape
        assert kernel.window_shares == pytest.approx(twin.window_shares, rel=1e-3), shape
        monkeypatch.setattr("isp.interleaved.kernel.panchromatic.BAND_PIXELS", 7 * shape[1])
        bands = read_as_white(raw, neutral_of(raw))
        monkeypatch.undo()
        assert np.array_equal(bands.guide, kernel.guide), shape
        assert np.array_equal(bands.shares, kernel.shares), shape
        assert np.array_equal(bands.lines, kernel.lines), shape
        assert np.array_equal(bands.window_shares, kernel.window_shares), shape


LAMPS = [(1, 1), (1, 2), (1, 3), (1, 4), (1, 5), (3, 1), (5, 1), (2, 2), (2, 5), (4, 4), (3, 3), (2, 3)]


@pytest.mark.parametrize("engine", ["kernel"], indirect=True)
def test_no_lamp_has_a_hole():
    """A lamp of every shape on every phase, in three lights: no lit pixel under six times its surroundings."""
    for (height, width), (field, lamp) in product(LAMPS, ((0.3, 5e3), (1.0, 2e5), (20.0, 2e5))):
        light = np.full((96, 96), field)
        places = [np.s_[20 + i : 20 + i + height, 22 + j : 22 + j + width] for i, j in product((0, 49), repeat=2)]
        for place in places:
            light[place] = lamp
        raw = exposed(light, seed=[height, width, int(10 * field)])
        shown = PROCESSORS["interleaved"].develop(raw, np.eye(3), balance=RATIOS).rgb.mean(axis=2)
        for place in places:
            assert shown[place].min() > 6.0 * field, (height, width, field)


@pytest.mark.parametrize("engine", ["kernel"], indirect=True)
def test_a_grey_star_has_no_coloured_structures():
    """Spokes of grey down to two pixels: under 2 % of the pixels have a chroma a fifth of their light (12 % before)."""
    y, x = np.indices((96, 96)) - 47.5
    angle, radius = np.arctan2(y, x), np.hypot(y, x)
    light = np.where(np.sin(36 * angle) > 0.0, 700.0, 60.0)
    light[radius < 36.0 / math.pi] = 380.0  # spokes under a pixel
    raw = exposed(light, seed=3)
    rgb = PROCESSORS["interleaved"].develop(raw, np.eye(3), balance=RATIOS).rgb
    coloured = np.ptp(rgb, axis=2) > 0.5 * rgb.mean(axis=2)
    assert coloured[8:-8, 8:-8].mean() < 0.02
