"""Exposures that need a look at a frame's light are found once: a sweep that goes on reads them."""

from dataclasses import replace

import numpy as np
import pytest

from sensor.exposure import AUTO, AUTO_INFORMATION, best_exposure
from sensor.presets import preset
from studies.metrics.truth import Light
from studies.study.gain import at_gain
from studies.sweep import frames
from studies.sweep.frames import UnitFrame, kept_exposures
from studies.sweep.stored import keep_array

LEVELS = ("0.002cd/m2", "2cd/m2", "300lux")
LUMINANCES_CD_M2 = 0.002, 2.0, 300 / 4.0
LONGEST_S = 0.066


@pytest.fixture
def frame(tmp_path):
    rng = np.random.default_rng(5)
    electrons = keep_array(tmp_path, rng.gamma(2.0, 4e3, (16, 16)))
    light = Light(wavelength_nm=np.array([550.0]), width_nm=np.array([10.0]), spectrum=np.ones(1), lamp=None)
    return UnitFrame(
        key="a",
        sensor=replace(preset("low_noise"), gain_limit=16.0),
        light=light,
        white_cd_m2=1.0,
        lux_per_cd_m2=4.0,
        auto_s=0.5,
        auto_w_s=0.2,
        truth=tmp_path / "none",
        electrons=tmp_path / electrons,
        errors=tmp_path / "none",
    )


def no_search(*args, **kwargs):
    raise AssertionError("the ladder is climbed again")


@pytest.mark.parametrize("gain", ["own", "2"])
def test_a_second_look_finds_what_the_first_has_left(tmp_path, frame, monkeypatch, gain):
    made = kept_exposures(tmp_path, frame, AUTO_INFORMATION, gain, LEVELS, LONGEST_S)
    sensor = at_gain(frame.sensor, gain)
    per_second_e = np.load(frame.electrons)
    for (exposure_s, camera), luminance in zip(made, LUMINANCES_CD_M2, strict=True):
        green_s = frame.auto_s / luminance / sensor.gain
        assert (exposure_s, camera) == best_exposure(per_second_e * luminance, sensor, green_s, LONGEST_S)
    assert (made[0][1].gain > sensor.gain) == (gain == "own")  # a gain that is given stays
    assert made[2][1] == sensor

    monkeypatch.setattr(frames, "best_exposure", no_search)
    assert kept_exposures(tmp_path, frame, AUTO_INFORMATION, gain, LEVELS, LONGEST_S) == made
    others = [
        (replace(frame, key="b"), AUTO_INFORMATION, gain, LEVELS, LONGEST_S),
        (frame, AUTO_INFORMATION, "4", LEVELS, LONGEST_S),
        (frame, AUTO_INFORMATION, gain, LEVELS[:2], LONGEST_S),
        (frame, AUTO_INFORMATION, gain, LEVELS, 2 * LONGEST_S),
    ]
    for other in others:
        with pytest.raises(AssertionError, match="again"):
            kept_exposures(tmp_path, *other)
    assert len(kept_exposures(tmp_path, frame, AUTO, gain, LEVELS, LONGEST_S)) == len(LEVELS)
