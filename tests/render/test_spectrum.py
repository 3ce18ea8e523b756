"""Spectra: exact averages of linear pieces, and one-line complaints about bad points and bands."""

import tracemalloc
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from loop import loop
from refusal import refusal

from render.illuminants import illuminant
from render.radiance import SpectralRadiance
from render.spectrum import (
    DEFAULT_WAVELENGTH_NM,
    LIGHT_M_S,
    LUMINOUS_EFFICACY_LM_W,
    PLANCK_J_S,
    Spectrum,
    band_widths,
    black_body,
    colour_matching_functions,
    even_bands,
    flat,
    line_bands,
    line_spectrum,
    luminance,
    observer_weights,
    photons_per_joule,
    tristimulus,
)
from sensor.optics import SpectralIrradiance

BOLTZMANN_J_K = 1.380649e-23  # exact, SI 2019
TENT = Spectrum(np.array([400.0, 500.0, 700.0]), np.array([0.0, 1.0, 0.0]))


@loop(
    ("centre", "width", "mean"),
    [
        (450.0, 100.0, 0.5),  # the rising side alone
        (450.0, 20.0, 0.5),
        (425.0, 1e-6, 0.25),  # a point
        (600.0, 200.0, 0.5),  # the falling side alone
        (650.0, 50.0, 0.25),
        (500.0, 20.0, (0.95 + 0.975) / 2),  # over the top: a mean of two trapezoids
        (550.0, 300.0, 0.5),  # all of it: area 150
        (400.0, 100.0, 0.125),  # half outside: area 12.5 over 100
        (400.0, 400.0, (50 + 75) / 400),
        (1000.0, 1400.0, (75.0 + 25.0 + 12.5 + 37.5 - 50.0 + 50.0) / 1400),  # wider than the spectrum: area 150
        (350.0, 100.0, 0.0),  # ends where it starts
        (200.0, 50.0, 0.0),
        (900.0, 50.0, 0.0),
    ],
)
def test_a_band_average_of_linear_pieces_is_exact(centre, width, mean):
    assert TENT.band_average(centre, width) == pytest.approx(mean, rel=1e-8, abs=1e-13)


def test_a_band_across_a_point_of_uneven_spacing_weighs_its_pieces_by_width():
    spectrum = Spectrum(np.array([400.0, 403.0, 410.0, 500.0]), np.array([2.0, 8.0, 1.0, 1.0]))
    area = 5.0 * 3 + 4.5 * 7 + 1.0 * 10  # trapezoids up to 420 nm
    assert spectrum.band_average(410.0, 20.0) == pytest.approx(area / 20, rel=1e-14)


def test_a_band_average_has_the_shape_of_the_bands_and_one_width_serves_all():
    assert flat(3.0).band_average(DEFAULT_WAVELENGTH_NM, 10.0) == pytest.approx(np.full(40, 3.0), rel=1e-13)
    assert TENT.band_average([], []).shape == (0,)


def test_default_bands_fill_the_visible_range():
    assert (DEFAULT_WAVELENGTH_NM[0] - 5, DEFAULT_WAVELENGTH_NM[-1] + 5) == (380.0, 780.0)
    assert DEFAULT_WAVELENGTH_NM.size == 40


@loop("nm", [[500.0], [500.0, 500.0], [500.0, 400.0], [[400.0, 500.0]], [400.0, np.nan], []])
def test_wavelengths_that_do_not_increase_are_refused_with_their_values(nm):
    text = refusal(Spectrum, np.array(nm), np.ones_like(np.array(nm)))
    assert text.startswith(f"wavelength_nm: {nm!r} is not allowed; give two or more strictly increasing")


@loop("values", [[1.0], [1.0, -0.1], [1.0, np.nan], [np.inf, 1.0], [1.0, 1.0, 1.0]])
def test_values_that_are_not_finite_positive_or_one_a_wavelength_are_refused(values):
    words = "spectrum values", "2 finite numbers >= 0, one a wavelength; correct them"
    refusal(Spectrum, np.array([400.0, 500.0]), np.array(values), words=words)


