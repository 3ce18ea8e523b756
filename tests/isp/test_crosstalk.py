"""Crosstalk undone: every pixel has the charge that it collected, and full samples stay full."""

from dataclasses import replace

import numpy as np
import pytest
from builders import raw_image

from isp.colour.white_balance import neutral_response
from isp.crosstalk import beyond_the_well, unspread_charge, without_crosstalk
from isp.processors.catalogue import PROCESSORS
from sensor.calibration import ChannelNoise
from sensor.cfa import MOSAICS, channel_mixing, mask
from sensor.readout import spread_charge

RCCC = MOSAICS["rccc"]
BEHIND = np.array([100.0, 1000.0])  # electrons behind R and C
READ = channel_mixing(RCCC, 0.05) @ BEHIND


def spreading(height: int, width: int, crosstalk: float) -> np.ndarray:
    """H as a matrix, written down pixel by pixel: what goes beyond the frame's edge stays in the pixel."""
    matrix = np.zeros((height * width,) * 2)
    for row, column in np.ndindex(height, width):
        for down, across in ((1, 0), (-1, 0), (0, 1), (0, -1)):
            to = row + down, column + across
            inside = 0 <= to[0] < height and 0 <= to[1] < width
            target = to if inside else (row, column)
            matrix[target[0] * width + target[1], row * width + column] += crosstalk
        matrix[row * width + column, row * width + column] += 1 - 4 * crosstalk
    return matrix


def flat(crosstalk: float, scale: float = 1.0):
    """Raw image of an even neutral field, as read; within the frame's edge by hand too: R has four C around it."""
    red, clear = scale * BEHIND
    charge = np.where(mask(RCCC, "R", (16, 16)), red, clear)
    dn = spread_charge(charge, crosstalk)
    kept = 1 - 4 * crosstalk
    beside_red = kept * clear + crosstalk * (2 * red + 2 * clear)  # of three C two have two R, and one has none
    by_hand = [[kept * red + 4 * crosstalk * clear, beside_red], [beside_red, clear]]
    assert dn[2:-2, 2:-2] == pytest.approx(np.tile(by_hand, (6, 6)))
    raw = raw_image(np.rint(dn), RCCC, black_dn=0.0, white_dn=1e6, gain_e_per_dn=1.0, read_noise_e=2.0, dsnu_e=0.0)
    return replace(raw, crosstalk=crosstalk, dn=dn)


@pytest.mark.parametrize("crosstalk", [0.005, 0.02, 0.05, 0.1])
def test_charges_are_those_that_solve_the_equations_of_all_pixels(crosstalk: float) -> None:
    read = np.random.default_rng(3).uniform(0, 1000, (7, 10))
    solved = np.linalg.solve(spreading(7, 10, crosstalk), read.ravel()).reshape(7, 10)
    assert unspread_charge(read, crosstalk) == pytest.approx(solved, abs=1e-8)


def test_more_crosstalk_than_can_be_undone_is_told_and_left() -> None:
    raw = replace(flat(0.1), crosstalk=0.12)
    with pytest.warns(UserWarning, match="crosstalk: 0.12 isn't undone"):
        assert without_crosstalk(raw, BEHIND) is raw


def test_a_full_w_hands_on_what_its_neighbours_tell_that_it_collected() -> None:
    """A white lamp of three times W's well: R, G and B beside W get back what they collected, and not a fifth more."""
    tile = MOSAICS["rgbw"]
    behind = np.array([500.0, 1000.0, 450.0, 4900.0])
    lamp = np.where(np.hypot(*np.mgrid[-16:16, -16:16]) < 9, 1.0, 0.05)
    sites = sum(mask(tile, name, lamp.shape) * x for name, x in zip("RGBW", behind, strict=True))
    read = spread_charge(lamp * sites, 0.03)
    raw = raw_image(np.rint(read), tile, black_dn=0.0, white_dn=1600.0, gain_e_per_dn=1.0, read_noise_e=1.0, dsnu_e=0.0)
    raw = replace(raw, dn=np.minimum(read, 1600.0), crosstalk=0.03)
    inside = ~raw.saturated & (np.hypot(*np.mgrid[-16:16, -16:16]) < 5)
    charge = without_crosstalk(raw, raw.channel_mixing @ behind)
    assert charge.dn[inside] == pytest.approx((lamp * sites)[inside], rel=0.01)
    assert np.array_equal(charge.saturated, raw.saturated)
    # What none of its neighbours tells of, and what isn't full, keeps its reading.
    everything = replace(raw, dn=np.full(raw.shape, 1600.0))
    assert np.array_equal(beyond_the_well(everything, behind), everything.electrons)
    assert np.array_equal(beyond_the_well(raw, behind)[~raw.saturated], raw.electrons[~raw.saturated])


