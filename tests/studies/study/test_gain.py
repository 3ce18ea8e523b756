"""Speeds and gains as studies and commands write them."""

from dataclasses import replace

import pytest
from loop import loop
from refusal import refusal

from sensor.photodiodes import with_gain
from sensor.presets import low_noise
from studies.study.gain import at_gain, gain_for_iso, gain_text, iso_speed
from studies.study.study import SceneChoice, Study, conditions


def test_a_speed_is_in_proportion_to_the_gain() -> None:
    base = iso_speed(low_noise())
    assert base == pytest.approx(51.6, abs=0.1)
    for gain in (2.0, 8.0):
        assert iso_speed(with_gain(low_noise(), gain)) == pytest.approx(gain * base, rel=1e-12)
    assert gain_for_iso(low_noise(), 8 * base) == pytest.approx(8.0)
    assert gain_for_iso(low_noise(), 51.0) == 1.0  # as it is told, in whole numbers


def test_infrared_that_d65_lacks_leaves_the_speed() -> None:
    whole = replace(low_noise(), window_nm=(380.0, 1000.0))
    assert iso_speed(whole) == pytest.approx(iso_speed(low_noise()), rel=1e-9)


def test_texts_of_gains_and_speeds() -> None:
    assert [gain_text(None, None), gain_text(8, None), gain_text(None, 400.0)] == ["own", "8", "ISO 400"]
    sensor = low_noise()
    assert at_gain(sensor, "own") is sensor
    for gain in (1.0, 1.5, 8.0, 1024.0):
        assert at_gain(sensor, f"{gain:g}").gain == gain
    base = iso_speed(sensor)
    assert base is not None
    for iso in (0.986 * base, 1.0 * base, 1.5 * base, 1023.0 * base):
        assert at_gain(sensor, f"ISO {iso!r}").gain == pytest.approx(max(iso / base, 1.0))
    assert iso_speed(at_gain(sensor, "ISO 400")) == pytest.approx(400.0)
    refusal(gain_text, 2.0, 400.0, match="gain: 2 beside iso 400; allowed: one of the two")


@loop(
    ("text", "words"),
    [
        ("ISO 20", ("iso: 20 is outside 51.57", "gain 1")),
        ("0.5", ("gain: 0.5 is outside",)),
        ("much", ("gain: 'much' is not known",)),
        ("0", ("gain: '0' is not known",)),
        ("-2", ("gain: '-2' is not known",)),
        ("ASA 400", ("gain: 'ASA 400' is not known",)),
        ("ISO 50.7", ("iso: 50.7 is outside 51.57",)),
        ("ISO 52900", ("iso: 52900 is outside 51.57", "to 5.281e+04")),
        ("ISO", ("gain: 'ISO' is not known",)),
    ],
)
def test_a_gain_that_no_camera_has_is_refused(text: str, words: tuple[str, ...]) -> None:
    refusal(at_gain, low_noise(), text, words=words)


def test_a_camera_without_green_has_no_speed_to_ask_for() -> None:
    refusal(gain_for_iso, low_noise("mono"), 400.0, match="which has no G to state a speed by; give a gain")


def test_gains_and_speeds_are_an_axis_of_a_study() -> None:
    scenes, levels = (SceneChoice("color_checker"),), ("1cd/m2",)
    assert [x.gain for x in conditions(Study(scenes, levels))] == ["own"]
    assert [x.gain for x in conditions(Study(scenes, levels, gains=(1, 8)))] == ["1", "8"]
    assert [x.gain for x in conditions(Study(scenes, levels, isos=(100, 400.0)))] == ["ISO 100", "ISO 400"]
    for axes, words in (
        ({"gains": (1, 2), "isos": (100,)}, "values of one of the two"),
        ({"gains": (2, 2.0)}, "each once"),
        ({"isos": (25,)}, "sensor low_noise: iso: 25 is outside"),
        ({"gains": (True,)}, "gains"),
    ):
        assert words in refusal(Study, scenes, levels, **axes)
