"""Dead leaves, visual noise and developed pictures: known spectra, other libraries, a processor with closed forms."""

from dataclasses import replace
from math import sqrt
from pathlib import Path

import colour
import numpy as np
import pytest
from refusal import refusal
from scipy.integrate import quad
from scipy.stats import ttest_1samp

import rodcone as public
from rodcone.colour_spaces import SRGB_TO_XYZ
from scenes.dead_leaves import autocovariance, draw_leaves
from sensor.cfa import MOSAICS
from sensor.photodiodes import binned
from studies.metrics.s_cielab import eye_xyz
from studies.metrics.truth import named_light
from studies.photograph.snr import snr
from studies.score.developed import developed_figures
from studies.score.developed_range import picture_range
from studies.score.even_field import even_field
from studies.score.figure import REPEATS, Definition, Merit, measured
from studies.score.information import information
from studies.score.over_light import over_light
from studies.score.score import definitions, score
from studies.score.texture_response import texture_response
from studies.score.visual_noise import (
    _variances,
    colour_fields,
    expected_noise,
    measured_noise,
    raw_visual_noise,
    visual_noise,
)


@pytest.mark.thorough
def test_drawn_leaves_have_the_autocovariance_of_the_closed_form() -> None:
    """24 charts at five distances, five standard errors each: one in 350 000."""
    samples, side = 2, 96
    distances = np.array([0.0, 1.0, 3.0, 8.0, 20.0])
    found = np.empty((24, distances.size))
    for number in range(24):
        chart = draw_leaves(side, samples, np.random.default_rng((7, number))) - 0.5
        steps = (distances * samples).astype(int)
        found[number] = [np.mean(chart[:, step:] * chart[:, : chart.shape[1] - step]) for step in steps]
    expected = autocovariance(distances)
    assert expected[0] == pytest.approx(0.9**2 / 12)
    assert np.all(np.abs(found.mean(axis=0) - expected) < 5 * found.std(axis=0, ddof=1) / sqrt(24))
    assert np.all(found.std(axis=0, ddof=1) / sqrt(24) < 0.05 * expected[0])


def test_the_response_of_pixels_that_average_a_chart_is_their_apertures() -> None:
    """sin(pi f) / (pi f) on either axis, around a circle; eight charts."""
    side, samples = 96, 6
    charts = [draw_leaves(side, samples, np.random.default_rng((8, number))) for number in range(8)]
    seen = [texture_response(x.reshape(side, samples, side, samples).mean(axis=(1, 3)), x) for x in charts]
    mtf = np.mean([x.mtf for x in seen], axis=0)
    frequency = seen[0].frequency_cycles_per_px
    turn = np.linspace(0, np.pi / 2, 91)
    for at in (0.06, 0.12, 0.25, 0.4):
        expected = np.mean(np.sinc(at * np.cos(turn)) * np.sinc(at * np.sin(turn)))
        assert np.interp(at, frequency, mtf) == pytest.approx(expected, abs=0.015)


def test_noise_leaves_the_texture_s_response_as_it_is() -> None:
    """Of a picture with as much noise as contrast; five standard errors of 16 draws."""
    side, samples, rng = 96, 4, np.random.default_rng(9)
    chart = draw_leaves(side, samples, rng)
    clean = chart.reshape(side, samples, side, samples).mean(axis=(1, 3))
    alone = texture_response(clean, chart).mtf
    noisy = np.array([texture_response(clean + rng.normal(0, 0.25, clean.shape), chart).mtf for _ in range(16)])
    assert np.all(np.abs(noisy.mean(axis=0) - alone)[1:] < 5 * noisy.std(axis=0, ddof=1)[1:] / 4)


