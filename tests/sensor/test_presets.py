"""Presets as files: what ships, what a user copies and changes, and what is refused."""

from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest
from loop import loop
from refusal import refusal

from render.spectrum import Spectrum
from sensor.cfa import BAYER, MOSAICS, RGBW
from sensor.chip import PixelConfig
from sensor.config import LensConfig, SensorConfig
from sensor.config_file import read_sensor
from sensor.curves import read_csv, rgbw
from sensor.presets import low_noise, names, preset, preset_file, table1_output, table1_pixel

LEAST = "[pixel]\npitch_um = 2.2\nfill_factor = 0.9\nfull_well_e = 15000\nread_noise_e = 3\ndsnu_e = 4\nprnu = 0.01\n"
LENS = "[lens]\nf_number = 2.8\n"


def write(folder, text, name="camera.toml"):
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


@loop("name", names())
def test_every_preset_is_a_file_that_says_what_it_is_and_names_every_pixel_term(name):
    text = preset_file(name).read_text("utf-8")
    assert text.startswith("# ")
    table = text.partition("[pixel]")[2].partition("[[readings]]" if preset(name).chip.readings else "[lens]")[0]
    terms = {field.name for field in fields(PixelConfig)} - {"binned_well_e"}  # of a sensor that bins
    if preset(name).chip.readings:
        terms -= {"read_noise_e", "dsnu_e", "full_well_e"}  # each reading's own
    assert {line.split(" = ")[0] for line in table.splitlines() if " = " in line and line[0] != "#"} == terms
    assert preset(name).cfa == RGBW


@loop(
    ("camera", "read_noise_e", "dsnu_e", "prnu", "diffraction"),
    [
        (table1_pixel, 4580.0 / 30.0, 6000.0 / 30.0, 0.017, 0.0),  # the paper has no blur
        (table1_output, 4580.0 / (30.0 * 7.98), 6000.0 / (30.0 * 7.98), 0.017, 0.0),
        (low_noise, 1.5, 1.0, 0.01, 1.0),
    ],
)
@loop("cfa", ["rgbw", "bayer"])
def test_the_files_hold_the_last_bit_of_table_1_s_quotients(camera, read_noise_e, dsnu_e, prnu, diffraction, cfa):
    pixel = PixelConfig(2.2, 0.9, 15_000.0, read_noise_e, dsnu_e, prnu, analog_gain=7.98)
    expected = SensorConfig(pixel, LensConfig(2.8, diffraction=diffraction), cfa=MOSAICS[cfa])
    assert camera(cfa) == expected
    assert camera(cfa).gain_e_per_dn == expected.gain_e_per_dn


@loop(("pitch_um", "f_number"), [(6.0, 4.0), (3.0, 2.8), (2.0, 4.0)])
def test_variants_for_figures_1_and_5_change_pitch_well_and_f_number_alone(pitch_um, f_number):
    sensor, base = preset(f"table1_output_{pitch_um:g}um"), table1_output()
    well_e = 15_000.0 * (pitch_um / 2.2) ** 2
    assert sensor.pixel.full_well_e == pytest.approx(well_e, rel=1e-12)
    assert sensor.pixel == replace(base.pixel, pitch_um=pitch_um, full_well_e=sensor.pixel.full_well_e)
    assert sensor == replace(base, pixel=sensor.pixel, lens=LensConfig(f_number))


def test_a_copy_that_was_changed_reads_as_it_was_changed(tmp_path):
    text = preset_file("low_noise").read_text("utf-8").replace("read_noise_e = 1.5", "read_noise_e = 2.5")
    path = write(tmp_path, text.replace('cfa = "rgbw"', 'cfa = "rccc"'))
    for given in (path, str(path)):
        sensor = preset(given)
        assert sensor.pixel == replace(low_noise().pixel, read_noise_e=2.5)
        assert sensor.cfa == ("RC", "CC")
    assert preset(path, "bayer").cfa == BAYER
    assert preset(path, ["GR", "BG"]).cfa == ("GR", "BG")


@loop(
    ("text", "parts"),
    [
        ("", ("pixel is missing", "add it")),
        (LEAST, ("lens is missing", "add it")),
        ("pixel = 3\n" + LENS, ("pixel: the value is not a table",)),
        (LEAST + "read_nose_e = 3\n" + LENS, ("pixel key: 'read_nose_e' is unknown", "did you mean 'read_noise_e'?")),
        ("bit = 12\n" + LEAST + LENS, ("key: 'bit'", "did you mean 'bits'?")),
        (LEAST.replace("prnu = 0.01\n", "") + LENS, ("pixel: prnu is missing", "see rodcone new preset")),
        (LEAST.replace("prnu = 0.01", "prnu = 1.7") + LENS, ("prnu: 1.7", "1.7 % is 0.017")),
        ("bits = 20\n" + LEAST + LENS, ("bits: 20", "1 to 16")),
        ("window_nm = [400]\n" + LEAST + LENS, ("window_nm: [400]", "[shortest, longest]")),
        ('cfa = "bayr"\n' + LEAST + LENS, ("cfa: 'bayr'", "did you mean 'bayer'?")),
        ('cfa = ["RG", "B"]\n' + LEAST + LENS, ("cfa", "differ in length")),
        ("cfa = 3\n" + LEAST + LENS, ("cfa: 3",)),
        ('cfa = ["RQ"]\n' + LEAST + LENS, ("responses: channel: 'Q'",)),
        ("[pixel\n", ("can't be read", "rodcone new preset")),
    ],
)
def test_a_file_that_describes_no_camera_is_refused_in_one_line_with_its_name(tmp_path, text, parts):
    refusal(read_sensor, write(tmp_path, text), words=("camera.toml", *parts))