def test_band_widths_are_the_spacing_of_even_centres():
    assert np.array_equal(band_widths(np.arange(400.0, 701.0, 10.0), None), np.full(31, 10.0))
    assert np.array_equal(band_widths([500.0, 540.0], None), [40.0, 40.0])


def test_band_widths_given_are_kept_and_one_width_serves_all():
    assert np.array_equal(band_widths([400.0, 500.0, 650.0], [1.0, 2.0, 3.0]), [1.0, 2.0, 3.0])
    assert np.array_equal(band_widths([400.0, 500.0, 650.0], 5.0), [5.0, 5.0, 5.0])


@loop("nm", [[500.0], [400.0, 410.0, 425.0]])
def test_bands_without_even_spacing_need_a_width(nm):
    refusal(band_widths, nm, None, words=(f"{len(nm)} bands", "give width_nm as well"))


@loop("nm", [[], [500.0, 400.0], [500.0, 500.0], [-10.0, 10.0], [0.0, 10.0], [400.0, np.inf]])
def test_centres_that_do_not_increase_from_above_zero_are_refused_with_their_values(nm):
    assert refusal(band_widths, nm, 10.0).startswith(f"wavelength_nm: {nm!r} is not allowed; give increasing")


@loop("width", [0.0, -1.0, np.nan, np.inf])
def test_widths_that_are_not_positive_are_refused_with_their_values(width):
    assert refusal(band_widths, [400.0, 500.0], [10.0, width]).startswith(f"width_nm: {[10.0, width]!r} is not")


NOT_NM = [
    (np.array([0.38, 0.58, 0.78]), "0.38 to 0.78 is outside 100 to 20000 nm; they seem to be micrometres: multiply"),
    (np.array([3.8e-7, 5.8e-7, 7.8e-7]), "they seem to be metres: multiply them by 1e+09"),
    (np.array([0.0, 400.0, 800.0]), "0 to 800 is outside 100 to 20000 nm; give nanometres"),
    (np.array([400.0, 10_400.0, 20_400.0]), "is outside 100 to 20000 nm; give nanometres"),
]


@loop(("nm", "words"), NOT_NM)
def test_a_spectrum_over_what_is_no_nanometres_is_refused_and_the_unit_named(nm, words):
    assert words in refusal(Spectrum, nm, np.ones(3))


@loop(("factor", "unit"), [(1e-3, "micrometres"), (1e-9, "metres")])
def test_bands_and_pictures_in_other_units_are_refused_and_the_unit_named(factor, unit):
    nm = np.arange(385.0, 780.0, 10.0) * factor
    words = f"wavelength_nm: {380 * factor:g} to {780 * factor:g} is outside 100 to 20000 nm; they seem to be {unit}"
    for call, more in ((band_widths, 10.0 * factor), (SpectralRadiance, 0.0), (SpectralIrradiance, 2.2)):
        given = (nm, more) if call is band_widths else (np.ones((2, 2, 40)), nm, more)
        assert refusal(call, *given).startswith(words)


@loop("width", [20.0, [10.0, 10.3, 10.0], [10.0, 10.0, 10.3]])
def test_bands_that_overlap_by_over_a_hundredth_are_refused(width):
    match = "overlap, and the light of both would count twice; give widths that don't"
    refusal(band_widths, [400.0, 410.0, 420.0], width, match=match)
    assert "overlap" in refusal(SpectralRadiance, np.ones((2, 2, 3)), [400.0, 410.0, 420.0], 0.0, width)


def test_bands_that_touch_or_overlap_by_rounding_are_taken():
    assert band_widths([400.0, 410.0], [10.1, 10.0]).tolist() == [10.1, 10.0]
    line_and_rest = line_bands([435.8, 546.1, 577.0, 579.1])
    assert np.array_equal(band_widths(*line_and_rest), line_and_rest[1])
    edges = np.linspace(380.0, 780.0, 31)  # a third of a width isn't a float
    assert band_widths((edges[1:] + edges[:-1]) / 2, np.diff(edges)).size == 30