def test_information_of_a_perfect_transfer_is_shannon_s_by_hand() -> None:
    """M = 1: q = mean^2 / n; s^2 = contrast^2 x the square's area in the band / n; c = pi / 4 log2(1 + S / N)."""
    frequency, flat = np.linspace(0.0, 1.0, 11), np.ones(11)
    quanta, ratio_db, capacity = information(frequency, flat, 900.0, 100.0, 400.0)
    assert quanta == pytest.approx(500.0**2 / 400)
    inside, _ = quad(lambda f: 9 * np.sinc(3 * f) ** 2, -0.5, 0.5)
    assert 10 ** (ratio_db / 10) == pytest.approx(800.0**2 * inside**2 / 400, rel=1e-3)
    assert capacity == pytest.approx(np.pi / 4 * np.log2(1 + 800.0**2 / 12 / 400), rel=1e-5)


def test_information_of_a_transfer_that_falls_counts_its_square() -> None:
    """M = exp(-a f^2), whose square falls apart into both axes; integrals by SciPy's quadrature."""
    frequency, fall, noise_e2 = np.linspace(0.0, 1.0, 2001), 4.0, 400.0
    quanta, ratio_db, capacity = information(frequency, np.exp(-fall * frequency**2), 900.0, 100.0, noise_e2)
    assert quanta == pytest.approx((500.0 * np.exp(-fall / 16)) ** 2 / noise_e2, rel=1e-5)
    inside, _ = quad(lambda f: 9 * np.sinc(3 * f) ** 2 * np.exp(-2 * fall * f**2), -0.5, 0.5)
    assert 10 ** (ratio_db / 10) == pytest.approx(800.0**2 * inside**2 / noise_e2, rel=1e-3)
    signal_e2 = 800.0**2 / 12
    around, _ = quad(lambda f: 2 * np.pi * f * np.log2(1 + signal_e2 * np.exp(-2 * fall * f**2) / noise_e2), 0, 0.5)
    assert capacity == pytest.approx(around, rel=1e-4)


def test_a_figures_interval_is_students_of_its_repeats() -> None:
    """As SciPy's t test has it, of the same draws."""
    drawn: list[float] = []
    merit = Merit("a.b", "a figure", "1", "a standard", "anywhere", 5.0)
    (told,) = measured(Definition((merit,), lambda rng: drawn.append(rng.normal(5.0, 2.0)) or [drawn[-1]]), seed=3)
    interval = ttest_1samp(drawn, 0.0).confidence_interval(0.95)
    assert len(set(drawn)) == len(drawn) == REPEATS
    assert (told.measured, told.low, told.high) == pytest.approx((np.mean(drawn), interval.low, interval.high))


def test_visual_noise_is_that_of_colour_science_s_cieluv() -> None:
    rng = np.random.default_rng(10)
    picture = 0.18 + rng.normal(0, 0.01, (32, 32, 3))
    luv = colour.XYZ_to_Luv(eye_xyz(picture @ SRGB_TO_XYZ.T), colour.CCS_ILLUMINANTS["cie_2_1931"]["D65"])
    by_hand = luv[..., 0].std() + 0.852 * luv[..., 1].std() + 0.323 * luv[..., 2].std()
    assert visual_noise(picture) == pytest.approx(by_hand, rel=5e-3)
    assert visual_noise(np.full((8, 8, 3), 0.18)) == pytest.approx(0.0, abs=1e-9)


@pytest.mark.thorough
def test_visual_noise_with_stripes_of_columns_is_what_frames_show() -> None:
    """Within 12 standard errors of the mean of eight measurements: columns make stripes, which the eye sees best."""
    sensor = public.low_noise()
    striped = replace(sensor, pixel=replace(sensor.pixel, column_gain_spread=0.01))
    (merit,) = measured(raw_visual_noise(striped, "D65", 0.033), 0)
    (plain,) = raw_visual_noise(sensor, "D65", 0.033).merits
    assert merit.computed > 1.2 * plain.computed
    assert abs(merit.measured - merit.computed) < 3 * (merit.high - merit.low)


