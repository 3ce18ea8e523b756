"""Light of which a channel has no sample: bars one pixel wide, and what must stay."""

import numpy as np
import pytest
from builders import RGBW_4X4, RGBW_PHASES, behind, mosaic_of, raw_image, white_reading

from isp.interleaved import thin
from isp.interleaved.thin import follow_samples
from isp.processors.catalogue import PROCESSORS
from rodcone.jit import backend
from sensor.cfa import RGBW

COLOUR = np.array([500.0, 1000.0, 450.0, 4800.0])  # electrons of a surface that reflects all light


@pytest.fixture(autouse=True, params=["kernel", "numpy"])
def engine(request, monkeypatch):
    """Everything holds for both engines."""
    if request.param == "numpy":
        monkeypatch.setattr(thin, "backend", lambda: "numpy")
    elif backend() == "numpy":
        pytest.skip("needs LLVM or CUDA")
    return request.param


def read(raw, shares=None):
    """The frame as `isp.interleaved.panchromatic` reads it, with a window's shares for each tile."""
    return white_reading(raw, COLOUR, shares)


def by_hand(raw, planes, noise_gain, shares, row, column):
    """The formula of `follow_samples` at a pixel."""
    names, (down, across) = raw.channels, (len(raw.cfa), len(raw.cfa[0]))
    o = names.index(raw.cfa[row % down][column % across])
    u, plane, gain = shares[row // down, column // across], planes[row, column], noise_gain[row, column]
    sample, dark = float(raw.electrons[row, column]), raw.dark_noise_e**2
    if max(sample, *plane) >= 0.95 * raw.full_well_e:
        return plane
    noise = (max(sample / u[o], plane[3], 0.0) + dark / u[o]) / u[o] + gain * (np.maximum(plane, 0.0) + dark) / u**2
    difference = sample / u[o] - plane / u
    clear = np.clip((np.abs(difference) / np.maximum(sample / u[o], plane / u) - 0.4) / 0.3, 0.0, 1.0)
    moved = plane + gain * np.maximum(0.0, 1.0 - 9.0 * noise / difference**2) * clear * u * difference
    light, away = u * max(moved[3], 0.0), moved - u * moved[3]
    variance = gain * (light + dark)
    hidden = np.minimum(1.0, 9.0 * (variance + u**2 * variance[3]) / np.maximum(away**2, 1e-9))
    dim = np.maximum(0.0, 1.0 - light**2 / (light + dark) / 10.0)
    return moved - dim * np.clip((gain - 0.02) / 0.08, 0.0, 1.0) * hidden * away


@pytest.mark.parametrize("tile", [*RGBW_PHASES, RGBW_4X4])
def test_planes_follow_by_the_formula(tile):
    """On light from 2 to 200 %, full samples and full planes, with other shares in each tile."""
    rng = np.random.default_rng(3)
    shape = (15, 18)
    planes = rng.choice([0.02, 0.1, 0.5, 1.0, 2.0, 4.0], (*shape, 1)) * rng.uniform(0.7, 1.3, (*shape, 4)) * COLOUR
    picture = rng.choice([0.02, 0.1, 0.5, 1.0, 2.0, 40.0], (*shape, 1)) * COLOUR
    raw = raw_image(np.rint(np.minimum(behind(picture, tile), 15_000.0)) + 100, tile)
    white = read(raw)
    shares = (white.window_shares * rng.uniform(0.8, 1.25, white.window_shares.shape)).astype(np.float32)
    gains = rng.uniform(0.0, 1.0, planes.shape)
    got = follow_samples(read(raw, shares), planes, gains)
    moved = np.abs(got / planes - 1.0) > 0.1
    assert 0.2 < moved.mean() < 0.8
    for row, column in np.ndindex(shape):
        expected = by_hand(raw, planes, gains, shares, row, column)
        assert got[row, column] == pytest.approx(expected, rel=1e-4, abs=1e-2), (row, column)


def test_shades_of_colour_stay_and_noise_in_the_dark_has_no_colour():
    """Planes within 40 % of their samples as W, or three standard deviations, don't follow them."""
    rng = np.random.default_rng(4)
    for level, spread in ((1.0, 0.22), (1e-3, 0.1)):
        planes = level * COLOUR * rng.uniform(1.0 - spread, 1.0 + spread, (32, 32, 4))
        planes = np.repeat(np.repeat(planes[::4, ::4], 4, axis=0), 4, axis=1)
        expected = behind(np.broadcast_to(level * COLOUR, planes.shape), RGBW)
        noisy = expected + np.sqrt(expected) * rng.uniform(-2.0, 2.0, expected.shape) * (level < 1.0)
        got = follow_samples(read(raw_image(np.rint(noisy) + 100, RGBW)), planes, np.ones(planes.shape))
        if level == 1.0:
            assert got == pytest.approx(planes, rel=1e-6)
        else:  # a plane of one sample shows no colour in the dark, where the window's colour counts
            assert got == pytest.approx(planes[..., 3:] * COLOUR / COLOUR[3], rel=0.01)


def developed_bar(axis, tile, seed):
    """Develop a grey bar one pixel wide, ten times as bright as the grey around it; return the bar without its ends."""
    light = np.full((64, 64), 60.0)
    bar = np.s_[26:38, 31] if axis else np.s_[31, 26:38]
    light[bar] = 600.0
    levels = dict(zip("RGBW", COLOUR / 1000.0, strict=True))
    electrons = mosaic_of({name: light * level for name, level in levels.items()}, tile, light.shape)
    raw = raw_image(np.random.default_rng(seed).poisson(electrons) + 100, tile)
    balance = np.array([levels[name] for name in raw.channels])
    return PROCESSORS["interleaved"].develop(raw, np.eye(3), balance=balance).rgb[bar][1:-1]


@pytest.mark.parametrize("engine", ["kernel"], indirect=True)
@pytest.mark.parametrize("axis", [0, 1], ids=["lying", "upright"])
def test_a_grey_bar_one_pixel_wide_is_developed_grey(axis):
    """Two channels have no site on it, and kept the light around: until decision 0066 its spread was 0.25 to 1.26."""
    for number, tile in enumerate(RGBW_PHASES):
        bars = np.concatenate([developed_bar(axis, tile, [axis, number, seed]) for seed in range(4)])
        assert np.median(np.ptp(bars, axis=1) / bars.mean(axis=1)) < 0.22, tile
