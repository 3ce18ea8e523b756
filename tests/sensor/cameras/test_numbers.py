"""Preset files of measured cameras: what a reader gets, anchors, and what another camera lends."""

import warnings

import numpy as np
import pytest
from refusal import refusal

from rodcone.errors import InputError
from sensor.cameras.library import MeasuredCamera
from sensor.cameras.numbers import (
    PixelNumbers,
    Sourced,
    bits_of,
    completed,
    curves_csv,
    greatest_response,
    lent_curves,
    measured_curves,
    preset_text,
)
from sensor.config_file import read_sensor
from sensor.curves import RelativeResponsesWarning
from sensor.presets import low_noise

NM = np.arange(380.0, 781.0, 5.0)
BELLS = {"R": (600, 0.6), "G": (540, 1.0), "B": (460, 0.8)}
CAMERA = MeasuredCamera(
    maker="Maker",
    model="One",
    creator="lab",
    laboratory="",
    equipment="",
    date="2025-11-09",
    source="collection",
    licence="Apache-2.0",
    wavelength_nm=NM,
    per_power={name: peak * np.exp(-(((NM - at) / 40) ** 2)) for name, (at, peak) in BELLS.items()},
)


def written(folder, numbers):
    path = folder / "one.toml"
    path.write_text(preset_text("Maker One.", numbers, measured_curves(CAMERA), "one_curves.csv"), "utf-8")
    (folder / "one_curves.csv").write_text(curves_csv(numbers, measured_curves(CAMERA)), "utf-8")
    return path


def lent():
    return completed(PixelNumbers("nothing"), low_noise(), "low_noise")


def test_without_an_anchor_the_responses_are_relative_and_say_so_when_opened(tmp_path):
    path = written(tmp_path, lent())
    with pytest.warns(RelativeResponsesWarning, match="hold up to one factor") as told:
        sensor = read_sensor(path)
    assert len(told) == 1
    assert sensor.responses.relative
    assert sensor.cfa == ("RG", "GB")
    for name, curve in CAMERA.responses.curves.items():
        assert np.abs(sensor.responses.curves[name].values - curve.values).max() < 1e-6
    text = path.read_text("utf-8")
    assert "collection (Apache-2.0); lab, 2025-11-09" in text
    assert "# of low_noise, not of this camera" in text


def test_an_anchor_turns_them_into_electrons_per_photon(tmp_path):
    anchored = PixelNumbers("sheet 7", lent().pixel, efficiency=(0.45, 530.0))
    path = written(tmp_path, anchored)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        sensor = read_sensor(path)
    assert not sensor.responses.relative
    at_530 = np.interp(530.0, NM, sensor.responses.curves["G"].values)
    assert at_530 == pytest.approx(0.45, rel=1e-5)
    assert "0.45 at 530 nm, sheet 7" in path.read_text("utf-8")


def test_an_anchor_that_cannot_be_is_refused():
    for value, at_nm in ((0.5, 780.0), (0.5, 1000.0), (0.99, 490.0)):
        with pytest.raises(InputError, match=r"anchor: .* is not allowed; give a quantum efficiency near a peak"):
            greatest_response(PixelNumbers("s", efficiency=(value, at_nm)), measured_curves(CAMERA))


def test_without_a_source_a_preset_names_every_key_that_is_missing(tmp_path):
    path = written(tmp_path, PixelNumbers("nothing", settings={"bits": Sourced(12, "sheet")}))
    refusal(read_sensor, path, match="pitch_um is missing")
    text = path.read_text("utf-8")
    for key in ("pitch_um", "fill_factor", "full_well_e", "read_noise_e", "dsnu_e", "prnu"):
        assert f"# {key} =   # not told: needed" in text
    assert "bits = 12  # sheet" in text


def test_lent_curves_have_a_monochrome_sources_quantum_efficiency_in_w(tmp_path):
    numbers = PixelNumbers("sheet 7", lent().pixel, efficiency=(0.64, 528.0))
    shape, theirs = lent_curves(low_noise(), "low_noise", numbers), low_noise().responses.curves
    path = tmp_path / "one.toml"
    path.write_text(preset_text("Mono.", numbers, shape, "one_curves.csv"), "utf-8")
    (tmp_path / "one_curves.csv").write_text(curves_csv(numbers, shape), "utf-8")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        sensor = read_sensor(path)
    assert not sensor.responses.relative
    assert sensor.cfa == low_noise().cfa
    factor = 0.64 / np.interp(528.0, theirs["W"].wavelength_nm, theirs["W"].values)
    for name, curve in sensor.responses.curves.items():
        # every fourth nanometre, written with six decimals
        assert np.abs(curve.values - factor * theirs[name].values[::4]).max() < 1e-5
    text = path.read_text("utf-8")
    assert "shape of low_noise's curves, not of this camera" in text
    assert "so that W has the quantum efficiency 0.64 at 528 nm, sheet 7" in text


def test_lent_curves_stop_at_one_electron_a_photon_and_say_so():
    shape = lent_curves(low_noise(), "low_noise", PixelNumbers("s", efficiency=(0.9125, 536.0)))
    assert max(curve.values.max() for curve in shape.curves.values()) == pytest.approx(1.0)
    assert "scaled by 1, to 1 electron a photon at most; W would need 1.05" in shape.note


def test_lent_curves_refuse_an_anchor_where_they_hardly_respond_and_a_mosaic_of_other_channels():
    with pytest.raises(InputError, match=r"anchor: 0\.5 electrons a photon at 1068 nm, where low_noise responds with"):
        lent_curves(low_noise(), "low_noise", PixelNumbers("s", efficiency=(0.5, 1068.0)))
    with pytest.raises(InputError, match="preset low_noise: channel: 'M' is unknown; allowed: B, G, R, W"):
        lent_curves(low_noise(), "low_noise", PixelNumbers("s", efficiency=(0.5, 530.0), cfa=("GM", "YC")))


def test_the_converters_top_is_the_white_level_or_next_above_and_k_rises_with_the_range_above_black():
    assert (bits_of(4095, 240, "x").value, bits_of(4095, 240, "x").source) == (12, "white level 4095 of x")
    # 15 000 DN above black 100, and a converter of 14 bits with the same black: 16 283 DN for the same electrons
    assert bits_of(15_100, 100, "x").source.endswith(f"ends at 16383, so its K is {16_283 / 15_000:.3f} times that")
    # black counts: 1023 of 10 bits over black 512 is 511, where 800 is 288
    assert f"{511 / 288:.3f} times that" in bits_of(800, 512, "x").source