def test_noise_of_pixels_columns_and_rows_is_all_of_it() -> None:
    """Columns and rows as the pixel states them, at 500 electrons; the three together are the law's variance."""
    sensor = public.low_noise("bayer")
    terms = {"column_gain_spread": 0.02, "column_offset_e": 6.0, "row_noise_e": 5.0, "read_noise_e": 9.0}
    field = even_field(replace(sensor, pixel=replace(sensor.pixel, **terms)), named_light("D65"), 0.033, "G")
    alone, columns, rows = _variances(field, 500.0)
    (reading,) = field.readings
    assert alone + columns + rows == pytest.approx(float(reading.law.variance(np.array([500.0]))[0]))
    assert rows == pytest.approx(25.0)
    of_gains = 0.02**2 * (500.0**2 + 500.0 + (sensor.pixel.prnu * 500.0) ** 2)
    assert columns == pytest.approx(36.0 + of_gains, rel=1e-2)


@pytest.mark.thorough
def test_visual_noise_with_stripes_of_rows_is_what_frames_show() -> None:
    """All of 20 e- of read noise in rows: within 12 standard errors of the mean of eight measurements."""
    sensor = public.low_noise()
    loud = replace(sensor, pixel=replace(sensor.pixel, read_noise_e=20.0))
    striped = replace(sensor, pixel=replace(loud.pixel, row_noise_e=20.0))
    (merit,) = measured(raw_visual_noise(striped, "D65", 0.033), 0)
    (plain,) = raw_visual_noise(loud, "D65", 0.033).merits
    assert merit.computed > 1.2 * plain.computed
    assert abs(merit.measured - merit.computed) < 3 * (merit.high - merit.low)


def test_visual_noise_over_light_is_the_row_s_where_the_white_is_the_same_and_frames_show_it() -> None:
    """At ten times the light noise is less by 10^1/2 where shot noise is all; 16 384 pixels spread it by 2 %."""
    sensor = public.low_noise("bayer")
    (row,) = raw_visual_noise(sensor, "D65", 0.01).merits
    fields, _ = colour_fields(sensor, "D65", 0.01)
    white_cd_m2 = min(0.7 * field.headroom_e / field.electrons_per_cd_m2 for field in fields)
    lux = white_cd_m2 * np.pi
    at, dimmer, dark, full = over_light(sensor, "D65", 0.01, 0, lux=[lux, lux / 10, lux / 1e5, 10 * lux])
    assert at.visual_noise == pytest.approx(row.computed, rel=1e-6)
    assert 2.4 < dimmer.visual_noise / at.visual_noise < sqrt(10)  # PRNU is there, read noise isn't much
    for one in (at, dimmer):
        assert one.measured_visual_noise == pytest.approx(one.visual_noise, rel=0.08)
    assert np.isnan(dark.visual_noise)
    assert dark.measured_visual_noise > 20
    assert np.isnan([full.visual_noise, full.measured_visual_noise]).all()
    (grey,) = over_light(public.low_noise("mono"), "D65", 0.01, 0, lux=[lux])
    assert np.isnan([grey.visual_noise, grey.measured_visual_noise]).all()


@pytest.mark.parametrize("binning", ["charge", "digital"])
def test_visual_noise_of_pixels_that_bin_is_that_of_the_frames_that_they_make(binning: str) -> None:
    """Frames of half as many rows and columns; 4096 pixels spread the measured value by 2 %."""
    quad = replace(public.low_noise("bayer"), cfa=MOSAICS["quad_bayer"])
    fields, matrix = colour_fields(binned(quad, binning), "D65", 0.01)
    white_cd_m2 = min(0.7 * field.headroom_e / field.electrons_per_cd_m2 for field in fields)
    expected = expected_noise(fields, matrix, white_cd_m2)
    found = measured_noise(fields, matrix, white_cd_m2, np.random.default_rng(2))
    assert found == pytest.approx(expected, rel=0.1)
    one, _ = colour_fields(quad, "D65", 0.01)
    alone = expected_noise(one, matrix, min(0.7 * x.headroom_e / x.electrons_per_cd_m2 for x in one))
    assert expected / alone == pytest.approx(0.5, rel=0.2)  # four times the electrons, half the noise


