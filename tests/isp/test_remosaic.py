"""RGBW turned into Bayer: which sites keep their sample, and what stands at the others."""

from dataclasses import replace

import numpy as np
import pytest
from builders import RGBW_PHASES, mosaic_of, raw_image

from isp.remosaic import bayer_tile, remosaic
from sensor.calibration import ColourCalibration
from sensor.cfa import BAYER, MOSAICS, RGBW, Tile, channel_map, channels, is_bayer, mask, plain
from sensor.raw import RawImage

PHASES = [*RGBW_PHASES, ("RW", "GB"), ("RB", "GW"), ("WG", "BR")]
LEVELS_E = {"R": 500.0, "G": 1000.0, "B": 400.0, "W": 5000.0}


def raw(cfa: Tile, scene: dict[str, np.ndarray]) -> RawImage:
    """Noise-free mosaic of a scene's channels at one electron a DN, black 100."""
    return raw_image(np.rint(mosaic_of(scene, cfa, scene["R"].shape) + 100), cfa)


def flat(shape: tuple[int, int] = (33, 40)) -> dict[str, np.ndarray]:
    return {channel: np.full(shape, level) for channel, level in LEVELS_E.items()}


def test_the_tile_is_bayer_with_red_where_it_was() -> None:
    for cfa in PHASES:
        tile = bayer_tile(cfa)
        assert is_bayer(tile), cfa
        assert "".join(tile).index("R") == "".join(cfa).index("R"), cfa


@pytest.mark.sample(2)
@pytest.mark.parametrize("cfa", PHASES)
def test_sites_on_which_both_mosaics_agree_keep_their_sample(cfa: Tile) -> None:
    clean = raw(cfa, flat())
    noise = np.rint(20 * np.random.default_rng(3).standard_normal(clean.shape))  # the reconstruction averages over it
    noisy = replace(clean, dn=(clean.dn + noise).astype(np.uint16), read_noise_e=20.0)
    made = remosaic(noisy)
    agree = channel_map(made.cfa, made.shape) == channel_map(cfa, noisy.shape)
    assert agree.any()
    np.testing.assert_array_equal(made.dn[agree], noisy.dn[agree])


@pytest.mark.sample(1)
@pytest.mark.parametrize("axis", [0, 1])
@pytest.mark.parametrize("cfa", PHASES)
def test_a_ramp_is_sampled_where_the_new_pixel_lies(cfa: Tile, axis: int) -> None:
    place = np.indices((48, 48))[axis]
    scene = {channel: level * (1 + 0.01 * (place - 24)) for channel, level in LEVELS_E.items()}
    made = remosaic(raw(cfa, scene))
    inner = np.zeros(made.shape, dtype=bool)
    inner[12:-12, 12:-12] = True  # Omega whole: samples lie evenly around each pixel
    for channel in "RGB":
        here = inner & mask(made.cfa, channel, made.shape)
        # one pixel beside its place would be 1 %; noise-like weights of a ramp move the mean by a fifth of that
        assert made.dn[here] - 100.0 == pytest.approx(scene[channel][here], rel=2.5e-3, abs=0.51), channel


def test_saturated_frames_stay_within_the_converter() -> None:
    made = remosaic(raw(RGBW, {channel: np.full((16, 16), 15_000.0) for channel in "RGBW"}))
    assert set(made.dn.ravel().tolist()) == {15_100}
    assert made.saturated.all()


def test_calibration_goes_along_without_white() -> None:
    eye = np.eye(4, 3)
    colour = ColourCalibration(np.array([0.5, 1.0, 0.4, 4.9]), np.eye(3), eye, eye, eye.T, eye.T)
    made = remosaic(replace(raw(RGBW, flat()), colour=colour, iso=50.0))
    assert made.colour is not None
    np.testing.assert_array_equal(made.colour.neutral, [0.5, 1.0, 0.4])
    assert (made.colour.camera_to_xyz_a.shape, made.iso, made.black_dn) == ((3, 3), 50.0, 100.0)


# Quads


@pytest.mark.sample(1)
@pytest.mark.parametrize("name", ["quad_bayer", "quad_rgbw"])
def test_a_quad_becomes_its_plain_mosaic_and_planes_stay_planes(name: str) -> None:
    cfa = MOSAICS[name]
    place = np.indices((32, 32))[0]
    for slope in (0.0, 0.01):
        scene = {channel: level * (1 + slope * (place - 16)) for channel, level in LEVELS_E.items()}
        made = remosaic(raw(cfa, scene), plain(cfa))
        assert (made.cfa, made.shape) == (plain(cfa), (32, 32))
        for channel in channels(cfa):
            here = mask(made.cfa, channel, made.shape)
            # beside half a DN of rounding, of the samples too: a ramp isn't quite one in units of noise
            expected = scene[channel][here]
            assert made.dn[here] - 100.0 == pytest.approx(expected, rel=1e-3 if slope else 0.0, abs=0.75), channel


def test_samples_of_a_quad_that_lie_where_the_plain_mosaic_has_them_stay() -> None:
    quad = MOSAICS["quad_bayer"]
    noisy = raw_image(np.random.default_rng(0).integers(400, 900, (32, 32)), quad)
    made = remosaic(noisy)
    agree = channel_map(BAYER, (32, 32)) == channel_map(quad, (32, 32))
    assert agree.mean() == 6 / 16
    np.testing.assert_array_equal(made.dn[agree], noisy.dn[agree])
    assert np.any(made.dn[~agree] != noisy.dn[~agree])
