"""Preset files of measured cameras: what a reader gets, anchors, and what another camera lends."""

import warnings

import numpy as np
import pytest

from rodcone.errors import InputError
from sensor.cameras.library import MeasuredCamera
from sensor.cameras.numbers import PixelNumbers, Sourced, completed, curves_csv, greatest_response, preset_text
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
    path.write_text(preset_text("Maker One.", numbers, CAMERA, "one_curves.csv"), "utf-8")
    (folder / "one_curves.csv").write_text(curves_csv(numbers, CAMERA), "utf-8")
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
            greatest_response(PixelNumbers("s", efficiency=(value, at_nm)), CAMERA)


def test_without_a_source_a_preset_names_every_key_that_is_missing(tmp_path):
    path = written(tmp_path, PixelNumbers("nothing", settings={"bits": Sourced(12, "sheet")}))
    with pytest.raises(InputError, match="pitch_um is missing"):
        read_sensor(path)
    text = path.read_text("utf-8")
    for key in ("pitch_um", "fill_factor", "full_well_e", "read_noise_e", "dsnu_e", "prnu"):
        assert f"# {key} =   # not told: needed" in text
    assert "bits = 12  # sheet" in text
