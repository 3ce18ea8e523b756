"""Lamps that flicker in a photograph: names of groups, each lamp's part of the light, and what a file's rows show."""

import json
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from refusal import refusal

import rodcone as public
from render.transport import Transport
from sensor.flicker.rows import row_weights
from sensor.flicker.waveform import Waveform, pwm
from studies.photograph.lamps import ALL, flicker_of, lamp_parts
from studies.photograph.shot import Order, check, take

NM = np.array([450.0, 550.0, 650.0])
RADIANCE = public.SpectralRadiance(np.full((64, 32, 40), 2e-4), np.arange(385.0, 780.0, 10.0))


@cache
def lit() -> Transport:
    """A scene of several light groups."""
    return public.render("night_street", (8, 8), wavelength_nm=NM, spp=4)


def test_texts_name_groups_or_all_lamps_and_a_later_one_wins():
    sodium, switched = Waveform(100.0, 0.95), pwm(1000.0, 0.25)
    groups = ("moon", "led")
    assert flicker_of(["sodium_high@100Hz"], groups) == dict.fromkeys(groups, sodium)
    both = ["sodium_high@100Hz", "led=pwm@1000Hz:0.25"]
    assert flicker_of(both, groups) == {"moon": sodium, "led": switched}
    assert flicker_of(["led=pwm@1000Hz:0.25"], groups) == {"led": switched}
    assert flicker_of(["sodium_high@100Hz"], ()) == {ALL: sodium}
    assert flicker_of((), groups) == {}
    refusal(flicker_of, ["sun=sodium_high@100Hz"], groups, match="light group: 'sun' is unknown")
    refusal(flicker_of, ["sun=sodium_high@100Hz"], (), match="lamps aren't known apart.*write sodium_high@100Hz")


def test_parts_of_lamps_sum_to_the_light_at_any_level():
    transport, lamp = lit(), Waveform(100.0, 0.5)
    names = list(transport.groups)
    assert len(names) > 1
    for level in ({}, {"luminance_cd_m2": 30.0}):
        whole = transport.relight(**level)
        parts = [lamp_parts(transport, {}, level, {name: lamp})[0][1] for name in names]
        found, bright = sum(part.values for part in parts), whole.values.max(axis=-1, keepdims=True)
        # Where bands of 100 nm split a lamp's line, the whole stops at 0 and a part doesn't.
        np.testing.assert_allclose(found, whole.values, atol=1e-5 * bright.max())
    assert lamp_parts(transport, {}, {}, dict.fromkeys(names, lamp)) == [(lamp, None)]
    assert lamp_parts(transport, {}, {}, {ALL: lamp}) == [(lamp, None)]
    assert lamp_parts(transport, {}, {}, {}) == []


def test_capture_weighs_rows_and_starts_where_its_generator_says():
    sensor = replace(public.low_noise("mono"), row_time_us=100.0)
    lamp = public.waveform("sodium_high@100Hz")
    frames = [
        public.capture(RADIANCE, sensor, "2ms", rng=np.random.default_rng(seed), flicker="sodium_high@100Hz")
        for seed in (1, 1, 2)
    ]
    np.testing.assert_array_equal(frames[0].dn, frames[1].dn)
    steady = public.capture(RADIANCE, sensor, "2ms").electrons.mean()
    for frame, seed in ((frames[0], 1), (frames[2], 2)):
        start_s = np.random.default_rng(seed).random()
        weights = row_weights(lamp, sensor, 64, 0.002, start_s)
        assert np.ptp(weights) > 1.5
        np.testing.assert_allclose(frame.electrons.mean(axis=1) / steady, weights, atol=0.06)  # 32 pixels of 500 e-
    by_rule = public.capture(RADIANCE, public.low_noise(), flicker=Waveform(100.0, 0.3))
    assert by_rule.exposure_s / 0.01 == pytest.approx(round(by_rule.exposure_s / 0.01))
    refusal(public.capture, RADIANCE, "staggered", "2ms", flicker="sodium_high@100Hz", match="after a part of the")


@pytest.mark.thorough
def test_a_photograph_without_flicker_is_as_before_and_a_steady_lamp_changes_no_mean(tmp_path):
    """One order three ways: none, one group's lamp, whole periods of it, which leave every row its light."""
    order = Order("night_street", tmp_path / "a.dng", cfa="bayer", exposure="10ms", level="5cd/m2", height=32, spp=1)
    plain = public.read_raw(take(order).paths[0])
    rolling = replace(order, row_time="100us")
    np.testing.assert_array_equal(public.read_raw(take(rolling).paths[0]).dn, plain.dn)
    steady = take(replace(rolling, flicker=("sodium=sodium_high@100Hz",)))
    whole = public.read_raw(steady.paths[0])
    assert whole.electrons.mean() == pytest.approx(plain.electrons.mean(), rel=0.02)
    together = take(replace(order, flicker=("fluorescent@100Hz",)))
    assert any("all rows are exposed together" in note for note in together.notes)
    json.dumps(together.facts)


def test_orders_are_refused_before_a_render():
    refusal(check, Order("night_street", flicker=("sun=fluorescent@100Hz",)), match="flicker: light group: 'sun'")
    refusal(check, Order("night_street", flicker=("fluorescent",)), match="is no waveform")
    refusal(check, Order("night_street", row_time="15"), match="row_time: '15' is not a time.*15ms")
    shaken = Order("night_street", flicker=("fluorescent@100Hz",), shake="hand")
    assert check(shaken).flicker
    check(Order("night_street", row_time="15us", shake="hand"))
