"""Colours that the prior took off come back from the samples' own mean, and noise alone brings none."""

from dataclasses import replace

import numpy as np
import pytest

from isp.ple import pyramid
from isp.ple.prior import LETTERS, own_prior
from isp.ple.twicing import twice_colours
from sensor.cfa import BAYER, MOSAICS, RGBW, channel_map, channels
from sensor.raw import RawImage

TILES = [RGBW, BAYER, MOSAICS["rgbw_4x4"], MOSAICS["quad_bayer"]]
WELL_E = 15_000.0


def raw_of(planes: np.ndarray, tile: tuple[str, ...], noise_e: float = 1.0) -> RawImage:
    """Samples of the planes, channel by channel, without noise."""
    letters = channel_map(tile, planes.shape[:2])
    electrons = np.zeros(letters.shape)
    for plane, name in zip(np.moveaxis(planes, -1, 0), channels(tile), strict=True):
        electrons = np.where(letters == name, plane, electrons)
    return RawImage(electrons + 200, tile, 200.0, 200 + WELL_E, 1.0, noise_e, 0.0, 0.0, 0.0)


def twiced(estimate: np.ndarray, raw: RawImage) -> np.ndarray:
    planes = estimate.astype(np.float32)
    twice_colours(planes, 2 * np.sqrt(planes + 1), raw)
    return planes


@pytest.mark.parametrize("tile", TILES)
def test_a_colours_bias_on_a_surface_is_taken_off_and_its_neighbour_stays(tile):
    """Two surfaces far apart in brightness; one colour is 30 % short on the bright one, which has no noise to speak of.

    Cells on both sides of the edge share what the tent carries over: two cells there aren't looked at. 0.2 % is
    what shrinking leaves off.
    """
    truth = np.zeros((48, 61, len(channels(tile))), np.float32)  # no whole number of cells
    truth[:, :32], truth[:, 32:] = 4000.0, 100.0
    estimate = truth.copy()
    estimate[:, :32, 0] *= 0.7
    made = twiced(estimate, raw_of(truth, tile))
    away = np.r_[0:24, 40:61]
    assert made[:, away] == pytest.approx(truth[:, away], rel=0.002)


def test_the_sharpest_channel_stays_and_colours_keep_their_share_of_it():
    """Where all channels are short by one factor hue is right, and nothing is added."""
    truth = np.full((32, 32, 4), 500.0, np.float32)
    made = twiced(0.8 * truth, raw_of(truth, RGBW))
    assert made == pytest.approx(0.8 * truth, rel=1e-5)


def test_saturated_samples_say_nothing():
    truth = np.full((32, 32, 4), 500.0, np.float32)
    raw = raw_of(truth, RGBW)
    blown = replace(raw, dn=np.where(channel_map(RGBW, raw.shape) == "R", 200 + WELL_E, raw.dn))
    assert twiced(truth, blown) == pytest.approx(truth, rel=1e-5)


@pytest.mark.parametrize("tile", [RGBW, BAYER])
def test_noise_alone_adds_next_to_nothing(tile):
    """An exact estimate of a grey at 2 e-: what noise adds is under 5 % of the light in the mean square.

    chi^2 passes `SURE` by chance in a fifth of the cells. Over the frame nothing is added but what its own samples err
    by: 4096 of R and 8192 of G of variance 3 know their means to 0.027 and 0.019 e-, of which four are allowed.
    """
    truth = np.full((128, 128, len(channels(tile))), 2.0, np.float32)
    raw = raw_of(truth, tile)
    rng = np.random.default_rng(3)
    noisy = replace(raw, dn=200 + rng.poisson(2.0, raw.shape) + rng.normal(0, 1.0, raw.shape))
    added = twiced(truth, noisy) - truth
    assert 0 < np.sqrt(np.mean(added**2)) < 0.05 * 2.0
    assert np.abs(added.mean(axis=(0, 1))).max() < 4 * np.hypot(0.027, 0.019)


@pytest.mark.parametrize("tile", [RGBW, BAYER])
def test_a_region_whose_light_drowns_in_noise_gets_no_clouds(tile):
    """An exact estimate of a grey at 1 e- under 30 e- of noise: the picture's 4096 samples know it to 0.47 e-.

    Wiener's share of that, 0.53, leaves an even cast of 0.25 e- in the mean square. Cells of 4 pixels, whose 324
    samples know it to 1.7 e-, add under 0.06 by themselves, and next to nothing here: within 16 pixels the cast stays
    even.
    """
    truth = np.full((128, 128, len(channels(tile))), 1.0, np.float32)
    rng = np.random.default_rng(3)
    raw = raw_of(truth, tile, noise_e=30.0)
    noisy = replace(raw, dn=200 + rng.poisson(1.0, raw.shape) + rng.normal(0, 30.0, raw.shape))
    made = twiced(truth, noisy)
    assert np.sqrt(np.mean((made - truth) ** 2)) < 0.25
    assert np.abs(made[16:] - made[:-16]).mean() < 0.06


@pytest.mark.parametrize(("tile", "least"), [(RGBW, 0.4), (BAYER, 0.28)])
def test_dark_strong_colours_keep_their_hue(tile, least):
    """A red and a green of 4 times the other colours' share, in patches of 24 pixels at 2 e- of white in G.

    What is kept is the ratio of the colour to the mean of the other two over its true one, in logarithms: in the mean
    of both over 0.52 by RGBW and 0.35 by Bayer, and without twicing 0.27 and 0.17.
    """
    names, neutral = channels(tile), own_prior().neutral_e
    share = np.ones((96, 96, 3))
    checks = np.indices((96, 96)) // 24 % 2
    red, green = checks.sum(axis=0) == 0, checks.sum(axis=0) == 2
    share[red], share[green] = (1.0, 0.25, 0.25), (0.25, 1.0, 0.25)
    planes = np.concatenate([share, share.mean(axis=-1, keepdims=True)], axis=-1)[..., : len(names)]
    expected = raw_of(planes * 2.0 * neutral[[LETTERS.index(name) for name in names]], tile).electrons
    rng = np.random.default_rng(7)
    dn = 200 + rng.poisson(expected) + rng.normal(0, 1.5, expected.shape)
    raw = RawImage(dn, tile, 200.0, 200 + WELL_E, 1.0, 1.5, 0.0, 0.0, 0.01)
    made = pyramid.reconstruct(raw, own_prior(), neutral)[0][..., :3] / neutral[:3]
    inner = np.pad(np.ones((16, 16), bool), 4)
    inside = np.tile(inner, (4, 4))
    kept = []
    for region, colour in ((red, 0), (green, 1)):
        means = made[region & inside].mean(axis=0)
        kept.append(np.log(means[colour] / np.delete(means, colour).mean()) / np.log(4))
    assert least < np.mean(kept) < 1.1
