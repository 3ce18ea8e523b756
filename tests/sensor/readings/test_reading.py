"""Sensor files with several readings: what they become, and what is refused in one line."""

import numpy as np
import pytest
from loop import loop
from refusal import refusal

from sensor.chip import Reading
from sensor.config_file import read_sensor
from sensor.exposure import exposure_of_electrons_s
from sensor.presets import preset, preset_file

PIXEL = "[pixel]\npitch_um = 2.2\nfill_factor = 0.9\nprnu = 0.01\n"
LENS = "[lens]\nf_number = 2.8\n"
ONE = "[[readings]]\nread_noise_e = 2\ndsnu_e = 1\nfull_well_e = 2000\n"
OTHER = "[[readings]]\nread_noise_e = 6\ndsnu_e = 3\nfull_well_e = 9000\n"
SMALL = OTHER + 'photodiode = "small"\nlight_share = 0.1\n'
LARGE = ONE + 'photodiode = "large"\nlight_share = 0.9\n'


def read(folder, text):
    path = folder / "camera.toml"
    path.write_text(text, encoding="utf-8")
    return read_sensor(path)


def test_a_file_s_readings_are_the_sensor_s_and_its_pixel_tells_their_ends(tmp_path):
    sensor = read(tmp_path, PIXEL + LARGE + SMALL + LENS)
    assert sensor.chip.readings == (Reading(2, 1, 2000, 0.9, 1.0, "large"), Reading(6, 3, 9000, 0.1, 1.0, "small"))
    assert sensor.pixel.full_well_e == 90_000
    assert sensor.pixel.read_noise_e == pytest.approx(2 / 0.9)
    assert sensor.metered_well_e("G") == pytest.approx(2000 / 0.9)
    assert read(tmp_path, PIXEL + ONE + OTHER + LENS).metered_well_e("G") == 9000
    assert preset("low_noise").metered_well_e("G") == 15_000
    assert preset("low_noise").chip.readings == ()


def test_switching_and_merging_are_a_word_of_the_file(tmp_path):
    assert read(tmp_path, PIXEL + ONE + OTHER + LENS).chip.readout == "merged"
    assert read(tmp_path, 'readout = "switched"\n' + PIXEL + ONE + OTHER + LENS).chip.readout == "switched"
    text = preset_file("dual_gain").read_text("utf-8")
    assert read(tmp_path, text.replace('readout = "merged"', 'readout = "switched"')).chip.readout == "switched"


@loop(
    ("text", "parts"),
    [
        (PIXEL + ONE + LENS, ("readings: 1 is outside 2 to 8",)),
        (PIXEL + ONE * 9 + LENS, ("readings: 9 is outside 2 to 8",)),
        (PIXEL + LENS + "[readings]\nread_noise_e = 2\n", ("readings:", "no list of tables", "[[readings]]")),
        ("readings = [1, 2]\n" + PIXEL + LENS, ("readings: [1, 2] is no list of tables",)),
        (PIXEL + "read_noise_e = 2\n" + ONE + OTHER + LENS, ("pixel: read_noise_e beside [[readings]]",)),
        (PIXEL + ONE.replace("dsnu_e = 1\n", "") + OTHER + LENS, ("readings: dsnu_e is missing",)),
        (PIXEL + ONE + OTHER + "gain = 4\n" + LENS, ("readings key: 'gain' is unknown",)),
        (PIXEL + ONE + OTHER + "read_nose_e = 4\n" + LENS, ("did you mean 'read_noise_e'?",)),
        (PIXEL + ONE + OTHER + "photodiode = 3\n" + LENS, ("photodiode: 3 is not a text in quotes",)),
        (PIXEL + (ONE + "time_share = 0.5\n") * 2 + LENS, ("time_share: [0.5, 0.5]", "divide by 0.5")),
        (PIXEL + ONE + OTHER + "light_share = 0.5\n" + LENS, ("light_share: [1.0, 0.5]", "name photodiodes apart")),
        (PIXEL + LARGE + SMALL.replace("0.1", "0.2") + LENS, ("light_share: [0.9, 0.2]", "1 together")),
        ('readout = "both"\n' + PIXEL + ONE + OTHER + LENS, ("readout: 'both' is unknown", "merged, switched")),
        ('readout = "switched"\n' + PIXEL + LARGE + SMALL + LENS, ("readout: 'switched' between shares",)),
        ('readout = "switched"\n' + PIXEL + "read_noise_e = 1\ndsnu_e = 1\nfull_well_e = 9\n" + LENS, ("without",)),
        ('binning = "charge"\ncfa = "quad_bayer"\n' + PIXEL + ONE + OTHER + LENS, ("binning: 'charge' with several",)),
        ("readout = [1]\n" + PIXEL + ONE + OTHER + LENS, ("readout: [1] is not a text in quotes",)),
    ],
)
def test_readings_that_no_pixel_has_are_refused_in_one_line(tmp_path, text, parts):
    refusal(read, tmp_path, text, words=("camera.toml", *parts))


def test_auto_exposure_aims_at_the_most_sensitive_photodiode():
    per_second_e = np.full((8, 8, 4), 1e6)
    for name, well_e in (("low_noise", 15_000.0), ("staggered", 15_000.0), ("split_pixel", 24_200.0)):
        sensor = preset(name)
        filling_e = 1e6 + sensor.pixel.dark_current_e_per_s
        assert exposure_of_electrons_s("auto", per_second_e, sensor, 1.0) == pytest.approx(0.8 * well_e / filling_e)
