"""Piecewise linear estimation as a processor: flat fields, highlights, and other curves."""

import warnings

import numpy as np
import pytest
from builders import BAYER_PHASES, RGBW_PHASES, raw_image

from isp.ple.prior import own_prior
from isp.processors.catalogue import PROCESSORS
from isp.processors.piecewise import curves_differ
from sensor.cfa import channel_map, channels
from sensor.presets import preset
from studies.training.pictures import neutral_electrons

FULL_E, INDEX = 15_000.0, {"ple_rgbw": [0, 1, 2, 3], "ple_bayer": [0, 1, 2]}
PHASES = [*(("ple_rgbw", tile) for tile in RGBW_PHASES), *(("ple_bayer", tile) for tile in BAYER_PHASES)]


def grey(tile, level_e):
    """Exposure of a grey scene without noise; one electron a DN."""
    share = dict(zip("RGBW", own_prior().neutral_e, strict=True))
    electrons = level_e * np.vectorize(share.get)(channel_map(tile, level_e.shape))
    return raw_image(np.rint(np.minimum(electrons, FULL_E)) + 100, tile)


@pytest.mark.parametrize(("name", "tile"), PHASES)
def test_a_flat_grey_field_stays_flat_and_grey_in_every_phase(name, tile):
    # the estimate leans on the prior: by 1 in 1000 at 1000 e-
    rgb = PROCESSORS[name].develop(grey(tile, np.full((17, 20), 1000.0)), np.eye(3)).rgb
    assert rgb == pytest.approx(np.full(rgb.shape, 1000.0), rel=1e-3)


@pytest.mark.parametrize("name", INDEX)
def test_highlights_stay_grey_and_end_at_greens_full_well(name):
    tile = RGBW_PHASES[0] if name == "ple_rgbw" else BAYER_PHASES[0]
    balance = own_prior().neutral_e[INDEX[name]]
    ramp = 5000.0 + 500.0 * np.indices((24, 80))[1]
    rgb = PROCESSORS[name].develop(grey(tile, ramp), np.eye(3), balance=balance).rgb
    assert np.abs(rgb - rgb[..., 1:2]).max() < 510.0  # a step of the ramp, at the frame's border
    assert rgb[:, -20:] == pytest.approx(np.full((24, 20, 3), FULL_E), rel=1e-3)


@pytest.mark.parametrize("light", ["D65", "2856K", "sodium_high", "sodium_low", "LED-B3", "LED-V1", "moonlight"])
@pytest.mark.parametrize("name", INDEX)
def test_the_own_curves_are_known_under_any_light(name, light):
    (neutral,) = neutral_electrons(preset("low_noise"), [light])
    assert not curves_differ(own_prior(), neutral[INDEX[name]], INDEX[name])


# `wide` under 2856 K reads as the own curves do under LEDs: that one isn't seen.
@pytest.mark.parametrize(("name", "light"), [("narrow", "D65"), ("narrow", "2856K"), ("wide", "D65")])
def test_other_curves_are_warned_of_in_one_line(name, light):
    (neutral,) = neutral_electrons(preset(f"studies/configs/sensors/{name}.toml"), [light])
    raw = grey(RGBW_PHASES[0], np.full((16, 16), 1000.0))
    with pytest.warns(UserWarning, match=r"^curves: a neutral reads .*`rodcone train`$"):
        PROCESSORS["ple_rgbw"].develop(raw, np.eye(3), neutral=neutral)


def test_own_curves_are_not_warned_of():
    raw = grey(BAYER_PHASES[0], np.full((16, 16), 1000.0))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        picture = PROCESSORS["ple_bayer"].develop(raw, np.eye(3), neutral=own_prior().neutral_e[:3])
    assert set(picture.balance) == set(channels(raw.cfa))
