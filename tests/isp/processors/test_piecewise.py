"""Piecewise linear estimation as a processor: flat fields, highlights, and other curves."""

from itertools import product

import numpy as np
import pytest
from builders import BAYER_PHASES, RGBW_4X4, RGBW_PHASES, mosaic_of, raw_image

from isp.colour.colour_fit import ColourFit
from isp.ple.prior import own_prior
from isp.processors.catalogue import PROCESSORS
from isp.processors.piecewise import curves_differ
from rodcone.errors import InputError
from sensor.cfa import MOSAICS, channels
from sensor.presets import preset
from studies.training.pictures import neutral_ratios

FULL_E, INDEX = 15_000.0, {"ple_rgbw": [0, 1, 2, 3], "ple_bayer": [0, 1, 2]}
PHASES = [*(("ple_rgbw", tile) for tile in RGBW_PHASES), *(("ple_bayer", tile) for tile in BAYER_PHASES)]
SITES = [(y, x) for y in range(4) for x in range(4)]  # of a 4x4 tile, where a frame may begin
LARGE = [*((MOSAICS["rgbw_4x4"], at) for at in SITES), *((MOSAICS["quad_bayer"], at) for at in SITES)]
LARGE += [(RGBW_4X4, (0, 0)), *((MOSAICS["quad_rgbw"], at) for at in [(0, 0), (1, 0), (1, 1), (2, 3)])]


def grey(tile, level_e):
    """Exposure of a grey scene without noise; one electron a DN."""
    share = dict(zip("RGBW", own_prior().neutral_e, strict=True))
    electrons = level_e * mosaic_of(share, tile, level_e.shape)
    return raw_image(np.rint(np.minimum(electrons, FULL_E)) + 100, tile)


def test_a_flat_grey_field_stays_flat_and_grey_in_every_phase():
    for name, tile in PHASES:
        # the estimate leans on the prior: by 1 in 1000 at 1000 e-
        rgb = PROCESSORS[name].develop(grey(tile, np.full((17, 20), 1000.0)), np.eye(3)).rgb
        assert rgb == pytest.approx(np.full(rgb.shape, 1000.0), rel=1e-3), (name, tile)


@pytest.mark.sample(1)
@pytest.mark.parametrize("name", INDEX)
def test_highlights_stay_grey_and_end_at_greens_full_well(name):
    tile = RGBW_PHASES[0] if name == "ple_rgbw" else BAYER_PHASES[0]
    balance = own_prior().neutral_e[INDEX[name]]
    ramp = 5000.0 + 500.0 * np.indices((24, 80))[1]
    rgb = PROCESSORS[name].develop(grey(tile, ramp), np.eye(3), balance=balance).rgb
    assert np.abs(rgb - rgb[..., 1:2]).max() < 510.0  # a step of the ramp, at the frame's border
    assert rgb[:, -20:] == pytest.approx(np.full((24, 20, 3), FULL_E), rel=1e-3)


def test_the_own_curves_are_known_under_any_light():
    for name, light in product(INDEX, ["D65", "2856K", "sodium_high", "sodium_low", "LED-B3", "LED-V1", "moonlight"]):
        (neutral,) = neutral_ratios(preset("low_noise"), [light])
        assert not curves_differ(own_prior(), neutral[INDEX[name]], INDEX[name]), (light, name)


# `wide` under 2856 K reads as the own curves do under LEDs: that one isn't seen.
def test_other_curves_are_warned_of_in_one_line():
    for name, light in [("narrow", "D65"), ("narrow", "2856K"), ("wide", "D65")]:
        (neutral,) = neutral_ratios(preset(f"studies/configs/sensors/{name}.toml"), [light])
        raw = grey(RGBW_PHASES[0], np.full((16, 16), 1000.0))
        with pytest.warns(UserWarning, match=r"^curves: a neutral reads .*`rodcone train`$"):
            PROCESSORS["ple_rgbw"].develop(raw, np.eye(3), neutral=neutral)


@pytest.mark.sample(3)
@pytest.mark.parametrize(("tile", "at"), LARGE)
def test_a_flat_grey_field_stays_flat_and_grey_wherever_a_4x4_tile_begins(tile, at):
    turned = tuple("".join(row) for row in np.roll([list(row) for row in tile], (-at[0], -at[1]), (0, 1)))
    rgb = PROCESSORS["ple"].develop(grey(turned, np.full((17, 20), 1000.0)), np.eye(3)).rgb
    assert rgb == pytest.approx(np.full(rgb.shape, 1000.0), rel=1.5e-3)


@pytest.mark.sample(1)
@pytest.mark.parametrize(("name", "tile"), PHASES)
def test_on_a_2x2_tile_any_mosaics_processor_is_that_mosaics_own(name, tile):
    raw = grey(tile, np.geomspace(1, 5000, 30) * np.ones((25, 1)))
    neutral = own_prior().neutrals_e[3][INDEX[name]]
    pictures = [PROCESSORS[each].develop(raw, np.eye(3), neutral=neutral).rgb for each in (name, "ple")]
    assert np.array_equal(*pictures)


def test_one_or_two_channels_make_a_grey_picture():
    for tile in [("W",), ("GW", "WG"), ("RW", "WW")]:
        names = channels(tile)
        fit = ColourFit(names, np.full(len(names), 0.3), np.full((len(names),) * 2, 0.1), np.full((len(names), 3), 0.1))
        neutral = own_prior().neutral_e[["RGBW".index(name) for name in names]]
        for matrix in (np.eye(3), fit):
            rgb = PROCESSORS["ple"].develop(grey(tile, np.full((17, 20), 1000.0)), matrix, neutral=neutral).rgb
            level = 1000.0 if "G" in names else neutral[-1] * 1000.0
            assert rgb == pytest.approx(np.full(rgb.shape, level), rel=2e-3), tile


def test_what_the_prior_cant_develop_is_refused_in_one_line():
    for tile, shape in [
        (("RC", "CB"), (16, 16)),
        (("RY", "YB"), (16, 16)),
        (("RGB",) * 3, (16, 16)),
        (("RG" * 4,) * 8, (16, 16)),
        (("W",), (1, 9)),
    ]:
        with pytest.raises(InputError, match=r"^raw: mosaic .* allowed here: R, G, B and W .*use any_mosaic") as error:
            PROCESSORS["ple"].develop(raw_image(np.full(shape, 500), tile), np.eye(3))
        assert "\n" not in str(error.value), (tile, shape)


def test_one_channel_tells_nothing_of_the_light():
    raw = grey(("W",), np.geomspace(1, 2000, 30) * np.ones((25, 1)))
    pictures = [PROCESSORS["ple"].develop(raw, np.eye(3), neutral=neutral).rgb for neutral in ([3.0], None)]
    assert np.array_equal(*pictures)
