"""Spectra of a photograph's colours: the colours come back, spectra are surfaces', and none leaves 0 to 1."""

import colour
import numpy as np
import pytest
from PIL import Image

from isp.colour.colour_fit import training
from render.illuminants import illuminant
from render.radiance_files.photo import read_photo
from render.radiance_files.radiance_source import load_radiance
from render.radiance_files.surface_spectra import cluster_of, srgb_basis, surface_reflectances
from render.spectrum import DEFAULT_WAVELENGTH_NM as NM
from render.spectrum import band_widths, tristimulus
from rodcone.colour_spaces import SRGB_TO_XYZ, xyz_to_srgb
from sensor.curves import rgbw

WIDTH = band_widths(NM)
D65 = illuminant("D65").band_average(NM, WIDTH)
COLOURS = np.random.default_rng(5).random((4000, 3)) ** 2


def seen(reflectance: np.ndarray) -> np.ndarray:
    return xyz_to_srgb(tristimulus(reflectance * D65, NM, WIDTH) / tristimulus(D65, NM, WIDTH)[1])


def test_colours_come_back_and_no_surface_reflects_more_than_falls_on_it() -> None:
    reflectance, share = surface_reflectances(COLOURS)
    assert reflectance.min() >= 0
    assert reflectance.max() <= 1
    inside = share == 0
    assert 0.4 < inside.mean() < 0.9
    assert seen(reflectance[inside]) == pytest.approx(COLOURS[inside], abs=2e-6)  # single precision
    # sRGB's basis itself misses by up to 1.2 % in bands of 10 nm, as much as it is used
    assert np.abs(seen(reflectance) - COLOURS).max() < 0.0125


def test_shade_changes_no_spectrum_and_black_is_black() -> None:
    grey = np.full((1, 3), 0.5)
    bright, dark = (surface_reflectances(grey * share)[0] for share in (1.0, 0.1))
    assert dark == pytest.approx(0.1 * bright, rel=1e-5)
    assert not surface_reflectances(np.zeros((2, 3)))[0].any()


def test_clusters_are_those_that_colour_science_selects() -> None:
    xyz = COLOURS[:500] @ SRGB_TO_XYZ.T
    chromaticity = xyz[:, :2] / xyz.sum(axis=1, keepdims=True)
    data = colour.recovery.Dataset_Otsu2018(
        colour.recovery.SPECTRAL_SHAPE_OTSU2018,
        colour.recovery.BASIS_FUNCTIONS_OTSU2018,
        colour.recovery.CLUSTER_MEANS_OTSU2018,
        colour.recovery.SELECTOR_ARRAY_OTSU2018,
    )
    assert cluster_of(xyz).tolist() == [data.select(xy) for xy in chromaticity]
    assert set(cluster_of(xyz)) == set(range(8))


def test_a_clusters_mean_comes_back_from_its_own_colour() -> None:
    """Of five of the eight; the means of the others have a chromaticity that the tree gives to a neighbour."""
    known = colour.recovery.SPECTRAL_SHAPE_OTSU2018.wavelengths
    found = 0
    for number, mean in enumerate(colour.recovery.CLUSTER_MEANS_OTSU2018):
        curve = np.interp(NM, known, mean)
        rgb = seen(curve)
        if cluster_of((SRGB_TO_XYZ @ rgb)[None])[0] == number and rgb.min() >= 0:
            ours, share = surface_reflectances(rgb[None])
            assert share == 0
            assert ours[0] == pytest.approx(curve, abs=1e-5)
            found += 1
    assert found >= 5


def test_no_matrix_undoes_surfaces_as_one_undoes_three_curves() -> None:
    """A camera that answers otherwise than the eye: with three curves a matrix is exact, with surfaces it isn't."""
    pale = 0.2 + 0.5 * COLOURS
    camera = rgbw().band_average(("R", "G", "B"), NM, WIDTH)
    missed = []
    for spectra in (surface_reflectances(pale)[0], pale @ srgb_basis(NM)):
        signals, target = training(camera, NM, D65, spectra)
        fitted = signals @ np.linalg.lstsq(signals, target, rcond=None)[0]
        missed.append(np.sqrt(np.mean((fitted - target) ** 2)))
    assert missed[0] > 1e-3
    assert missed[1] < 1e-12


def test_colours_beyond_surfaces_are_told_and_the_basis_goes_by_its_name(tmp_path) -> None:
    Image.new("RGB", (20, 16), (0, 0, 255)).save(tmp_path / "deep.png")
    with pytest.warns(UserWarning, match="100% of the pixels have colours that no mixture"):
        deep = read_photo(tmp_path / "deep.png").values
    assert np.abs(seen(deep[0, 0]) - [0, 0, 1]).max() < 0.0125
    basis = load_radiance(tmp_path / "deep.png", spectra="srgb_basis")
    lit = srgb_basis(NM)[2] * D65 / tristimulus(D65, NM, WIDTH)[1] * 100
    assert basis.values[0, 0] == pytest.approx(lit, rel=1e-3)  # the level is set over finer bands
    Image.new("RGB", (20, 16), (150, 140, 120)).save(tmp_path / "pale.png")
    read_photo(tmp_path / "pale.png")  # without a warning, which would fail the test