def test_the_range_of_pictures_is_their_top_over_their_noise() -> None:
    """A straight picture to 1.6 in noise of 0.01: 44.08 dB; 25 000 pixels spread it by 0.06 dB."""

    def shoot(level: float, frame: int) -> np.ndarray:
        return np.minimum(level + 0.01 * np.random.default_rng(frame).standard_normal((160, 160)), 1.6)

    found_db = picture_range(shoot, 0.01)
    assert found_db == pytest.approx(20 * np.log10(1.6 / 0.01), abs=0.3)
    # What is below black is cut: noise's half has the deviation (1/2 - 1/(2 pi))^1/2, and three of it rise by 2.6.
    cut = picture_range(lambda level, frame: np.maximum(shoot(level, frame), 0.0), 0.01)
    rise = (3.0004 - 1 / sqrt(2 * np.pi)) / 3
    assert cut - found_db == pytest.approx(-20 * np.log10(sqrt(0.5 - 0.5 / np.pi) / rise), abs=0.2)
    # Half the noise is left: 6 dB more; twice the exposure changes nothing.
    rest = picture_range(lambda level, frame: shoot(level, frame) / 2 + min(level, 1.6) / 2, 0.01)
    assert rest - found_db == pytest.approx(6.02, abs=0.1)
    assert picture_range(lambda level, frame: 2 * shoot(level, frame), 0.01) == pytest.approx(found_db, abs=0.02)


AS_READ = """
import numpy as np

def develop(raw, matrix, *, balance):
    return np.repeat(raw.electrons[..., None], 3, axis=2)
"""


def test_one_measurement_of_a_developed_picture_is_near_the_pixels_own_closed_form(tmp_path: Path) -> None:
    """Samples passed on as they are: 6400 of them spread a ratio by 0.08 dB; texture and edge by a hundredth."""
    path = tmp_path / "mine.py"
    path.write_text(AS_READ, "utf-8")
    sensor, rng = public.low_noise("mono"), np.random.default_rng(3)
    found = {}
    for definition in developed_figures(sensor, "D65", 0.01, f"{path}:develop", trust_code=True):
        names = [merit.name.removeprefix("developed.") for merit in definition.merits]
        found |= dict(zip(names, definition.measure(rng), strict=True)) if names != ["delta_e"] else {}
    ratio_db = 20 * np.log10(snr(np.array([0.18 * 0.7 * sensor.pixel.full_well_e]), sensor, 0.01)[0])
    assert found["snr_18"] == pytest.approx(ratio_db, abs=0.4)
    noise = np.random.default_rng(4).normal(0, 0.18 / 10 ** (ratio_db / 20), (80, 80, 1))
    assert found["visual_noise"] == pytest.approx(visual_noise(np.repeat(0.18 + noise, 3, axis=2)), rel=0.15)
    closed = list(definitions(sensor, "D65", 0.01, ["iso_12233", "iso_15739", "iso_19567", "ieee_2020"]))
    computed = {merit.name.partition(".")[2]: merit.computed for one in closed for merit in one.merits}
    for lux in ("0.1", "1", "10", "100"):  # pairs of 2560 pixels a patch spread by less than a hundredth
        assert found[f"cta_{lux}_lux"] == pytest.approx(computed[f"cta_{lux}_lux"], abs=0.03)
    assert found["dynamic_range"] == pytest.approx(computed["dynamic_range"], abs=0.3)  # dB; the noise spreads by 0.1
    for name in (
        "mtf50",
        "mtf_half_nyquist",
        "acutance",
        *(f"texture_{x}" for x in ("mtf50", "half_nyquist", "acutance")),
    ):
        assert found[name] == pytest.approx(computed[name], abs=0.02), name
    (texture,) = (one for one in closed if one.merits[0].name == "iso_19567.texture_mtf50")
    for merit, value in zip(texture.merits, texture.measure(rng), strict=True):
        assert value == pytest.approx(merit.computed, abs=0.02), merit.name


