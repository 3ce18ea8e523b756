"""EMVA 1288 reports as TOML: each symbol's conversion, what is left out, the shipped ones, and what is refused."""

import tomllib
from dataclasses import replace
from math import hypot
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from file_samples import REPORT as WHOLE
from file_samples import REPORT_HEAD as HEAD
from loop import loop
from refusal import refusal

from sensor.cameras.emva_report import EmvaReport, clip_over_saturation, numbers_at_gains, numbers_of, read_report
from sensor.cameras.numbers import curves_csv, missing, preset_text
from sensor.config_file import read_sensor

REPORTS = sorted((Path(__file__).parents[3] / "sensor" / "cameras" / "reports").glob("*.toml"))


def write(folder: Path, text: str) -> Path:
    path = folder / "report.toml"
    path.write_text(text, "utf-8")
    return path


def test_each_symbol_becomes_the_pixels_number_with_its_equation_and_source(tmp_path):
    numbers = numbers_of(read_report(write(tmp_path, HEAD + WHOLE)))
    values = {key: each.value for key, each in numbers.pixel.items()}
    assert values == pytest.approx(
        {
            "pitch_um": 3.5,
            "fill_factor": 1.0,
            "full_well_e": 4000 / 0.4,  # (2^12 - 1 - 95) / K
            "read_noise_e": 4.0,  # sqrt(5^2 - 100 / s * 0.09 s)
            "dsnu_e": 2.0,
            "prnu": 0.005,
            "dark_current_e_per_s": 100.0,
        }
    )
    for key, equation in (("full_well_e", "50"), ("read_noise_e", "30"), ("dsnu_e", "66"), ("prnu", "67")):
        assert f"(eq. {equation})" in numbers.pixel[key].source
    sourced = [each for key, each in numbers.pixel.items() if key != "fill_factor"]
    assert all("report 7, 2020-01-02" in each.source for each in (*sourced, *numbers.settings.values()))
    assert numbers.efficiency == (0.6, 530.0)
    assert missing(numbers) == []


def test_the_preset_of_a_report_reads_as_a_camera_and_has_a_word_on_every_key(tmp_path):
    numbers = numbers_of(read_report(write(tmp_path, HEAD + WHOLE)))
    path = tmp_path / "camera.toml"
    path.write_text(preset_text("X1", numbers, None, "camera_curves.csv"), "utf-8")
    (tmp_path / "camera_curves.csv").write_text(curves_csv(numbers, None), "utf-8")
    sensor = read_sensor(path)
    assert (sensor.cfa, sensor.bits, sensor.black_dn) == (("W",), 12, 95)
    assert sensor.gain_e_per_dn == pytest.approx(1 / 0.4)  # the report's K comes back
    # electrons are told at 530 nm alone
    assert sensor.responses.band_average(("W",), [530.0, 600.0], [1.0, 1.0])[0] == pytest.approx([0.6, 0.0])
    for line in path.read_text("utf-8").splitlines():
        assert "=" not in line.split("#")[0] or "# " in line or line.startswith(("csv", "quantum", "range"))
    assert "crosstalk =   # not told" in path.read_text("utf-8")


def test_what_a_report_does_not_tell_is_left_out(tmp_path):
    numbers = numbers_of(read_report(write(tmp_path, HEAD + "[report]\nsigma_d = 2.5\n")))
    assert {key: each.value for key, each in numbers.pixel.items()} == {"fill_factor": 1.0, "read_noise_e": 2.5}
    assert missing(numbers) == ["pitch_um", "full_well_e", "dsnu_e", "prnu"]
    assert "in read_noise_e" in numbers.left_out["dark_current_e_per_s"]
    text = preset_text("X1", numbers, None, "")
    assert tomllib.loads(text)["pixel"] == {"fill_factor": 1.0, "read_noise_e": 2.5}
    assert "# full_well_e =   # not told: needed" in text


@pytest.mark.sample(1)
@pytest.mark.parametrize(("saturation", "prnu"), [(2000.0, 0.0), (10_000.0, 0.0), (10_000.0, 0.01)])
def test_the_clip_is_where_the_variance_of_clipped_pixels_is_greatest_at_the_saturation(saturation, prnu):
    clip = clip_over_saturation(saturation, 5.0, prnu)
    rng = np.random.default_rng(1)
    shares = np.linspace(0.96, 1.04, 17)
    draws, spread = rng.standard_normal((400, 5000)), 1 + prnu * rng.standard_normal(5000)
    variance = []
    for mean in saturation * shares:
        means = mean * spread
        variance.append(np.minimum(means + draws * np.sqrt(means + 25), clip).var(axis=0).mean())
    curve = np.polynomial.Polynomial.fit(shares, variance, 3)
    fine = np.linspace(0.96, 1.04, 801)
    # 2e6 draws and a cubic through a flat maximum: its place is known to some 0.5 %
    assert fine[np.argmax(curve(fine))] == pytest.approx(1.0, abs=0.012)
    assert clip > saturation


@loop("path", REPORTS)
def test_a_shipped_report_reads_has_source_and_date_and_gives_a_pixel(path):
    report = read_report(path)
    assert len(report.source) > 20
    assert report.date
    assert {"full_well_e", "read_noise_e"} <= set(numbers_of(report).pixel)


