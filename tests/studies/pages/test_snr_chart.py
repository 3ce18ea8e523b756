"""The report's table of light for an SNR, and its plot: numbers of `rodcone snr`, and nothing fetched."""

from base64 import b64decode
from math import pi, sqrt

import pytest
from report_sample import sample_pictures, sample_report

from sensor.presets import preset
from studies.pages.report import render_report
from studies.pages.report_text import MISSING, significant
from studies.pages.snr_chart import snr_image, snr_rows
from studies.photograph.snr import light_for_snr

SENSORS = {name: preset(name) for name in ("low_noise", "table1_output")}


def test_a_row_a_channel_with_the_numbers_of_the_command():
    rows = snr_rows(SENSORS)
    assert [row[:2] for row in rows] == [(name, channel) for name in SENSORS for channel in "RGBW"]
    green = light_for_snr(10.0, SENSORS["low_noise"], "D65", 0.033)[1]
    assert rows[1][2:] == tuple(map(significant, (green.electrons, green.luminance_cd_m2, green.illuminance_lux)))


def test_lux_and_luminance_are_those_of_a_grey_card_and_electrons_those_of_the_snr():
    """A perfectly matt card of 18 % gives 0.18 / pi cd/m^2 a lux; an SNR of 10 takes 100 electrons and the noise's."""
    for name, _, electrons, luminance_cd_m2, lux in snr_rows(SENSORS):
        pixel = SENSORS[name].pixel
        signal_e, luminance, illuminance = (float(value.replace("\N{NARROW NO-BREAK SPACE}", "")) for value in
                                            (electrons, luminance_cd_m2, lux))  # fmt: skip
        assert luminance == pytest.approx(illuminance * 0.18 / pi, rel=0.01)
        dark_e2 = pixel.read_noise_e**2 + pixel.dsnu_e**2 + pixel.dark_current_e_per_s * 0.033
        noise_e2 = signal_e + dark_e2 + (pixel.prnu * signal_e) ** 2
        assert signal_e / sqrt(noise_e2) == pytest.approx(10, rel=0.02)  # three digits, without quantisation


def test_an_snr_that_no_light_gives_is_a_dash(monkeypatch):
    monkeypatch.setattr("studies.pages.snr_chart.SNR", 1000.0)
    assert {row[2:] for row in snr_rows(SENSORS)} == {(MISSING, MISSING, MISSING)}


@pytest.mark.thorough
def test_the_plot_lies_in_its_address_and_both_in_the_report():
    head, _, content = snr_image(SENSORS).partition(",")
    assert head == "data:image/svg+xml;base64"
    assert b"low_noise W" in b64decode(content)
    report = sample_report()
    page = render_report(report, sample_pictures(report))
    assert "Light for an SNR of 10" in page
    assert page.count("data:image/svg+xml;base64") == 1


def test_a_sensors_name_is_no_formula():
    assert b"a$^b$.toml W" in b64decode(snr_image({"a$^b$.toml": SENSORS["low_noise"]}).partition(",")[2])