@loop("temperature_k", [2856.0, 4200.0, 6504.0])
def test_a_black_body_follows_plancks_law_with_si_constants(temperature_k):
    spectrum = black_body(temperature_k)
    metres = spectrum.wavelength_nm * 1e-9
    law = metres**-5 / np.expm1(PLANCK_J_S * LIGHT_M_S / (metres * BOLTZMANN_J_K * temperature_k))
    assert spectrum.values == pytest.approx(law / law[spectrum.wavelength_nm == 560.0], rel=1e-8)
    assert spectrum.values[spectrum.wavelength_nm == 560.0] == pytest.approx(1.0, rel=1e-14)


def test_a_line_holds_its_power_and_stays_within_a_twentieth_of_a_nanometre():
    doublet = line_spectrum([589.0, 589.6], [2.0, 1.0])
    assert doublet.band_average([589.0, 589.6, 589.3], [0.1, 0.1, 1.0]) == pytest.approx([20.0, 10.0, 3.0], rel=1e-9)
    assert doublet.band_average([588.9, 589.3, 589.7], [0.1, 0.5, 0.1]) == pytest.approx([0.0, 0.0, 0.0], abs=1e-9)


@loop("lines", [[589.6, 589.0], [589.0, 589.05]])
def test_lines_that_are_not_apart_are_refused(lines):
    assert refusal(line_spectrum, lines, [1.0, 1.0]).startswith(f"lines_nm: {lines!r} is not allowed")


def edges_of(centres, widths):
    assert centres[1:] - widths[1:] / 2 == pytest.approx(centres[:-1] + widths[:-1] / 2, abs=1e-9)  # no gap, no overlap
    return np.append(centres - widths / 2, centres[-1] + widths[-1] / 2)


def test_without_lines_the_bands_are_the_default_ones():
    centres, widths = line_bands([])
    assert centres == pytest.approx(DEFAULT_WAVELENGTH_NM)
    assert widths == pytest.approx(np.full(40, 10.0))


def test_a_doublet_closer_than_a_nanometre_shares_one_band():
    centres, widths = line_bands([589.6, 589.0])
    assert edges_of(centres, widths)[20:25] == pytest.approx([580.0, 588.5, 590.1, 600.0, 610.0])


def test_a_piece_of_under_a_nanometre_beside_a_line_joins_its_neighbour():
    edges = edges_of(*line_bands([579.1], (560.0, 600.0)))
    assert edges == pytest.approx([560.0, 570.0, 578.6, 579.6, 590.0, 600.0])


@settings(deadline=None)
@given(lines=st.lists(st.floats(381.0, 779.0), min_size=1, max_size=12), width=st.sampled_from([2.0, 5.0, 10.0, 33.0]))
def test_every_line_has_a_band_whose_edges_are_half_a_nanometre_from_a_line(lines, width):
    centres, widths = line_bands(lines, width_nm=width)
    edges = edges_of(centres, widths)
    assert (edges[0], edges[-1]) == (380.0, 780.0)
    assert widths.max() <= width + 2.0 + 1e-9
    for line in lines:
        band = np.searchsorted(edges, line) - 1
        for edge in edges[band : band + 2]:
            assert min(abs(abs(edge - other) - 0.5) for other in lines) < 1e-9


@loop("line", [380.2, 790.0])
def test_a_line_outside_the_range_is_refused(line):
    assert f"lines_nm: {[line]!r} is not inside 380 to 780" in refusal(line_bands, [line])


# Photons and luminance: SI constants, closed forms, and numbers that were computed independently.


ISET_NM, ISET_WIDTH_NM = np.arange(400.0, 701.0, 10.0), np.full(31, 10.0)
WIDTH_NM = np.full(40, 10.0)


