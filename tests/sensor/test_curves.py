"""Responses of R, G, B, W: peaks and electron ratios of the published sensor, and curves from a file."""

import os

import numpy as np
import pytest
from loop import loop
from refusal import refusal

from render.illuminants import illuminant
from render.spectrum import Spectrum
from rodcone.curve_file import MOST_BYTES
from rodcone.errors import InputError
from sensor.curves import read_csv, read_curve, rgbw

PEAKS = {"R": (0.560, 592.0), "G": (0.678, 540.0), "B": (0.415, 476.0), "W": (1.0, 620.0)}


def electrons(channel, light, first_nm, last_nm):
    """Relative electrons under a light given as energy: rectangle sum at 1 nm of energy x wavelength x response."""
    nm = np.arange(first_nm, last_nm + 1.0)
    spectrum, curve = illuminant(light), rgbw().curves[channel]
    energy = np.interp(nm, spectrum.wavelength_nm, spectrum.values)
    return np.sum(energy * nm * np.interp(nm, curve.wavelength_nm, curve.values))


@loop("channel", PEAKS)
def test_each_curve_peaks_where_the_published_one_does(channel):
    peak, nm = PEAKS[channel]
    curve = rgbw().curves[channel]
    assert curve.values.max() == pytest.approx(peak, abs=5e-4)
    assert curve.wavelength_nm[curve.values.argmax()] == nm


@loop(
    ("light", "first_nm", "last_nm", "ratios"),
    [
        ("E", 380, 780, (10.16, 5.85, 13.81)),
        ("D65", 380, 780, (9.80, 4.88, 10.84)),
        ("D65", 400, 700, (7.90, 3.93, 8.76)),
    ],
)
def test_w_collects_the_published_multiple_of_r_g_and_b(light, first_nm, last_nm, ratios):
    white = electrons("W", light, first_nm, last_nm)
    for channel, ratio in zip("RGB", ratios, strict=True):
        assert white / electrons(channel, light, first_nm, last_nm) == pytest.approx(ratio, rel=0.03)


def test_a_letter_without_a_curve_is_refused_by_name():
    refusal(rgbw().band_average, ("R", "Y"), [550.0], [10.0], match=r"'Y' is unknown; allowed: B, G, R, W")


def write(folder, text):
    path = folder / "curves.csv"
    path.write_text(text, encoding="utf-8")
    return path


@loop("name", ["wavelength_nm", "nm", "Wavelength (nm)", "lambda", "λ [nm]"])
def test_a_csv_gives_the_curves_that_it_holds(tmp_path, name):
    path = write(tmp_path, f"{name}, R,W\n400,0.1,0.5\n\n500,0.3,1.0\n610,0,0.75\n")
    responses = read_csv(path)
    assert set(responses.curves) == {"R", "W"}
    np.testing.assert_array_equal(responses.curves["R"].wavelength_nm, [400.0, 500.0, 610.0])
    np.testing.assert_array_equal(responses.curves["R"].values, [0.1, 0.3, 0.0])
    np.testing.assert_array_equal(responses.curves["W"].values, [0.5, 1.0, 0.75])
    assert read_csv(str(path)).curves.keys() == responses.curves.keys()


@loop(
    ("text", "parts"),
    [
        ("wavelength,R\n0.4,0.1\n0.5,0.2\n", ("wavelengths up to 0.5", "convert")),
        ("wavelength_nm,R,G\n400,0.1\n500,0.2\n", ("['wavelength_nm', 'R', 'G']",)),
        ("wavelength_nm,R\n", ("wavelength_nm", "holds no table of numbers")),
        ("", ("can't be read (it is empty)", "give a table")),
        ("wavelength_nm,R\n400,0.1\n500,high\n", ("line 3 ('500,high')", "no row of numbers")),
        ("wavelength_nm,R\n400,0.1\n500\n", ("line 3 ('500')", "no row of numbers")),
        ("wavelength_nm,R,G\n400,20,30\n500,56,67.8\n", ("R reaches 56", "allowed: 0 to 1", "divide per cent by 100")),
        ("wavelength_nm,R\n400,-0.1\n500,0.2\n", ("finite numbers >= 0",)),
        ("nm,R\n500,0.1\n400,0.2\n450,0\n", ("has wavelengths 500 then 400; allowed: strictly increasing",)),
        ("wavelength_nm,R\n400,0.5\ninf,0.5\n", ("line 3 ('inf,0.5')", "no row of numbers")),
        ("wavelength_nm,R\n400,0.1\n400,0.2\n", ("has wavelengths 400 then 400;", "each wavelength once")),
    ],
)
def test_a_csv_that_holds_no_curves_is_refused_in_one_line(tmp_path, text, parts):
    refusal(read_csv, write(tmp_path, text), words=parts)


# Range, infrared cut and quantum efficiency

FILTERS = "wavelength_nm,G,W\n400,0,0.9\n500,0.8,0.9\n600,0.4,0.9\n800,0.2,0.9\n"


def curve(responses, channel="G"):
    one = responses.curves[channel]
    return one.wavelength_nm.tolist(), one.values.tolist()


def test_a_range_cuts_the_curves_with_a_point_at_each_end(tmp_path):
    responses = read_csv(write(tmp_path, FILTERS), range_nm=(450.0, 700.0))
    nm, values = curve(responses)
    assert nm == [450.0, 500.0, 600.0, 700.0]
    np.testing.assert_allclose(values, [0.4, 0.8, 0.4, 0.3], rtol=1e-15)
    # nothing outside: W's 0.9 over 690-700 nm of a band of 690-710 nm
    assert responses.band_average(("W",), [700.0], [20.0])[0, 0] == pytest.approx(0.45, rel=1e-12)