def test_a_camera_that_bins_is_measured_on_pictures_of_its_own_pixels(tmp_path: Path) -> None:
    """Grey samples passed on as they are: range, contrast and flicker are those of the closed forms; 1280 pixels."""
    path = tmp_path / "mine.py"
    path.write_text(AS_READ, "utf-8")
    sensor, rng = binned(public.low_noise("mono"), "charge"), np.random.default_rng(3)
    closed = list(definitions(sensor, "D65", 0.01, ["iso_15739", "ieee_2020", "flicker"]))
    computed = {merit.name.partition(".")[2]: merit.computed for one in closed for merit in one.merits}
    found = {}
    for definition in developed_figures(sensor, "D65", 0.01, f"{path}:develop", trust_code=True):
        names = [merit.name.removeprefix("developed.") for merit in definition.merits]
        if names[0] in ("dynamic_range", "cta_0.1_lux"):
            found |= dict(zip(names, definition.measure(rng), strict=True))
    assert found.pop("dynamic_range") == pytest.approx(computed["dynamic_range"], abs=0.3)
    assert len(found) == 4
    for name, value in found.items():
        assert value == pytest.approx(computed[name], abs=0.03), name
    (flicker,) = (one for one in closed if one.merits[0].name.startswith("flicker"))
    index, share = flicker.measure(rng)
    assert index == pytest.approx(computed["modulation_index"], rel=0.01)
    assert share == pytest.approx(computed["mitigation_probability"], abs=0.2)  # of 40 frames


def test_one_measurement_of_a_developed_chart_is_near_the_cameras_closed_form() -> None:
    """A linear processor takes the matrix that the closed form takes: 1.4, and noise adds a tenth."""
    sensor = public.low_noise("bayer")
    *_, chart = developed_figures(sensor, "D65", 0.01, "bayer")
    computed = {x.name: x.computed for one in definitions(sensor, "D65", 0.01, ["color_checker"]) for x in one.merits}
    (value,) = chart.measure(np.random.default_rng(3))
    assert value == pytest.approx(computed["color_checker.delta_e"] + 0.1, abs=0.15)


@pytest.mark.thorough
def test_a_processor_that_passes_samples_on_has_the_raw_figures(tmp_path: Path) -> None:
    """A person's own file, of a grey camera: its ratio and its sharpness are those of the pixels themselves."""
    path = tmp_path / "mine.py"
    path.write_text(AS_READ, "utf-8")
    sensor = public.low_noise("mono")
    found = score(
        sensor,
        only=["developed", "iso_12233", "iso_19567"],
        processor=f"{path}:develop",
        trust_code=True,
        exposure_s=0.01,
    )
    rows = {row.name: row for row in found}
    grey_e = np.array([0.18 * 0.7 * sensor.pixel.full_well_e])
    expected_db = 20 * np.log10(snr(grey_e, sensor, 0.01)[0])
    assert rows["developed.snr_18"].measured == pytest.approx(expected_db, abs=0.3)  # 8 times 6400 samples: 0.03
    for name in ("mtf_half_nyquist", "acutance"):
        raw = rows[f"iso_12233.{name}" if name != "acutance" else "iso_19567.texture_acutance"]
        seen = rows[f"developed.{name}" if name != "acutance" else "developed.texture_acutance"]
        assert seen.measured == pytest.approx(raw.computed, abs=0.02)
    assert all(row.agrees is None for row in found if row.name.startswith("developed"))


def test_processors_that_cannot_be_scored_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "mine.py"
    path.write_text(AS_READ, "utf-8")
    assert "--trust-code" in refusal(lambda: public.score("low_noise", only=["developed"], processor=f"{path}:develop"))
    assert "without a processor" in refusal(lambda: public.score("low_noise", only=["developed"]))
    assert "plee" in refusal(lambda: public.score("low_noise", only=["developed"], processor="plee"))