def test_constants_are_the_exact_ones_of_the_si():
    assert (PLANCK_J_S, LIGHT_M_S, LUMINOUS_EFFICACY_LM_W) == (6.62607015e-34, 299792458.0, 683.0)


def test_a_joule_of_green_light_holds_lambda_over_h_c_photons():
    assert photons_per_joule([555.0]) == pytest.approx([2.79393469e18], rel=1e-8)
    assert photons_per_joule(1e9 * PLANCK_J_S * LIGHT_M_S) == pytest.approx(1.0, rel=1e-14)
    assert photons_per_joule([800.0]) == pytest.approx(2 * photons_per_joule([400.0]), rel=1e-14)


def test_a_watt_of_555_nm_gives_683_candela():
    # V is 1 at 555 nm; over the nanometre around it V falls by under 1e-4.
    assert luminance(np.array([1.0]), [555.0], [1.0]) == pytest.approx(683.0, rel=1e-4)
    assert luminance(np.array([1e3]), [555.0], [1e-3]) == pytest.approx(683.0, rel=1e-6)


def test_luminance_is_linear_and_takes_the_last_axis():
    spectral = np.random.default_rng(3).uniform(0, 1, (2, 3, 40))
    result = luminance(spectral, DEFAULT_WAVELENGTH_NM, WIDTH_NM)
    assert result.shape == (2, 3)
    assert result[1, 2] == pytest.approx(luminance(spectral[1, 2], DEFAULT_WAVELENGTH_NM, WIDTH_NM), rel=1e-14)
    assert luminance(4 * spectral, DEFAULT_WAVELENGTH_NM, WIDTH_NM) == pytest.approx(4 * result, rel=1e-14)


@loop("function", [luminance, tristimulus])
def test_a_picture_summed_in_parts_has_the_bits_of_all_at_once_without_a_copy_of_its_bands(function: Any) -> None:
    nm, width_nm = even_bands((380.0, 780.0), 8)
    planes = np.random.default_rng(4).random((nm.size, 1201, 599), dtype=np.float32)
    weights = observer_weights(nm, width_nm)
    spectral = np.moveaxis(planes, 0, -1)
    at_once = LUMINOUS_EFFICACY_LM_W * (spectral @ (weights[1] if function is luminance else weights.T))
    tracemalloc.start()
    made = function(spectral, nm, width_nm)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert np.array_equal(made, at_once)
    assert peak - made.nbytes < planes.nbytes / 2


def test_luminance_of_equal_energy_does_not_depend_on_the_cut_into_bands():
    edges = np.array([380.0, 391.0, 450.0, 452.5, 600.0, 780.0])
    cut = luminance(np.ones(5), (edges[1:] + edges[:-1]) / 2, np.diff(edges))
    whole = luminance(np.ones(40), DEFAULT_WAVELENGTH_NM, WIDTH_NM)
    assert cut == pytest.approx(whole, rel=1e-12)
    assert whole == pytest.approx(683 * 106.857, rel=1e-4)  # the sum of y over 380-780 nm, CIE 1931


def test_y_of_the_tristimulus_is_the_luminance_and_d65_has_its_published_chromaticity():
    spectral = 100 * illuminant("D65").band_average(DEFAULT_WAVELENGTH_NM, WIDTH_NM)
    xyz = tristimulus(spectral, DEFAULT_WAVELENGTH_NM, WIDTH_NM)
    assert xyz[1] == pytest.approx(luminance(spectral, DEFAULT_WAVELENGTH_NM, WIDTH_NM), rel=1e-14)
    assert xyz[:2] / xyz.sum() == pytest.approx([0.31272, 0.32903], abs=3e-4)  # CIE 15


def test_colour_matching_functions_are_nowhere_negative_and_v_peaks_at_555_nm():
    v = colour_matching_functions()[1]
    assert min(curve.values.min() for curve in colour_matching_functions()) >= 0
    assert v.wavelength_nm[v.values.argmax()] == 555.0
    assert v.values.max() == 1.0
