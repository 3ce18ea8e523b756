"""Figures of cameras whose window opens beyond 780 nm: a score needs no scene, so that light goes as its table does."""

from dataclasses import replace
from math import inf

import numpy as np
import pytest
from refusal import refusal

import rodcone as public
from sensor.config import SensorConfig
from sensor.presets import preset
from studies.photograph.snr import light_for_snr
from studies.score.over_light import over_light
from studies.score.score import definitions

EXPOSURE_S = 0.01
FAR_NM = 1068.0


def open_camera(low_nm: float = 380.0, high_nm: float = FAR_NM) -> SensorConfig:
    """The study's camera without an infrared filter."""
    return replace(preset("studies/configs/sensors/without_filter.toml"), window_nm=(low_nm, high_nm))


def computed(sensor: SensorConfig, light: str, group: str) -> dict[str, float]:
    found = definitions(sensor, light, EXPOSURE_S, [group])
    return {merit.name: merit.computed for each in found for merit in each.merits}


def test_a_light_that_ends_at_780_nm_gives_a_wider_window_the_same_speeds() -> None:
    """CIE's table of D65 has no power beyond, so that the window doesn't matter; the row says where the table ends."""
    wide, narrow = (computed(open_camera(high_nm=end), "D65", "iso_12232") for end in (FAR_NM, 780.0))
    lamp = "snr1s.lux"  # 3200 K goes on, and comes with the noise's figures
    assert wide.pop(lamp) < 0.5 * narrow.pop(lamp)
    assert wide == pytest.approx(narrow, rel=1e-9)
    for end, told in ((FAR_NM, True), (780.0, False)):
        found = definitions(open_camera(high_nm=end), "D65", EXPOSURE_S, ["print"])
        words = [merit.conditions for each in found for merit in each.merits if "D65" in merit.conditions]
        assert {"D65 is known over 300-780 nm and counts as dark outside" in x for x in words} == {told}


def test_speed_and_snr1s_count_the_infrared_of_a_hot_lamp_by_hand() -> None:
    """Planck's photons times the response, summed in steps of 0.05 nm to either end of the window."""
    nm = np.arange(380.0, FAR_NM, 0.05) + 0.025

    def photons(kelvin: float) -> np.ndarray:
        return nm**-4 / np.expm1(1.438776877e7 / (nm * kelvin))

    curve = open_camera().responses.curves["G"]
    response = np.interp(nm, curve.wavelength_nm, curve.values)
    for light, kelvin, group, name, power in (
        ("3000K", 3000.0, "iso_12232", "iso_12232.saturation_speed", 1),
        ("D65", 3200.0, "snr1s", "snr1s.lux", -1),
    ):
        seen = response * photons(kelvin)
        expected = (seen.sum() / seen[nm < 780].sum()) ** power
        wide, narrow = (computed(open_camera(high_nm=end), light, group)[name] for end in (FAR_NM, 780.0))
        assert wide / narrow == pytest.approx(expected, rel=1e-3)
    assert expected < 0.35  # two thirds of what it collects is infrared


def test_figures_that_a_light_cannot_give_are_left_out_with_the_reason() -> None:
    """D65 ends where this camera begins: SNR1s, of 3200 K, and EMVA's figures stand; so does all under 3000 K."""
    infrared = open_camera(800.0)
    groups = ["snr1s", "print", "iso_17321", "ieee_2020"]
    rows = {x.name: x for one in definitions(infrared, "D65", EXPOSURE_S, groups) for x in one.merits}
    given = [name for name, row in rows.items() if not row.missing]
    assert given == ["snr1s.lux"]
    assert len(rows) > 15
    reason = rows["iso_12232.saturation_speed"].missing
    assert reason.startswith("D65 is known over 300-780 nm, where G collects nothing")
    found = definitions(infrared, "3000K", EXPOSURE_S, ["iso_12232", "iso_17321"])
    lit = {merit.name: merit for each in found for merit in each.merits}
    assert [name for name, row in lit.items() if row.missing] == ["iso_17321.index", "color_checker.delta_e"]
    assert "can't tell colours apart" in lit["iso_17321.index"].missing  # beyond 780 nm R, G and B are W's
    assert list(definitions(open_camera(1110.0, 1200.0), "D65", EXPOSURE_S, ["emva_1288"])) == []
    refused = refusal(lambda: list(definitions(open_camera(1110.0, 1200.0), "D65", EXPOSURE_S, ["snr10"])))
    assert "light: E is known over 300-1100 nm, where G collects nothing" in refused


def test_no_light_is_enough_where_the_lamp_has_none_that_the_camera_sees() -> None:
    assert {row.luminance_cd_m2 for row in light_for_snr(10.0, open_camera(800.0), "D65", EXPOSURE_S)} == {inf}
    (row,) = over_light(open_camera(800.0), "D65", EXPOSURE_S, 0, lux=[100.0])
    assert row.snr_db == -inf


def test_calibration_goes_as_far_as_the_window() -> None:
    """Under D65 the infrared is dark, and under a hot lamp it greys the matrix's inverse."""
    wide, narrow = (open_camera(high_nm=end) for end in (FAR_NM, 780.0))
    matrices = [public.calibrate(one, public.illuminant("D65")).to_srgb for one in (wide, narrow)]
    assert matrices[0] == pytest.approx(matrices[1], rel=1e-6)
    hot, cut = (public.calibrate(one, public.illuminant("3000K")).to_srgb for one in (wide, narrow))
    assert np.linalg.cond(hot) > 2 * np.linalg.cond(cut)