@loop("range_nm", [(399.0, 700.0), (400.0, 801.0), (700.0, 500.0), (500.0, np.nan)])
def test_a_range_that_the_file_does_not_reach_is_refused(tmp_path, range_nm):
    with pytest.raises(InputError, match=r"range_nm: .*400 to 800 nm; give a range that the file reaches"):
        read_csv(write(tmp_path, FILTERS), range_nm=range_nm)


def test_an_infrared_cut_is_a_wavelength_or_a_curve(tmp_path):
    path = write(tmp_path, FILTERS)
    nm, values = curve(read_csv(path, ir_cut=650.0))
    assert nm == [400.0, 500.0, 600.0, 650.0]
    np.testing.assert_allclose(values, [0.0, 0.8, 0.4, 0.35], rtol=1e-15)
    assert curve(read_csv(path, ir_cut=900.0)) == curve(read_csv(path))
    nm, values = curve(read_csv(path, ir_cut=Spectrum([300.0, 600.0, 700.0], [0.5, 0.5, 0.0])))
    assert nm == [400.0, 500.0, 600.0, 700.0]
    np.testing.assert_allclose(values, [0.0, 0.4, 0.2, 0.0], rtol=1e-15)
    nm, _ = curve(read_csv(path, range_nm=(450.0, 640.0), ir_cut=650.0))
    assert (nm[0], nm[-1]) == (450.0, 640.0)
    nm, _ = curve(read_csv(path, range_nm=(450.0, 700.0), ir_cut=650.0))
    assert (nm[0], nm[-1]) == (450.0, 650.0)


def test_a_cut_before_the_first_wavelength_or_a_filter_elsewhere_is_refused(tmp_path):
    refusal(read_csv, write(tmp_path, FILTERS), ir_cut=400.0, match=r"ir_cut: 400\.0")
    with pytest.raises(InputError, match=r"range_nm: \(450\.0, 430\.0\)"):
        read_csv(write(tmp_path, FILTERS), range_nm=(450.0, 700.0), ir_cut=430.0)
    with pytest.raises(InputError, match=r"400-800 nm and a filter over 900-1000 nm share no range"):
        read_csv(write(tmp_path, FILTERS), ir_cut=Spectrum([900.0, 1000.0], [1.0, 1.0]))


def test_a_quantum_efficiency_multiplies_filters_without_a_word(tmp_path):
    path = write(tmp_path, FILTERS)
    nm, values = curve(read_csv(path, quantum_efficiency=0.5))
    assert nm == [400.0, 500.0, 600.0, 800.0]
    np.testing.assert_allclose(values, [0.0, 0.4, 0.2, 0.1], rtol=1e-15)
    nm, values = curve(read_csv(path, quantum_efficiency=Spectrum([400.0, 700.0, 1000.0], [0.6, 0.6, 0.0])))
    assert nm == [400.0, 500.0, 600.0, 700.0, 800.0]
    np.testing.assert_allclose(values, [0.0, 0.48, 0.24, 0.18, 0.08], rtol=1e-14)


@loop("efficiency", [-0.1, 1.1, np.nan])
def test_a_quantum_efficiency_out_of_range_is_refused(tmp_path, efficiency):
    refusal(read_csv, write(tmp_path, FILTERS), quantum_efficiency=efficiency, match="quantum_efficiency")


def test_a_single_curve_is_read_and_a_second_column_or_per_cent_refused(tmp_path):
    one = read_curve(write(tmp_path, "wavelength_nm,t\n400,0.5\n500,1\n"))
    assert (one.wavelength_nm.tolist(), one.values.tolist()) == ([400.0, 500.0], [0.5, 1.0])
    refusal(read_curve, write(tmp_path, FILTERS), match="2 columns beside wavelength_nm")
    refusal(read_curve, write(tmp_path, "wavelength_nm,t\n400,50\n500,90\n"), match="divide per cent by 100")


@loop("qe", [0.2, 0.65])
def test_amperes_per_watt_become_electrons_per_photon(tmp_path, qe):
    # R = qe e lambda / (h c); 1239.84 nm is the wavelength at which 1 A/W is one electron a photon (CODATA 2018)
    nm = np.array([450.0, 550.0, 650.0])
    rows = "".join(f"{x},{float(qe * x / 1239.841984)!r}\n" for x in nm)
    path = write(tmp_path, "nm,R\n" + rows)
    np.testing.assert_allclose(read_csv(path, unit="per_watt").curves["R"].values, qe, rtol=1e-9)
    relative = read_csv(path, unit="per_watt", relative=True)
    np.testing.assert_allclose(relative.curves["R"].values, 1.0, rtol=1e-9)
    assert relative.relative
    np.testing.assert_allclose(read_csv(path, unit="per_watt", quantum_efficiency=0.5).curves["R"].values, 0.5)


@pytest.mark.timeout(10)
def test_a_pipe_a_file_too_large_and_a_missing_one_are_refused(tmp_path):
    refusal(read_csv, tmp_path / "absent.csv", match=r"absent\.csv.*can't be read.*give a table")
    os.mkfifo(tmp_path / "pipe.csv")
    refusal(read_csv, tmp_path / "pipe.csv", match="a folder or a device")
    (tmp_path / "large.csv").write_bytes(b"wavelength_nm,R\n" + MOST_BYTES * b"1")
    refusal(read_csv, tmp_path / "large.csv", match="it is over 8388608 bytes")