# Measured responses

CURVES = "wavelength_nm,R,G,B,W\n380,0,0,0.2,0.9\n500,0.1,0.8,0.8,0.9\n600,0.9,0.3,0,0.9\n780,0.8,0.1,0,0.9\n"
STATED = '[responses]\ncsv = "curves.csv"\nrange_nm = [400, 700]\n'


def test_measured_responses_are_read_beside_the_file_with_all_that_it_states(tmp_path):
    write(tmp_path, CURVES, "curves.csv")
    write(tmp_path, "wavelength_nm,t\n380,1\n600,1\n700,0\n", "cut.csv")
    write(tmp_path, "wavelength_nm,qe\n380,0.5\n780,0.4\n", "qe.csv")
    plain = read_sensor(write(tmp_path, LEAST + LENS + STATED + 'quantum_efficiency = "included"\n'))
    expected = read_csv(tmp_path / "curves.csv", range_nm=(400.0, 700.0))
    both = read_sensor(write(tmp_path, LEAST + LENS + STATED + 'quantum_efficiency = "qe.csv"\nir_cut = "cut.csv"\n'))
    numbers = read_sensor(write(tmp_path, LEAST + LENS + STATED + "quantum_efficiency = 0.5\nir_cut = 650\n"))
    cut = Spectrum([380.0, 600.0, 700.0], [1.0, 1.0, 0.0])
    efficiency = Spectrum([380.0, 780.0], [0.5, 0.4])
    for sensor, curves in (
        (plain, expected),
        (both, read_csv(tmp_path / "curves.csv", range_nm=(400, 700), ir_cut=cut, quantum_efficiency=efficiency)),
        (numbers, read_csv(tmp_path / "curves.csv", range_nm=(400, 700), ir_cut=650.0, quantum_efficiency=0.5)),
    ):
        for channel in "RGBW":
            one, other = sensor.responses.curves[channel], curves.curves[channel]
            np.testing.assert_array_equal(one.wavelength_nm, other.wavelength_nm)
            np.testing.assert_array_equal(one.values, other.values)
    assert plain.responses.curves["W"].values.max() == 0.9
    assert numbers.responses.curves["W"].values.max() == 0.45


@loop(
    ("text", "parts"),
    [
        (STATED, ("responses: quantum_efficiency is missing", '"included"')),
        ('[responses]\ncsv = "curves.csv"\nquantum_efficiency = 0.5\n', ("range_nm is missing",)),
        ("[responses]\nrange_nm = [400, 700]\nquantum_efficiency = 0.5\n", ("csv is missing",)),
        (STATED + 'quantum_efficency = "included"\n', ("responses key: 'quantum_efficency'", "did you mean")),
        (STATED + "quantum_efficiency = 56.0\n", ("quantum_efficiency: 56.0", "0 to 1")),
        (STATED + 'quantum_efficiency = "absent.csv"\n', ("absent.csv", "can't be read")),
        (STATED + 'quantum_efficiency = "curves.csv"\n', ("4 columns beside wavelength_nm",)),
        (
            STATED.replace("[400, 700]", "[300, 700]") + 'quantum_efficiency = "included"\n',
            ("range_nm: (300.0, 700.0)",),
        ),
        (STATED.replace('"curves.csv"', "3") + "quantum_efficiency = 0.5\n", ("csv: 3 is not a text in quotes",)),
        ("responses = 3\n", ("responses: the value is not a table",)),
    ],
)
def test_responses_that_leave_something_to_guess_are_refused(tmp_path, text, parts):
    write(tmp_path, CURVES, "curves.csv")
    whole = text + LEAST + LENS if text.startswith("responses =") else LEAST + LENS + text
    refusal(read_sensor, write(tmp_path, whole), words=("camera.toml", *parts))


def test_a_window_that_is_not_stated_is_told_where_it_takes_some_of_a_response(tmp_path):
    write(tmp_path, "wavelength_nm,W\n350,0\n400,0.5\n700,0.5\n1000,0.2\n", "nir.csv")
    mono = 'cfa = "mono"\n' + LEAST + LENS
    stated = '[responses]\ncsv = "nir.csv"\nrange_nm = [350, 1000]\nquantum_efficiency = "included"\n'
    with pytest.warns(UserWarning, match=r"350 to 1000 nm it lets in 380 to 780; give window_nm = \[350, 1000\] too"):
        read_sensor(write(tmp_path, mono + stated))
    for first, fix in ((500, r"too, or range_nm = \[500, 780\]$"), (790, r"give window_nm = \[790, 1000\] too$")):
        with pytest.warns(UserWarning, match=fix):
            read_sensor(write(tmp_path, mono + stated.replace("350,", f"{first},")))
    for whole in ("window_nm = [380, 780]\n" + mono + stated, mono + stated + "ir_cut = 700\n"):
        read_sensor(write(tmp_path, whole.replace("350,", "375,")))


def test_without_responses_the_project_s_own_are_used_and_c_is_w_s_curve():
    assert low_noise().responses is rgbw()
    clear = preset("low_noise", "rccc").responses
    assert clear.curves["C"] is rgbw().curves["W"]
    assert clear.curves["R"] is rgbw().curves["R"]


def test_an_unknown_preset_is_refused_by_name_also_for_its_file(tmp_path):
    for call in (preset, preset_file):
        refusal(call, "table1_pixl", match=r"sensor preset: 'table1_pixl' is unknown.*did you mean 'table1_pixel'")
    refusal(preset, Path(tmp_path) / "absent.toml", match=r"absent\.toml")
