"""Lamps over time: the mean of an exposure against a plain sum, refused tables, and lamps that were measured."""

import numpy as np
import pytest
from outside_truth import FLICKER_OF_LAMPS
from refusal import refusal

from rodcone.errors import InputError
from sensor.flicker.waveform import LAMPS, Waveform, pwm, read_waveform, waveform

TRIANGLE = Waveform(50.0, places=(0.0, 0.3, 1.0), levels=(0.0, 2.0, 0.0))
SAWTOOTH = Waveform(75.0, places=(0.0, 1.0), levels=(0.0, 2.0))
LIGHT = {  # over the mean, at shares of a period
    "cosine": (Waveform(100.0, 0.6), lambda x: 1 + 0.6 * np.cos(2 * np.pi * x)),
    "pwm": (pwm(120.0, 0.3), lambda x: (x % 1 < 0.3) / 0.3),
    "triangle": (TRIANGLE, lambda x: np.interp(x % 1, (0, 0.3, 1), (0, 2, 0))),
    "sawtooth": (SAWTOOTH, lambda x: 2 * (x % 1)),
}


@pytest.mark.parametrize("name", LIGHT)
@pytest.mark.parametrize("exposure_s", [1e-4, 0.0033, 0.01, 0.0517])
def test_mean_is_the_plain_sum_over_the_exposure(name, exposure_s):
    lamp, light = LIGHT[name]
    starts = np.array([0.0, 0.0021, 0.0077, 3.0013])
    steps = (np.arange(200_000) + 0.5) / 200_000
    sums = [light((start + exposure_s * steps) * lamp.frequency_hz).mean() for start in starts]
    np.testing.assert_allclose(
        lamp.mean(starts, exposure_s), sums, rtol=0, atol=1.1e-4
    )  # 13 jumps of 3.3 within a step


def test_whole_periods_are_steady_and_all_means_average_to_one():
    for lamp, _ in LIGHT.values():
        np.testing.assert_allclose(lamp.mean(np.linspace(0, 1, 37), 3 * lamp.period_s), 1.0, rtol=1e-12)
        starts = (np.arange(4096) + 0.5) / 4096 * lamp.period_s
        assert lamp.mean(starts, 0.3 * lamp.period_s).mean() == pytest.approx(1.0, abs=1e-6)


def test_hours_after_the_clock_began_the_mean_is_still_exact():
    for lamp, _ in LIGHT.values():
        late = lamp.mean(4e4 * lamp.period_s, 1e-3)
        assert late == pytest.approx(lamp.mean(0.0, 1e-3), abs=1e-6)


def test_pwm_has_its_series_and_rounding_keeps_the_duty():
    """A pulse of duty D has cosines of 2 |sin(pi k D)| / (pi k D), of which an exposure leaves |sinc(k f T)|."""
    for duty in (0.1, 0.25, 0.5, 0.83):
        for exposure_s in (0.0011, 0.0049, 0.0123):
            lamp, harmonic = pwm(100.0, duty), np.arange(1, 8)
            means = lamp.mean(np.arange(4096) / 4096 * 0.01, exposure_s)
            found = 2 * np.abs(np.fft.rfft(means))[harmonic] / 4096
            series = 2 * np.abs(
                np.sin(np.pi * harmonic * duty) / (np.pi * harmonic * duty) * np.sinc(harmonic * exposure_s * 100)
            )
            np.testing.assert_allclose(found, series, rtol=0.01, atol=2e-3)


def test_lamps_have_the_index_that_was_measured_beside_their_depth():
    assert {name: depth for name, (depth, _) in FLICKER_OF_LAMPS.items()} == dict(LAMPS)
    for name, (depth, index) in FLICKER_OF_LAMPS.items():
        light = waveform(f"{name}@120Hz").mean(np.arange(4096) / 4096 / 120, 1e-9)
        assert np.maximum(light - 1, 0).mean() == pytest.approx(depth / np.pi, abs=1e-4)
        assert depth / np.pi == pytest.approx(index, abs=0.021 if name == "fluorescent" else 0.01), name


def test_a_table_of_corners_is_the_switched_lamp_and_its_unit_counts(tmp_path):
    table = tmp_path / "lamp.csv"
    table.write_text("time_ms,light\n0,5\n2.5,5\n2.50000001,0\n10,0\n")
    lamp, starts = read_waveform(table), np.linspace(0, 0.01, 11)
    assert lamp.frequency_hz == pytest.approx(100.0)
    np.testing.assert_allclose(lamp.mean(starts, 0.003), pwm(100.0, 0.25).mean(starts, 0.003), atol=1e-6)
    table.write_text("time_us,light\n0,5\n2500,5\n2500.00001,0\n10000,0\n")
    assert waveform(str(table)).frequency_hz == pytest.approx(100.0)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("time_ms,light\n0,1\n1,-1\n2,1\n", ("-1", "no light")),
        ("time_ms,light\n0,1\n2,1\n1,1\n", ("times don't rise", "sort")),
        ("time_ms,light\n0,1\n0,1\n1,1\n", ("times don't rise",)),
        ("time_ms,light\n0,1\n1,\n2,1\n", ("line 3", "isn't whole")),
        ("time_ms,light\n0,1\n1,nan\n2,1\n", ("line 3", "isn't whole")),
        ("time_ms,light\n0,0\n1,0\n", ("dark all the time",)),
        ("time_ms,light\n", ("times don't rise",)),
        ("ms,light\n0,1\n1,1\n", ("ms,light", "time_ms")),
        ("", ("''", "time_ms")),
    ],
)
def test_a_wrong_table_is_refused_in_one_line(tmp_path, text, words):
    table = tmp_path / "lamp.csv"
    table.write_text(text)
    refusal(read_waveform, table, words=("lamp.csv", *words))


def test_what_is_no_waveform_is_refused():
    refusal(waveform, "neon@100Hz", match="lamp: 'neon' is unknown")
    for text in ("fluorescent", "fluorescent@100", "pwm@100Hz", "fluorescent@100Hz:0.5", "pwm@100Hz:0.5:1", "@100Hz"):
        refusal(waveform, text, match="is no waveform.*write fluorescent@100Hz")
    refusal(waveform, "pwm@100Hz:1.5", match="duty: 1.5")
    refusal(waveform, "none.csv", match="none.csv.*can't be read")
    refusal(Waveform, 100.0, 1.5, match="depth: 1.5")
    refusal(Waveform, 100.0, 0.5, (0.0, 1.0), (1.0, 0.0), match="beside straight pieces")
    refusal(Waveform, 100.0, 0.0, (0.0, 0.5), (1.0, 0.0), match="don't rise from 0 to 1")
    with pytest.raises(InputError, match="frequency_hz"):
        Waveform(0.0)
