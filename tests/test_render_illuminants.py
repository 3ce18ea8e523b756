"""Named lights: each of luminance 1, and of the shape that its name promises."""

from pathlib import Path

import numpy as np
import pytest

from render.errors import InputError
from render.illuminants import illuminant, names, unit_luminance
from render.photometry import colour_matching_functions, luminance, tristimulus
from render.spectrum import Spectrum, black_body

LIGHTS = Path(__file__).resolve().parents[2] / "shared" / "reference" / "isetcam" / "lights"
SHAPE_TOLERANCE = 2e-3  # the two tables are rounded to three or four digits
NM, WIDTH_NM = np.arange(360.5, 830.0), np.ones(470)


@pytest.mark.parametrize("name", names())
def test_every_light_has_a_luminance_of_one(name):
    light, v = illuminant(name), colour_matching_functions()[1]
    fine = np.arange(360.0, 830.0, 0.05) + 0.025  # another quadrature: a point every 0.05 nm
    sampled = np.interp(fine, light.wavelength_nm, light.values, left=0.0, right=0.0)
    luminance_cd_m2 = 683.0 * 0.05 * (sampled * np.interp(fine, v.wavelength_nm, v.values)).sum()
    assert luminance_cd_m2 == pytest.approx(1.0, rel=2e-4)


@pytest.mark.parametrize(
    ("name", "x", "y"),
    [  # CIE 15, 1931 observer
        ("A", 0.44758, 0.40745),
        ("D50", 0.34567, 0.35851),
        ("D55", 0.33243, 0.34744),
        ("D65", 0.31272, 0.32903),
        ("D75", 0.29903, 0.31488),
        ("E", 1 / 3, 1 / 3),
        ("F2", 0.3721, 0.3751),
        ("F11", 0.3805, 0.3769),
    ],
)
def test_every_light_has_its_published_chromaticity(name, x, y):
    xyz = tristimulus(illuminant(name).band_average(NM, WIDTH_NM), NM, WIDTH_NM)
    assert xyz[:2] / xyz.sum() == pytest.approx([x, y], abs=5e-4)


def test_moonlight_is_a_black_body_of_4200_k():
    light, planck = illuminant("moonlight"), black_body(4200.0)
    assert light.values / light.values.max() == pytest.approx(planck.values / planck.values.max(), rel=1e-14)


def test_equal_energy_is_flat():
    assert np.ptp(illuminant("E").values) == 0.0


@pytest.mark.parametrize(("name", "file"), [("D65", "D65.mat"), ("A", "illuminantA.mat")])
def test_a_light_has_the_shape_of_isetcams_table(name, file):
    if not LIGHTS.is_dir():
        pytest.skip("shared/reference/isetcam isn't beside the repository")
    from scipy.io import loadmat

    table = loadmat(LIGHTS / file, squeeze_me=True)
    nm, data = table["wavelength"].astype(np.float64), table["data"].astype(np.float64)
    inside = (nm > 380) & (nm < 780)  # its last point is half of a band
    ratio = illuminant(name).band_average(nm, 1e-3)[inside] / data[inside]
    assert ratio / np.median(ratio) == pytest.approx(np.ones(ratio.size), rel=SHAPE_TOLERANCE)


def test_scaling_to_unit_luminance_takes_out_any_factor():
    spectrum = Spectrum(np.array([500.0, 600.0]), np.array([1.0, 2.0]))
    assert unit_luminance(spectrum * 1e-7).values == pytest.approx(unit_luminance(spectrum).values, rel=1e-13)
    assert luminance(unit_luminance(spectrum).band_average(NM, WIDTH_NM), NM, WIDTH_NM) == pytest.approx(1.0, rel=1e-13)


@pytest.mark.parametrize(("name", "nearest"), [("d65", "D65"), ("D66", "D6|D65"), ("moonligt", "moonlight")])
def test_an_unknown_light_is_refused_and_the_nearest_named(name, nearest):
    with pytest.raises(InputError) as caught:
        illuminant(name)
    text = str(caught.value)
    assert text.startswith(f"illuminant: {name!r} is unknown; allowed: A, D50")
    assert any(f"did you mean {choice!r}?" in text for choice in nearest.split("|"))
    assert "\n" not in text


def test_names_lists_every_light_once():
    assert len(set(names())) == len(names())
    assert {"A", "D65", "E", "moonlight", "F11"} <= set(names())
