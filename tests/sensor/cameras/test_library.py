"""Measured responses: reading a copy by name, and white balances beside LibRaw's."""

import shutil
from pathlib import Path

import numpy as np
import pytest
from file_samples import LIBRARY_NM as NM
from file_samples import camera_json, library_copy
from loop import loop
from refusal import refusal

from render.illuminants import illuminant
from render.spectrum import photons_per_joule
from sensor.cameras.library import VARIABLE, measured_camera, measured_cameras, read_library


@pytest.fixture
def library(tmp_path, monkeypatch) -> Path:
    own = camera_json(header__model="Alone", header__document_creator="other")
    for channel in range(3):
        most = max(row[channel] for row in own["spectral_data"]["data"]["main"].values())
        for row in own["spectral_data"]["data"]["main"].values():
            row[channel] /= most
    copy = library_copy(tmp_path / "copy", camera_json(), own)
    monkeypatch.setenv(VARIABLE, str(copy))
    return copy


def test_a_camera_is_what_its_file_says(library):
    found = measured_camera("maker  MODEL one")
    assert list(measured_cameras()) == ["Nikon D5100", "Maker Model One", "Maker Alone"]
    assert (found.maker, found.date, found.licence) == ("Maker", "2025-11-09", "Apache-2.0")
    assert found.text == "lab, 2025-11-09, double monochromator"
    green = np.array([row[1] for row in camera_json()["spectral_data"]["data"]["main"].values()])
    assert np.array_equal(found.per_power["G"], green)


def test_electrons_of_equal_photons_are_those_of_equal_power_over_the_wavelength(library):
    found = measured_camera("Maker Model One")
    curves = found.responses.curves
    ratio = curves["R"].values[44] / curves["B"].values[16]  # at 600 and 460 nm
    assert ratio == pytest.approx(0.6 / 0.8 * 460 / 600, rel=1e-4)
    assert max(curve.values.max() for curve in curves.values()) == 1.0
    assert found.responses.relative
    # a light's photons times the response are its power times the published curve, up to one factor
    power = illuminant("D65").band_average(NM, 5.0)
    by_photons = [np.sum(power * photons_per_joule(NM) * curve.values) for curve in curves.values()]
    by_power = [np.sum(power * curve) for curve in found.per_power.values()]
    assert np.ptp(np.divide(by_photons, by_power)) < 1e-9 * by_photons[0] / by_power[0]


def test_a_camera_whose_channels_were_divided_each_by_its_own_maximum_is_told(library):
    assert measured_camera("Maker Model One").balanced
    assert not measured_camera("Maker Alone").balanced


@loop(
    ("camera", "words"),
    [
        ("{", "can't be read"),
        ("[" * 100_000, "can't be read"),
        (camera_json(header__license="CC-BY-NC"), "licence 'CC-BY-NC'"),
        (camera_json(spectral_data__units="A/W"), "no relative R, G and B"),
        (camera_json(spectral_data__data__main={"380": [0.1, 0.2, 0.3]}), "wavelengths"),
        (camera_json(spectral_data__data__main={str(nm): [0.1, -0.1, 0.3] for nm in NM}), "not 0 to 1"),
        (camera_json(header__document_creation_date=5), "TypeError"),
    ],
)
def test_a_damaged_camera_is_refused_in_one_line(tmp_path, camera, words):
    copy = library_copy(tmp_path / "copy", camera_json(), camera)
    assert words in refusal(read_library, copy)
    shutil.rmtree(copy)  # the next one lies there too


def test_an_unknown_name_and_a_library_that_is_not_there_say_what_to_do(tmp_path, monkeypatch, library):
    refusal(measured_camera, "Maker Alon", match="did you mean 'Maker Alone'")
    monkeypatch.setenv(VARIABLE, str(tmp_path / "nowhere"))
    refusal(measured_cameras, match="allowed: a copy of rawtoaces-data")
    monkeypatch.delenv(VARIABLE)
    refusal(measured_camera, "Maker Model One", match=r"allowed: Nikon D5100, .* RODCONE_CAMERAS=FOLDER")


def test_every_installation_has_a_camera_by_name_with_its_source(monkeypatch):
    monkeypatch.delenv(VARIABLE, raising=False)
    found = measured_camera("nikon d5100")
    assert list(measured_cameras()) == ["Nikon D5100"]
    assert not found.balanced
    assert found.licence == "BSD-3-Clause"
    assert "10.1364/JOSAA.32.000381" in found.source
    assert [found.wavelength_nm[0], found.wavelength_nm[-1], found.wavelength_nm.size] == [380.0, 780.0, 81]
    # The paper's red, green and blue are greatest, 1, at these; per photon the shorter waves' peak is the greatest.
    peaks = {name: found.wavelength_nm[curve.argmax()] for name, curve in found.per_power.items()}
    assert peaks == {"R": 595.0, "G": 530.0, "B": 460.0}
    greatest = {name: curve.values.max() for name, curve in found.responses.curves.items()}
    assert greatest["B"] == 1.0
    assert greatest["R"] == pytest.approx(460 / 595, rel=0.01)
