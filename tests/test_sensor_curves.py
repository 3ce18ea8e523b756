"""Responses of R, G, B, W: peaks and electron ratios of the published sensor, and curves from a file."""

import numpy as np
import pytest

from render.errors import InputError
from render.illuminants import illuminant
from render.spectrum import Spectrum
from sensor.curves import Responses, read_csv, rgbw

PEAKS = {"R": (0.560, 592.0), "G": (0.678, 540.0), "B": (0.415, 476.0), "W": (1.0, 620.0)}


def electrons(letter, light, first_nm, last_nm):
    """Relative electrons under a light given as energy: rectangle sum at 1 nm of energy x wavelength x response."""
    nm = np.arange(first_nm, last_nm + 1.0)
    spectrum, curve = illuminant(light), rgbw().curves[letter]
    energy = np.interp(nm, spectrum.wavelength_nm, spectrum.values)
    return np.sum(energy * nm * np.interp(nm, curve.wavelength_nm, curve.values))


@pytest.mark.parametrize("letter", PEAKS)
def test_each_curve_peaks_where_the_published_one_does(letter):
    peak, nm = PEAKS[letter]
    curve = rgbw().curves[letter]
    assert curve.values.max() == pytest.approx(peak, abs=5e-4)
    assert curve.wavelength_nm[curve.values.argmax()] == nm


@pytest.mark.parametrize("letter", PEAKS)
def test_each_curve_rises_to_its_peak_and_falls_behind_it_inside_0_to_1(letter):
    curve = rgbw().curves[letter]
    assert (curve.wavelength_nm[0], curve.wavelength_nm[-1]) == (380.0, 1068.0)
    at = int(curve.values.argmax())
    assert np.all(np.diff(curve.values[: at + 1]) > 0)
    assert np.all(np.diff(curve.values[at:]) <= 0)
    assert np.all((curve.values >= 0) & (curve.values <= 1))


@pytest.mark.parametrize(
    ("light", "first_nm", "last_nm", "ratios"),
    [
        ("E", 380, 780, (10.16, 5.85, 13.81)),
        ("D65", 380, 780, (9.80, 4.88, 10.84)),
        ("D65", 400, 700, (7.90, 3.93, 8.76)),
    ],
)
def test_w_collects_the_published_multiple_of_r_g_and_b(light, first_nm, last_nm, ratios):
    white = electrons("W", light, first_nm, last_nm)
    for letter, ratio in zip("RGB", ratios, strict=True):
        assert white / electrons(letter, light, first_nm, last_nm) == pytest.approx(ratio, rel=0.03)


def test_the_band_average_is_the_mean_of_the_linear_pieces():
    ramp = Responses({"R": Spectrum([500.0, 600.0], [0.0, 1.0]), "G": Spectrum([400.0, 700.0], [0.25, 0.25])})
    average = ramp.band_average(("G", "R"), [550.0, 600.0], [20.0, 20.0])
    # R over 590-610 nm: a trapezoid 0.9 to 1 over half of the band, nothing over the other half
    np.testing.assert_allclose(average, [[0.25, 0.25], [0.5, 0.475]], rtol=1e-13)


def test_curves_cannot_be_exchanged_afterwards():
    with pytest.raises(TypeError):
        rgbw().curves["R"] = rgbw().curves["W"]


def test_a_letter_without_a_curve_is_refused_by_name():
    with pytest.raises(InputError, match=r"'Y' is unknown; allowed: B, G, R, W"):
        rgbw().band_average(("R", "Y"), [550.0], [10.0])


def write(folder, text):
    path = folder / "curves.csv"
    path.write_text(text, encoding="utf-8")
    return path


def test_a_csv_gives_the_curves_that_it_holds(tmp_path):
    path = write(tmp_path, "wavelength_nm, R,W\n400,0.1,0.5\n\n500,0.3,1.0\n610,0,0.75\n")
    responses = read_csv(path)
    assert set(responses.curves) == {"R", "W"}
    np.testing.assert_array_equal(responses.curves["R"].wavelength_nm, [400.0, 500.0, 610.0])
    np.testing.assert_array_equal(responses.curves["R"].values, [0.1, 0.3, 0.0])
    np.testing.assert_array_equal(responses.curves["W"].values, [0.5, 1.0, 0.75])
    assert read_csv(str(path)).curves.keys() == responses.curves.keys()


@pytest.mark.parametrize(
    ("text", "parts"),
    [
        ("nm,R\n400,0.1\n500,0.2\n", ("['nm', 'R']", "wavelength_nm and one letter a column")),
        ("wavelength_nm\n400\n500\n", ("['wavelength_nm']", "one letter a column")),
        ("wavelength_nm,R,G\n400,0.1\n500,0.2\n", ("['wavelength_nm', 'R', 'G']",)),
        ("wavelength_nm,R\n", ("wavelength_nm", "header")),
        ("", ("can't be read", "CSV of numbers with a header")),
        ("wavelength_nm,R\n400,0.1\n500,high\n", ("can't be read", "'high'", "CSV of numbers")),
        ("wavelength_nm,R\n400,0.1\n500\n", ("can't be read", "CSV of numbers")),
        ("wavelength_nm,R,G\n400,20,30\n500,56,67.8\n", ("R reaches 56", "allowed: 0 to 1", "divide per cent by 100")),
        ("wavelength_nm,R\n400,-0.1\n500,0.2\n", ("finite numbers >= 0",)),
        ("wavelength_nm,R\n400,nan\n500,0.2\n", ("finite numbers >= 0",)),
        ("wavelength_nm,R\n500,0.1\n400,0.2\n", ("wavelength_nm: [500.0, 400.0]", "strictly increasing")),
    ],
)
def test_a_csv_that_holds_no_curves_is_refused_in_one_line(tmp_path, text, parts):
    with pytest.raises(InputError) as error:
        read_csv(write(tmp_path, text))
    message = str(error.value)
    assert "\n" not in message
    for part in parts:
        assert part in message, message


def test_a_missing_csv_is_refused_with_its_name(tmp_path):
    with pytest.raises(InputError, match=r"absent\.csv.*can't be read.*give a CSV") as error:
        read_csv(tmp_path / "absent.csv")
    assert "\n" not in str(error.value)
