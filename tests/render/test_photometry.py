"""Photons and luminance: SI constants, closed forms, and numbers that were computed independently."""

import numpy as np
import pytest

from render.illuminants import illuminant
from render.spectrum import (
    DEFAULT_WAVELENGTH_NM,
    LIGHT_M_S,
    LUMINOUS_EFFICACY_LM_W,
    PLANCK_J_S,
    colour_matching_functions,
    luminance,
    photons_per_joule,
    tristimulus,
)

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
