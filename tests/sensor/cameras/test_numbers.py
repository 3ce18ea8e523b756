"""Preset files of measured cameras: what a reader gets, anchors, and what another camera lends."""

import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from builders import raw_image
from file_samples import profiled
from refusal import refusal

from rodcone.errors import InputError
from sensor.cameras.frames import frame_numbers, measure_files
from sensor.cameras.library import MeasuredCamera
from sensor.cameras.noise_files import dng_numbers
from sensor.cameras.numbers import (
    PixelNumbers,
    SourcedValue,
    bits_of,
    borrowed_curves,
    completed,
    curves_csv,
    greatest_response,
    measured_curves,
    preset_text,
)
from sensor.capture import expose
from sensor.cfa import BAYER
from sensor.config_file import read_sensor
from sensor.curves import RelativeResponsesWarning
from sensor.device import draw_device
from sensor.presets import low_noise
from sensor.raw_files.raw_file import write_raw

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
    path = written(tmp_path, PixelNumbers("nothing", settings={"bits": SourcedValue(12, "sheet")}))
    refusal(read_sensor, path, match="pitch_um is missing")
    text = path.read_text("utf-8")
    for key in ("pitch_um", "fill_factor", "full_well_e", "read_noise_e", "dsnu_e", "prnu"):
        assert f"# {key} =   # not told: needed" in text
    assert "bits = 12  # sheet" in text


def test_lent_curves_have_a_monochrome_sources_quantum_efficiency_in_w(tmp_path):
    numbers = PixelNumbers("sheet 7", lent().pixel, efficiency=(0.64, 528.0))
    shape, theirs = borrowed_curves(low_noise(), "low_noise", numbers), low_noise().responses.curves
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
    shape = borrowed_curves(low_noise(), "low_noise", PixelNumbers("s", efficiency=(0.9125, 536.0)))
    assert max(curve.values.max() for curve in shape.curves.values()) == pytest.approx(1.0)
    assert "scaled by 1, to 1 electron a photon at most; W would need 1.05" in shape.note


def test_lent_curves_refuse_an_anchor_where_they_hardly_respond_and_a_mosaic_of_other_channels():
    with pytest.raises(InputError, match=r"anchor: 0\.5 electrons a photon at 1068 nm, where low_noise responds with"):
        borrowed_curves(low_noise(), "low_noise", PixelNumbers("s", efficiency=(0.5, 1068.0)))
    with pytest.raises(InputError, match="preset low_noise: channel: 'M' is unknown; allowed: B, G, R, W"):
        borrowed_curves(low_noise(), "low_noise", PixelNumbers("s", efficiency=(0.5, 530.0), cfa=("GM", "YC")))


def test_the_converters_top_is_the_white_level_or_next_above_and_k_rises_with_the_range_above_black():
    assert (bits_of(4095, 240, "x").value, bits_of(4095, 240, "x").source) == (12, "white level 4095 of x")
    # 15 000 DN above black 100, and a converter of 14 bits with the same black: 16 283 DN for the same electrons
    assert bits_of(15_100, 100, "x").source.endswith(f"ends at 16383, so its K is {16_283 / 15_000:.3f} times that")
    # black counts: 1023 of 10 bits over black 512 is 511, where 800 is 288
    assert f"{511 / 288:.3f} times that" in bits_of(800, 512, "x").source


# Raw files of flat and dark frames: the preset that they give, and files that don't belong together.


SENSOR = replace(low_noise("rgbw"), pixel=replace(low_noise().pixel, read_noise_e=3.0, dsnu_e=2.0))


@pytest.fixture(scope="module")
def files(tmp_path_factory) -> tuple[list[Path], list[Path]]:
    folder, shape = tmp_path_factory.mktemp("frames"), (96, 128)
    device, rng = draw_device(SENSOR, shape, np.random.default_rng(1)), np.random.default_rng(2)
    found = []
    for name, light_e, count in (("flat", 8000.0, 3), ("dark", 0.0, 3)):
        paths = [folder / f"{name}{index}.tif" for index in range(count)]
        for path in paths:
            write_raw(expose(np.full(shape, light_e), SENSOR, 0.01, device, rng, exact=True), path)
        found.append(paths)
    return found[0], found[1]


def test_the_preset_holds_what_was_configured_every_number_with_its_interval(files, tmp_path):
    flats, darks = files
    figures = measure_files(flats, darks, None)
    text = preset_text("Mine.", frame_numbers(figures, flats), None, "")
    path = tmp_path / "mine.toml"
    path.write_text(text.replace("[pixel]", "[pixel]\npitch_um = 2.2\nfill_factor = 0.9"), "utf-8")
    found = read_sensor(path)
    # three frames of 96 x 128 pixels know each within a few per cent, at four standard errors
    assert found.pixel.full_well_e == pytest.approx(SENSOR.pixel.full_well_e, rel=0.05)
    assert found.pixel.read_noise_e == pytest.approx(3.0, rel=0.05)
    assert found.pixel.dsnu_e == pytest.approx(2.0, rel=0.08)
    assert found.pixel.prnu == pytest.approx(0.01, rel=0.06)
    assert (found.bits, found.cfa) == (14, SENSOR.cfa)
    assert abs(found.black_dn - SENSOR.black_dn) <= 1
    for key in ("full_well_e", "read_noise_e", "dsnu_e", "prnu"):
        line = next(line for line in text.splitlines() if line.startswith(key))
        assert "95 %" in line
    for key in ("pitch_um", "fill_factor", "dark_current_e_per_s"):
        assert f"# {key} =   # not told by" in text


def test_files_that_do_not_belong_together_are_refused_by_name(files, tmp_path):
    flats, darks = files
    refusal(measure_files, [flats[0], flats[0]], darks, None, match="a file is given twice")
    other = replace(SENSOR, bits=12)
    raw = expose(np.full((96, 128), 8000.0), other, 0.01, draw_device(other, (96, 128), np.random.default_rng(1)),
                 np.random.default_rng(3), exact=True)  # fmt: skip
    write_raw(raw, tmp_path / "other.tif")
    refusal(measure_files, [*flats, tmp_path / "other.tif"], darks, None, match=r"other\.tif: white_dn is 4095")
    refusal(measure_files, darks, flats, None, match=r"flat frames: dark0\.tif")
    refusal(measure_files, [tmp_path / "absent.dng"], darks, None, match="there is no such file")
    refusal(measure_files, flats[:1] * 1000, darks[:1], None, match="1001 files")


# Noise of a DNG's profile: what it tells, what it doesn't, and what is refused.


def test_a_noise_profile_gives_the_electrons_at_white_and_the_read_noise(tmp_path):
    numbers = dng_numbers(profiled(tmp_path / "a.dng"))
    assert numbers.pixel["full_well_e"].value == pytest.approx(15_000 * 0.8)
    assert numbers.pixel["read_noise_e"].value == pytest.approx(3.0)
    assert {key: each.value for key, each in numbers.settings.items()} == {"bits": 14, "black_level_dn": 100}
    assert numbers.cfa == BAYER
    assert "ends at 16383, so its K is 1.086 times that" in numbers.settings["bits"].source  # 16 283 over 15 000 DN
    assert "ISO 400" in numbers.pixel["full_well_e"].source
    assert {"dsnu_e", "prnu", "dark_current_e_per_s"} <= set(numbers.left_out)


def test_a_file_without_a_profile_says_how_to_measure_one(tmp_path):
    write_raw(raw_image(np.full((16, 16), 500), BAYER), tmp_path / "a.tif")
    refusal(dng_numbers, tmp_path / "a.tif", match=r"has no NoiseProfile of use.*characterise --from")
