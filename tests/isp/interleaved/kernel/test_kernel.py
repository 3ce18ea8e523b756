"""The kernel beside the float64 reference over many inputs, and where numbers are extreme."""

import math
from itertools import product

import numpy as np
import pytest
from builders import RGBW_4X4, RGBW_PHASES, mosaic_of, raw_image, single_precision

from isp.interleaved.numpy_form import sum_weights
from isp.interleaved.reconstruction import reconstruct, reconstruct_with_noise
from isp.settings import Settings
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
    response = mosaic_of({"R": 0.1, "G": 1 / 6, "B": 0.1, "W": 1.0}, tile, shape)
    level = 10.0 ** rng.uniform(-1.0, 5.0)
    electrons = np.minimum(rng.poisson(level * base * response), FULL) + rng.normal(0.0, 2.0, shape)
    return exposure(electrons, tile)


def assert_single_precision(raw, settings):
    kernel = reconstruct_with_noise(raw, settings)
    white = kernel.white
    sums = sum_weights(raw, settings) if white is None else sum_weights(white.raw, settings, np.float64(white.guide))
    error = np.abs(kernel.estimate - sums.value / sums.weight)
    scale = FULL * raw.gain_e_per_dn
    assert (error <= single_precision(sums.largest, scale)).all()
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
            own = (samples if result.white is None else result.white.raw.electrons)[letters == letter]
            slack = 1e-6 * np.abs(own).max()
            assert result.estimate[..., i].min() >= own.min() - slack
            assert result.estimate[..., i].max() <= own.max() + slack
        assert (result.noise_gain > 0.0).all()
        assert (result.noise_gain <= 1.0 + 2e-4).all()


@pytest.mark.sample(3)
@needs_kernel
@pytest.mark.parametrize("patch", [1, 5])
@pytest.mark.parametrize("tile", RGBW_PHASES)
def test_nothing_beyond_the_frame_is_averaged(tile, patch):
    """Flat planes stay flat at the border, also where similarity counts for nothing: in the dark, by W, by channels."""
    loose = ({}, {"sigma_s": math.inf}, {"sigma_s": 0.001}, {"distance": "raw", "sigma_s": math.inf})
    for white, settings in product((0.0, 100.0, 2 * FULL), loose):
        flat = {"R": 30.0, "G": 900.0, "B": 300.0, "W": white}
        raw = exposure(np.vectorize(flat.get)(channel_map(tile, (17, 22))), tile)
        expected = np.broadcast_to([flat[letter] for letter in channels(tile)], (17, 22, 4))
        planes = reconstruct(raw, Settings(patch=patch, **settings))
        np.testing.assert_allclose(planes, expected, rtol=1e-6, err_msg=f"{white} {settings}")


@pytest.mark.sample(12)
@needs_kernel
@pytest.mark.parametrize("shape", [(2, 2), (3, 9), (9, 3), (2, 30), (30, 2), (30, 4)])
@pytest.mark.parametrize("tile", [("RW",), ("R", "W")])
@pytest.mark.parametrize(("patch", "neighbourhood"), [(7, 3), (3, 21)])
def test_frames_may_be_smaller_than_patch_neighbourhood_and_packet(shape, tile, patch, neighbourhood):
    raw = exposure(np.random.default_rng(6).uniform(0.0, FULL / 2, shape), tile)
    settings = Settings(patch=patch, neighbourhood=neighbourhood)
    kernel = reconstruct_with_noise(raw, settings)
    sums = sum_weights(kernel.white.raw, settings, np.float64(kernel.white.guide))
    # The least log weights reach -1e4, where float32's numbers are 0.001 apart. Two that are off by two spacings each
    # move a mean of values of 0 to FULL / 2 by a quarter of this range times four spacings: 1.96 e- at most, where
    # `single_precision` grants sixteen roundings, 42 e-. The largest error found is 0.43 of the bound.
    most = FULL / 2 * np.spacing(np.abs(sums.largest).astype(np.float32)) + 1e-6 * FULL
    assert np.all(np.abs(kernel.estimate - sums.value / sums.weight) < most)