@loop(
    ("text", "words"),
    [
        ("", "camera: None"),
        (HEAD, "report: None"),
        (HEAD + "[report]\nsigma = 2", "symbol: 'sigma' is unknown"),
        (HEAD + "[report]\nsigma_d = -2", "sigma_d: -2"),
        (HEAD + "[report]\nsigma_d = nan", "sigma_d: nan"),
        (HEAD + "[report]\nPRNU1288 = 1e9", "per cent"),
        (HEAD + "[report]\neta = 60", "lambda_nm"),
        (HEAD + "bits = 99\n[report]\n", "bits: 99"),
        (HEAD + "bits = 8\nblack_level_dn = 255\n[report]\n", "not under the converter's 255"),
        (HEAD + "extra = 1\n[report]\n", "key: 'extra'"),
        ("a = " + "[" * 100_000, "nested too deep"),
        (HEAD.replace("report 7", "x" * 5000) + "[report]\n", "source:"),
    ],
)
def test_a_hostile_report_is_refused_in_one_line_that_names_it(tmp_path, text, words):
    refusal(read_report, write(tmp_path, text), words=(words, "report.toml"))


# Figures that contradict one another. The shipped reports and `WHOLE` pass without a word: warnings are errors.


@loop(
    ("old", "new", "words"),
    [
        ("eta = 60", "eta = 0.6", r"eta = 0\.6 per cent looks like a fraction; give 60 if"),
        ("PRNU1288 = 0.5", "PRNU1288 = 0.005", r"PRNU1288 = 0\.005 per cent looks like a fraction; give 0\.5 if"),
        ("mu_e_sat = 9500", "mu_e_sat = 9.5", r"mu_e_sat = 9\.5 e- looks like thousands; give 9500 if"),
        ("K = 0.4", "K = 2.5", r"at 2\.375e\+04 DN above black; the converter has 4000 there; K looks like e-/DN"),
        ("K = 0.4", "K = 2.5", r"give 0\.4 DN/e-"),
        ("bits = 12", "bits = 10", r"at 3800 DN above black; the converter has 928 there$"),
        ("SNR_max_dB = 39.8", "SNR_max_dB = 45", r"SNR_max_dB = 45 dB, but sqrt\(mu_e_sat\) of 9500 e- is 39\.8 dB"),
        # 20 log10(9500 / (sqrt(25 + 1 / 12 / 0.16) + 0.5)) = 64.66 dB
        ("SNR_max_dB = 39.8", "DR_dB = 70", r"DR_dB = 70 dB, but mu_e_sat over 5\.55 e- .* is 64\.7 dB"),
        ("SNR_max_dB = 39.8", "DR_dB = 64.6\nmu_e_min = 9", r"mu_e_sat over mu_e_min is 60\.5 dB"),
    ],
)
def test_figures_that_contradict_others_or_look_like_another_unit_are_told(old, new, words, tmp_path):
    with pytest.warns(UserWarning, match=words):
        read_report(write(tmp_path, HEAD + WHOLE.replace(old, new)))


def test_figures_that_agree_are_read_without_a_word(tmp_path):
    read_report(write(tmp_path, HEAD + WHOLE.replace("SNR_max_dB = 39.8", "SNR_max_dB = 40.5\nDR_dB = 64")))


# Two reports of one camera at two gains.


def at_gain(k: float, sigma_d: float, **more: Any) -> EmvaReport:
    figures = {"K": k, "sigma_d": sigma_d, "DSNU1288": 2.0 / k, "pixel_pitch_um": 2.0}
    return replace(EmvaReport(f"K {k:g}", "maker", "a source", "2026", 10, 64, figures), **more)


def test_two_gains_part_the_noise_before_the_amplifier_from_that_after_it() -> None:
    read_e, converter_dn = 1.5, 0.8
    low, high = (at_gain(k, hypot(read_e, converter_dn / k)) for k in (0.2, 1.6))
    numbers = numbers_at_gains(low, high)
    pixel, settings = numbers.pixel, numbers.settings
    assert pixel["read_noise_e"].value == pytest.approx(read_e)
    assert settings["converter_noise_dn"].value == pytest.approx(converter_dn)
    assert settings["gain_limit"].value == pytest.approx(8.0)
    assert pixel["dsnu_e"].value == pytest.approx(2.0 / 1.6)
    assert pixel["full_well_e"].value == pytest.approx((1023 - 64) / 0.2)
    # Noise that falls faster than the gain rises is after the amplifier, all of it.
    steep = numbers_at_gains(at_gain(0.2, 9.0), at_gain(0.4, 2.0))
    assert steep.pixel["read_noise_e"].value == pytest.approx(0.0, abs=1e-6)
    assert steep.settings["converter_noise_dn"].value == pytest.approx(0.8)


def test_reports_that_are_no_two_gains_of_one_camera_are_refused() -> None:
    low, high = at_gain(0.2, 4.0), at_gain(1.6, 1.5)
    refusal(numbers_at_gains, high, low, words=("K = 0.2 DN/e-", "swap the reports"))
    refusal(
        numbers_at_gains, low, replace(high, bits=12), match="bits and black level 12, 64, at the lower gain 10, 64"
    )
    refusal(numbers_at_gains, low, replace(high, figures={"K": 1.6}), match="no sigma_d; allowed: reports with both")
