"""Spectral radiance: what it accepts, and where it says that a value is wrong."""

from dataclasses import replace

import numpy as np
import pytest
from loop import loop
from refusal import refusal

from render.illuminants import illuminant
from render.radiance import SpectralRadiance

NM = np.array([500.0, 510.0, 520.0])


@loop("dtype", [np.float32, np.float64])
@loop(("bad", "written"), [(np.nan, "nan"), (-0.5, "-0.5"), (np.inf, "inf"), (-np.inf, "-inf")])
@loop("place", [(0, 0, 0), (1, 2, 1), (3, 4, 2)])
def test_a_value_that_is_no_radiance_is_refused_with_its_place(bad, written, place, dtype):
    values = np.ones((4, 5, 3), dtype=dtype)
    values[place] = bad
    row, column, band = place
    text = refusal(SpectralRadiance, values, NM)
    assert text.startswith(f"radiance: {written} at row {row}, column {column}, band {band}; allowed: finite numbers")


def test_nan_does_not_hide_behind_an_infinite_value_or_zero():
    values = np.zeros((1, 2, 3))
    values[0, 1, 2] = np.nan
    assert "nan at row 0, column 1, band 2" in refusal(SpectralRadiance, values, NM)


def test_zero_and_the_largest_float_are_radiances():
    values = np.array([[[0.0, -0.0, np.finfo(np.float32).max]]], dtype=np.float32)
    assert np.array_equal(SpectralRadiance(values, NM).values, values)


@loop("shape", [(4, 5), (4, 5, 2), (4, 5, 4), (0, 5, 3), (4, 0, 3), (1, 4, 5, 3)])
def test_a_wrong_shape_is_refused_with_the_shape_that_fits(shape):
    assert refusal(SpectralRadiance, np.ones(shape), NM).startswith(f"radiance: shape {shape} is not (h, w, 3)")


def test_widths_are_the_spacing_of_even_centres_unless_given():
    values = np.ones((2, 2, 3))
    assert np.array_equal(SpectralRadiance(values, NM).widths_nm, [10.0, 10.0, 10.0])
    assert np.array_equal(SpectralRadiance(values, NM).width_nm, [10.0, 10.0, 10.0])
    assert np.array_equal(SpectralRadiance(values, NM, width_nm=[2.0, 3.0, 4.0]).widths_nm, [2.0, 3.0, 4.0])


@loop("error", [-1e-9, np.nan, np.inf])
def test_an_error_that_is_no_standard_error_is_refused(error):
    assert refusal(SpectralRadiance, np.ones((2, 2, 3)), NM, error).startswith(
        f"relative_mc_error: {error!r} is outside 0"
    )


def test_whole_numbers_become_floats_and_floats_keep_their_precision():
    assert SpectralRadiance(np.ones((2, 2, 3), dtype=np.uint8), NM).values.dtype == np.float64
    for kind in (np.float32, np.float16):  # whose sums over bands overflow
        assert SpectralRadiance(np.ones((2, 2, 3), dtype=kind), NM).values.dtype == np.float32


def test_luminance_of_each_pixel_is_its_share_of_a_known_light():
    nm = np.arange(385.0, 780.0, 10.0)
    share = np.arange(1.0, 7.0).reshape(2, 3)
    values = share[..., None] * illuminant("D65").band_average(nm, 10.0)
    # Bands of 10 nm weigh with the band's mean V, a few 1e-4 from the 1 nm sum that the light is scaled by.
    assert SpectralRadiance(values, nm).luminance() == pytest.approx(share, rel=1e-3)


def test_a_picture_is_relit_by_name_and_to_a_level():
    nm, width = np.arange(400.0, 701.0, 10.0), np.full(31, 10.0)
    share = np.array([[0.2, 0.4], [0.6, 1.2]])
    lit = SpectralRadiance(share[..., None] * illuminant("D65").band_average(nm, width), nm, light=illuminant("D65"))
    warm = lit.relight("A", luminance_cd_m2=5.0)
    assert warm.luminance() == pytest.approx(share * 5.0 / 0.6, rel=1e-6)
    expected = illuminant("A").band_average(nm, width)
    assert warm.values[0, 0] / warm.values[0, 0, 15] == pytest.approx(expected / expected[15], rel=1e-6)
    assert warm.light.values == pytest.approx(illuminant("A").values)
    level = lit.relight(luminance_cd_m2=5.0)
    assert level.values == pytest.approx(lit.values * (5.0 / lit.luminance().mean()), rel=1e-12)
    assert level.light is lit.light
    refusal(lit.relight, lux=500.0, match=r"lux: 500 needs a reference plane, .*; give luminance_cd_m2")
    refusal(replace(lit, values=lit.values * 0).relight, luminance_cd_m2=1.0, match="the picture is dark")
    refusal(lit.relight, luminance_cd_m2=-1.0, match=r"luminance_cd_m2: -1.0 is outside 0")
