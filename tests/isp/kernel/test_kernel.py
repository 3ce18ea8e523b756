"""The kernel beside the float64 reference over many inputs, and where numbers are extreme."""

import math
from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from builders import RGBW_4X4, raw_image

from isp.interleaved import reconstruct, reconstruct_with_noise
from isp.reference import reconstruct_reference, sum_weights
from isp.settings import Settings
from isp.similarity.guide import reliability, reliability_of_mean
from rodcone.errors import InputError
from rodcone.jit import backend
from sensor.cfa import BAYER, RGBW, channel_map, channels

BLACK, FULL = 100.0, 4000.0

needs_kernel = pytest.mark.skipif(backend() == "numpy", reason="without Dr.Jit the reference would meet itself")


def exposure(electrons, tile=RGBW, black=BLACK, gain=1.0, read_noise_e=2.0):
    """Mosaic that reads `electrons` (of gain 1) over black; electrons scale with the gain."""
    return raw_image(
        np.clip(np.round(electrons + black), 0, 65535),
        tile,
        black_dn=black,
        white_dn=black + FULL,
        gain_e_per_dn=gain,
        read_noise_e=read_noise_e * gain,
        dsnu_e=0.0,
    )


def random_scene(rng, tile):
    """A noisy frame of random size, light, contrast and texture."""
    shape = tuple(int(n) for n in rng.integers(max(len(tile), len(tile[0])), 34, 2))
    y, x = np.indices(shape)
    base = 1.0 + rng.uniform(0, 1) * np.sin(x / rng.uniform(1, 9) + y / rng.uniform(1, 9))
    base += rng.uniform(0, 3) * ((x // int(rng.integers(2, 12)) + y // int(rng.integers(2, 12))) % 2)
    response = np.vectorize({"R": 0.1, "G": 1 / 6, "B": 0.1, "W": 1.0}.get)(channel_map(tile, shape))
    level = 10.0 ** rng.uniform(-1.0, 5.0)
    electrons = np.minimum(rng.poisson(level * base * response), FULL) + rng.normal(0.0, 2.0, shape)
    return exposure(electrons, tile)


def assert_single_precision(raw, settings):
    """The kernel is the reference within 1e-4 of full scale, or what rounding makes of the largest log weight.

    A log weight is right to some 16 roundings of 2^-24 (squares and their sum, of planes that are rounded). Two samples
    that share a pixel then share it wrongly by up to half of the sum of both errors.
    """
    sums = sum_weights(raw, settings)
    error = np.abs(reconstruct(raw, settings) - sums.value / sums.weight)
    scale = FULL * raw.gain_e_per_dn
    assert (error <= scale * np.maximum(1e-4, 16 * 2.0**-24 * -sums.largest)).all()
    # The bound is not slack: nearly all pixels are far better than 1e-4, by the exponential's own 3.8e-5.
    assert np.quantile(error, 0.98) < 2.5e-5 * scale + scale * 2.0**-20 * np.quantile(-sums.largest, 0.98)


def random_settings(rng, tile, patch):
    smallest = 2 * max(len(tile), len(tile[0])) - 1
    neighbourhood = max(smallest, int(rng.choice([3, 7, 13, 21])))
    distance = str(rng.choice(["noise", "noise", "raw"]))
    sigma_s = 10.0 ** rng.uniform(-1.0, 2.0) * (20.0 if distance == "raw" else 1.0)
    sigma_d = float(rng.uniform(0.5, 10.0))
    return Settings(
        neighbourhood=neighbourhood, patch=patch, sigma_d=sigma_d, sigma_s=float(sigma_s), distance=distance
    )


@pytest.mark.sample(3)
@needs_kernel
@pytest.mark.parametrize("seed", range(24))
def test_random_inputs_give_the_reference(seed):
    rng = np.random.default_rng(100 + seed)
    tile = [RGBW, ("GR", "WB"), BAYER][seed % 3]
    assert_single_precision(random_scene(rng, tile), random_settings(rng, tile, 5))


SHAPES = list(product([RGBW, BAYER, RGBW_4X4, ("RGBW",), ("R", "W"), ("W",), ("RGB", "WWR", "GBW")], [1, 3, 5, 7, 9]))


@needs_kernel
@pytest.mark.slow
@pytest.mark.timeout(1800)
@pytest.mark.parametrize(("tile", "patch"), SHAPES)
def test_hundreds_of_random_inputs_on_35_compiled_shapes_give_the_reference(tile, patch):
    rng = np.random.default_rng([patch, SHAPES.index((tile, patch))])
    for _ in range(12):
        assert_single_precision(random_scene(rng, tile), random_settings(rng, tile, patch))


def hard_frames():
    """Frames that have broken reconstructions: by name, (mosaic in electrons of gain 1, black, gain)."""
    rng, shape = np.random.default_rng(1), (26, 27)
    edge = np.where(np.arange(shape[1]) < 13, 50.0, FULL) * np.ones(shape)
    lonely = np.full(shape, 200.0)
    lonely[12:15, 12:15] = rng.uniform(1000.0, 3000.0, (3, 3))
    wide = np.clip(np.round(10.0 ** rng.uniform(-1.0, 4.8, shape)), 0, 65_000)
    return {
        "zeros": (np.full(shape, -BLACK), BLACK, 1.0),
        "one bright pixel": (np.where(np.indices(shape).sum(0) == 20, 60_000.0, 0.0), BLACK, 1.0),
        "all saturated": (np.full(shape, FULL), BLACK, 1.0),
        "saturation edge": (edge, BLACK, 1.0),
        "10^8 in a frame": (wide, 0.9994, 1.0),  # 1 DN is 0.0006 over black
        "no similar neighbour": (lonely, BLACK, 1.0),
        "1e-3 electrons": (rng.poisson(50.0, shape), BLACK, 1e-5),
        "1e9 electrons": (rng.integers(0, 4000, shape), BLACK, 1e6),
        "next to nothing": (rng.integers(0, 4000, shape), 99.999999, 1e-12),
    }


HARD_FRAMES = hard_frames()


@pytest.mark.sample(7)
@pytest.mark.parametrize("distance", ["noise", "raw"])
@pytest.mark.parametrize("name", HARD_FRAMES)
def test_hard_frames_give_finite_results_within_the_range_of_the_samples(name, distance):
    """A weighted mean can't leave the range of its samples; single precision may by 1e-6. Warnings are errors."""
    electrons, black, gain = HARD_FRAMES[name]
    raw = exposure(np.asarray(electrons, float), RGBW, black, gain)
    letters, samples = channel_map(RGBW, raw.shape), raw.electrons
    for sigma_s in (1e-3, 0.1, 8.0, 1e6, math.inf):
        result = reconstruct_with_noise(
            raw,
            Settings(
                sigma_s=sigma_s * (gain if distance == "raw" else 1.0) if gain > 1 else sigma_s, distance=distance
            ),
        )
        assert np.isfinite(result.estimate).all()
        for i, letter in enumerate(channels(RGBW)):
            own = samples[letters == letter]
            slack = 1e-6 * np.abs(own).max()
            assert result.estimate[..., i].min() >= own.min() - slack
            assert result.estimate[..., i].max() <= own.max() + slack
        assert (result.noise_gain > 0.0).all()
        assert (result.noise_gain <= 1.0 + 2e-4).all()


@needs_kernel
@pytest.mark.parametrize("patch", [1, 5])
@pytest.mark.parametrize("white", [0.0, 100.0, 2 * FULL])  # in the dark, where W guides, where channels do
@pytest.mark.parametrize(
    "settings", [{}, {"sigma_s": math.inf}, {"sigma_s": 0.001}, {"distance": "raw", "sigma_s": math.inf}]
)
def test_nothing_beyond_the_frame_is_averaged(patch, white, settings):
    """Flat planes stay flat at the border, also where similarity counts for nothing."""
    flat = {"R": 30.0, "G": 900.0, "B": 300.0, "W": white}
    raw = exposure(np.vectorize(flat.get)(channel_map(RGBW, (17, 22))))
    expected = [min(flat[letter], 65535 - BLACK) for letter in channels(RGBW)]
    np.testing.assert_allclose(
        reconstruct(raw, Settings(patch=patch, **settings)), np.broadcast_to(expected, (17, 22, 4)), rtol=1e-6
    )


@pytest.mark.sample(2)
@needs_kernel
@pytest.mark.parametrize("shape", [(2, 2), (3, 9), (9, 3), (2, 30), (30, 2)])
@pytest.mark.parametrize("tile", [("RW",), ("R", "W")])
def test_frames_may_be_smaller_than_a_patch_and_than_a_packet(shape, tile):
    raw = exposure(np.random.default_rng(6).uniform(0.0, FULL / 2, shape), tile)
    settings = Settings(patch=7, neighbourhood=3)
    assert np.abs(reconstruct(raw, settings) - reconstruct_reference(raw, settings)).max() < 1e-4 * FULL


@pytest.mark.thorough
@needs_kernel
def test_a_pixel_without_a_similar_neighbour_keeps_its_sample_and_takes_the_nearest_of_the_others():
    raw = exposure(HARD_FRAMES["no similar neighbour"][0])
    exact = reconstruct_reference(raw, Settings(sigma_s=0.05, patch=5))
    assert (
        sum_weights(raw, Settings(patch=5, sigma_s=0.05)).largest.min() < -1000.0
    )  # every weight underflows by itself
    assert np.abs(reconstruct(raw, Settings(sigma_s=0.05, patch=5)) - exact).max() < 0.05
    letters = channel_map(RGBW, raw.shape)
    for i, letter in enumerate(channels(RGBW)):
        here = letters[12:15, 12:15] == letter
        assert exact[12:15, 12:15, i][here] == pytest.approx(raw.electrons[12:15, 12:15][here], rel=1e-9)


@pytest.mark.parametrize("function", [reconstruct, reconstruct_reference])
def test_the_raw_distance_is_the_papers_in_electrons(function):
    # Two levels of every band, 40 e- apart: a patch of 25 differs by 5 x 40 in W alone.
    electrons = np.where(np.arange(40) < 20, 300.0, 340.0) * np.ones((24, 40))
    raw = exposure(electrons)
    apart = function(raw, Settings(distance="raw", patch=5, sigma_s=20.0, sigma_d=math.inf, neighbourhood=9))
    mixed = function(raw, Settings(distance="raw", patch=5, sigma_s=2000.0, sigma_d=math.inf, neighbourhood=9))
    assert apart[:, 16] == pytest.approx(300.0, abs=0.01)
    assert mixed[:, 16].mean() > 301.0
    # beta = 5 x 40 where the whole patch differs: at sigma_s = 200 it weighs exp(-1/2). From x = 14 only y = 18 is
    # reached, all at 300; from x = 19, half a patch from the edge, closed forms would need the planes between.
    same = function(raw, Settings(distance="raw", patch=5, sigma_s=200.0, sigma_d=math.inf, neighbourhood=9))
    assert same[:, 10] == pytest.approx(300.0, rel=2e-4)
    scaled = replace(raw, gain_e_per_dn=3.0, read_noise_e=6.0)
    tripled = function(scaled, Settings(distance="raw", patch=5, sigma_s=600.0, sigma_d=math.inf, neighbourhood=9))
    assert tripled == pytest.approx(3.0 * same, rel=2e-4)


def test_reliability_keeps_single_precision_over_its_range() -> None:
    got = reliability_of_mean(np.float32([0.0, 1e-3, 1e17]), 1e-13)
    assert got.dtype == np.float32
    assert got == pytest.approx([0.0, 1e-6 / (1 + 1e-6), 1.0], rel=1e-6)


def test_reliability_takes_the_mean_of_the_patch_reflected_at_the_border():
    plane = np.arange(30.0).reshape(5, 6)
    got = reliability(plane, 2.0, 3)
    assert got[2, 3] == pytest.approx(reliability_of_mean(plane[1:4, 2:5].mean(), 2.0))
    corner = (plane[0, 0] + 2 * plane[0, 1] + 2 * plane[1, 0] + 4 * plane[1, 1]) / 9
    assert got[0, 0] == pytest.approx(reliability_of_mean(corner, 2.0))


@pytest.mark.sample(1)
@pytest.mark.parametrize("function", [reconstruct, reconstruct_reference])
def test_in_the_dark_similarity_falls_back_to_the_distance_weight(function):
    rng = np.random.default_rng(3)
    dark = exposure(rng.normal(0.0, 30.0, (20, 22)), read_noise_e=30.0)
    bright = exposure(rng.poisson(900.0, (20, 22)), read_noise_e=2.0)
    for raw, least, most in ((dark, 0.0, 0.02), (bright, 0.05, 1.0)):
        spatial = function(raw, Settings(patch=5, sigma_s=math.inf))
        alike = function(raw, Settings(patch=5, sigma_s=2.0))
        change = np.abs(alike - spatial).mean() / np.abs(raw.electrons - raw.electrons.mean()).mean()
        assert least <= change <= most


def test_an_unknown_distance_is_refused():
    with pytest.raises(InputError, match="distance: 'noisy' is unknown; allowed: noise, raw; did you mean 'noise'"):
        reconstruct(exposure(np.zeros((6, 6))), Settings(distance="noisy"))