def test_a_flat_field_becomes_flat_in_each_channel() -> None:
    raw = flat(0.05)
    clear = mask(RCCC, "C", raw.shape)
    assert np.ptp(raw.dn[clear]) / raw.dn[clear].mean() > 0.08
    charge = without_crosstalk(raw, READ)
    assert charge.dn[clear] == pytest.approx(BEHIND[1], rel=1e-9)
    assert charge.dn[~clear] == pytest.approx(BEHIND[0], rel=1e-9)
    assert charge.crosstalk == 0.0


def test_dark_noise_is_that_of_the_charges() -> None:
    """Of 64 frames of 2 e- and of rounding to 3 e-. Their standard deviation is known to 0.6 %; 4 sigma are 2.5 %."""
    read = np.random.default_rng(8).normal(900.0, 2.0, (64, 16, 16))
    raw = raw_image(np.zeros((16, 16)), RCCC, black_dn=300.0, gain_e_per_dn=3.0, read_noise_e=2.0, dsnu_e=0.0)
    frames = [replace(raw, dn=np.rint(frame / 3).astype(np.uint16), crosstalk=0.05) for frame in read]
    charges = [without_crosstalk(frame, READ) for frame in frames]
    assert charges[0].dark_noise_e == pytest.approx(np.std([x.electrons for x in charges]), rel=0.025)
    assert charges[0].dark_noise_e > 1.2 * raw.dark_noise_e


def test_pixels_behind_a_density_collect_less_charge_to_hand_on() -> None:
    tile = MOSAICS["rgbw"]
    light = np.random.default_rng(5).uniform(100, 1000, (12, 16))
    white = mask(tile, "W", light.shape)
    density = np.where(white, 0.25, 1.0)
    read = spread_charge(light * density, 0.03) / density
    raw = raw_image(np.rint(read), tile, black_dn=0.0, white_dn=1e6, gain_e_per_dn=1.0)
    behind = ChannelNoise("W", 4e6, 4.0, 2.0, 0.0, 0.0, light_share=0.25)
    raw = replace(raw, dn=read, crosstalk=0.03, channel_noise=(behind,))
    assert without_crosstalk(raw, np.ones(4)).dn == pytest.approx(light, rel=1e-9)


def test_full_samples_stay_full_and_no_other_becomes_full() -> None:
    """C beside R is raised by 4 % and the other lowered by 6 %: both would cross a level of saturation between them."""
    raw = flat(0.05, scale=50.0)
    for white_dn in (46_000.0, 49_000.0, 50_000.0, 52_000.0):
        near = replace(raw, white_dn=white_dn, dn=np.minimum(raw.dn, white_dn))
        charge = without_crosstalk(near, READ)
        assert np.array_equal(charge.saturated, near.saturated), white_dn
        assert np.array_equal(charge.dn[near.saturated], near.dn[near.saturated])


def test_a_camera_without_crosstalk_is_left_alone() -> None:
    raw = raw_image(np.full((16, 16), 900), RCCC)
    assert without_crosstalk(raw, READ) is raw


@pytest.mark.parametrize(("name", "mosaic"), [("ple", "rgbw"), ("ple", "bayer"), ("bayer", "bayer")])
def test_detail_develops_as_without_crosstalk(name: str, mosaic: str) -> None:
    """Grey detail of a pixel's width: unmixed for an even field alone it would be blurred by 4 c and more."""
    tile = MOSAICS[mosaic]
    neutral = neutral_response(raw_image(np.zeros((4, 4)), tile).channels)
    neutral *= 300.0 / neutral[1]
    grey = np.random.default_rng(6).uniform(0.3, 1.0, (24, 32))
    sites = np.zeros(grey.shape)
    for channel, electrons in zip(raw_image(np.zeros((4, 4)), tile).channels, neutral, strict=True):
        sites += mask(tile, channel, grey.shape) * electrons
    noise = np.random.default_rng(7).normal(0, 5, grey.shape)
    camera = raw_image(np.zeros(grey.shape), tile, black_dn=0.0, white_dn=1e5, gain_e_per_dn=1.0, read_noise_e=5.0)
    plain = replace(camera, dn=grey * sites + noise)
    crossed = replace(camera, dn=spread_charge(grey * sites + noise, 0.02), crosstalk=0.02)
    read = crossed.channel_mixing @ neutral
    told = without_crosstalk(crossed, read)
    plain = replace(plain, read_noise_e=told.read_noise_e, dsnu_e=told.dsnu_e)
    of_plain = PROCESSORS[name].develop(plain, np.eye(3), neutral=neutral, balance=neutral).rgb
    of_crossed = PROCESSORS[name].develop(crossed, np.eye(3), neutral=read, balance=read).rgb
    # The picture's unit is a sample of G as it is read.
    assert of_crossed / read[1] == pytest.approx(of_plain / neutral[1], abs=2e-3)
