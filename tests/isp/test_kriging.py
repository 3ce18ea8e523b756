"""The best linear estimate: planes exact on any tile, noise as stated, what quads resolve, saturation."""

from dataclasses import replace

import numpy as np
import pytest
from builders import RGBW_PHASES, behind, mosaic_of, raw_image

from isp import kriging
from isp.kriging import RADIUS, krige, reconstruct_linear
from isp.remosaic import bayer_tile, remosaic
from sensor.calibration import ColourCalibration
from sensor.capture import expose
from sensor.cfa import BAYER, MOSAICS, RGBW, Tile, channel_map, channels, is_bayer, mask, plain
from sensor.device import draw_device
from sensor.presets import preset
from sensor.raw import RawImage

TILES = ["bayer", "rgbw", "quad_bayer", "quad_rgbw", "rgbw_4x4", "rccb", "mono"]


@pytest.mark.sample(2)
@pytest.mark.parametrize("name", TILES)
@pytest.mark.parametrize("slopes", [(0.0, 0.0), (0.7, 0.0), (-0.3, 0.5)])
def test_constant_and_linear_planes_come_out_exactly_to_the_border(name, slopes):
    tile, (rows, columns) = MOSAICS[name], np.indices((24, 29))
    level = 40.0 + 10.0 * np.arange(len(channels(tile)))
    # every channel has a slope of its own: nothing is taken for granted between channels
    planes = level + (slopes[0] * rows + slopes[1] * columns)[..., None] * (1 + np.arange(level.size))
    found, _ = krige(behind(planes, tile), tile, np.linspace(5.0, 20.0, level.size))
    np.testing.assert_allclose(found, planes, rtol=0, atol=1e-7)


@pytest.mark.sample(1)
@pytest.mark.parametrize("name", ["quad_bayer", "quad_rgbw"])
def test_white_noise_comes_out_with_the_stated_variance(name):
    tile = MOSAICS[name]
    noise = np.random.default_rng(0).standard_normal((400, 400))
    found, gain = krige(noise, tile, np.full(len(channels(tile)), 3.0))
    inner = np.s_[RADIUS:-RADIUS:4, RADIUS:-RADIUS:4]
    # one phase of the tile, 97 x 97 pixels whose windows overlap: the variance's standard error is under 4 times that
    # of as many independent ones. Within 4.5 of it, 3 or 4 channels: false-alarm rate 3e-5
    error = 4 * np.sqrt(2 / found[inner][..., 0].size)
    np.testing.assert_allclose((found[inner] ** 2).mean((0, 1)), gain[inner].mean((0, 1)), rtol=4.5 * error)


def response(name, period, grey):
    """Share of a sine's amplitude along x that G comes out with; `grey`: all channels alike, else G alone varies."""
    tile, wave = MOSAICS[name], np.cos(2 * np.pi * (np.indices((36, 72))[1] + 0.25) / period)
    planes = np.repeat(100.0 + 20.0 * wave[..., None], len(channels(tile)), axis=-1)
    if not grey:
        planes[..., [channel != "G" for channel in channels(tile)]] = 100.0
    found, _ = krige(behind(planes, tile), tile, np.full(len(channels(tile)), 14.0))
    inner = np.s_[12:-12, 12:-12]  # 48 columns: whole periods of 2, 3, 4, 6, 8 and 16
    return float(2 * ((found[..., channels(tile).index("G")][inner] - 100.0) / 20.0 * wave[inner]).mean())


@pytest.mark.thorough
def test_quad_bayer_resolves_grey_well_and_a_colour_by_itself_less():
    """Channels are taken to vary together: what one does alone, in pairs of pixels, is told two thirds as strong."""
    assert response("quad_bayer", 16, grey=True) == pytest.approx(1.0, abs=0.01)
    assert response("quad_bayer", 8, grey=True) == pytest.approx(1.0, abs=0.03)
    assert 0.9 < response("quad_bayer", 4, grey=True) < response("bayer", 4, grey=True) < 1.0
    assert 0.75 < response("quad_bayer", 3, grey=True) < response("bayer", 3, grey=True) < 1.0
    assert 0.6 < response("quad_bayer", 8, grey=False) < response("bayer", 8, grey=False) < 0.75


@pytest.mark.thorough
@pytest.mark.parametrize("name", ["quad_rgbw", "rgbw"])
def test_a_full_w_does_not_tell_the_others_what_they_are(name):
    tile = MOSAICS[name]
    planes = np.broadcast_to([500.0, 1000.0, 400.0, 20_000.0], (32, 32, 4))
    raw = raw_image(np.minimum(behind(planes, tile) + 100, 15_100), tile)
    ramp = np.linspace(0.5, 1.5, 32)[:, None, None] * planes
    found = reconstruct_linear(raw_image(np.minimum(behind(ramp, tile) + 100, 15_100), tile)).estimate
    assert raw.saturated[mask(tile, "W", raw.shape)].all()
    np.testing.assert_allclose(reconstruct_linear(raw).estimate[..., :3], planes[..., :3], rtol=2e-3)
    np.testing.assert_allclose(found[..., :3], ramp[..., :3], rtol=2e-2)


@pytest.mark.sample(1)
@pytest.mark.parametrize("level_e", [0.0, 1.0, 10.0, 300.0])
def test_an_even_field_has_no_bias_from_the_dark_on(level_e):
    sensor = preset("low_noise", "quad_bayer")
    quiet = replace(sensor, pixel=replace(sensor.pixel, prnu=0.0, dsnu_e=0.0, dark_current_e_per_s=0.0))
    device = draw_device(quiet, (256, 256), np.random.default_rng(0))
    raw = expose(np.full((256, 256), level_e), quiet, 0.01, device, np.random.default_rng(1), exact=True)
    estimate = reconstruct_linear(raw).estimate.mean((0, 1))
    # stated: 0.1 e-; beside it the mean of a quarter of the frame within 4.5 standard errors: false-alarm rate 8e-5
    allowed = 0.1 + 4.5 * np.sqrt((level_e + raw.dark_noise_e**2) / (256 * 256 / 4))
    np.testing.assert_allclose(estimate, level_e, atol=allowed)


@pytest.mark.thorough
def test_a_lamp_that_fills_no_pixel_doesn_t_glow_over_the_window():
    """As one photodiode of four does that bin: far above the dark, and under the sum's well."""
    sensor = preset("low_noise", "quad_bayer")
    light = np.full((48, 48), 2.0)
    light[24, 24] = 5000.0
    raw = expose(light, sensor, 0.01, draw_device(sensor, light.shape, np.random.default_rng(0)),
                 np.random.default_rng(1), exact=True)  # fmt: skip
    found = reconstruct_linear(raw).estimate
    distance = np.hypot(*(np.indices(light.shape) - 24))
    ring = found[(distance > 4.5) & (distance < 6.5)]  # the channel's own samples lie up to 4 pixels off
    # of 200 values or more in 3 channels, each interpolated with noise of about 3 e-, correlated over some pixels
    assert abs(ring.mean() - 2.0) < 1.0


# RGBW turned into Bayer: which sites keep their sample, and what stands at the others.


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


@pytest.mark.parametrize("name", ["rgbw", "quad_rgbw"])
def test_strips_of_rows_hold_the_bits_of_the_whole_frame(name, monkeypatch):
    tile = MOSAICS[name]
    dn = np.random.default_rng(1).poisson(400.0, (37, 24)) + 100
    dn[4:6, 9:11] = 15_100  # a lamp: the strips beside it are estimated channel by channel there
    found = []
    for rows in (1000, 8, 5):
        monkeypatch.setattr(kriging, "STRIP_ROWS", rows)
        found.append(reconstruct_linear(raw_image(dn, tile)))
    for other in found[1:]:
        assert np.array_equal(other.estimate, found[0].estimate)
        assert np.array_equal(other.noise_gain, found[0].noise_gain)
