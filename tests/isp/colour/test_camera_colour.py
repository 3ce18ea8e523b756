"""White balance, matrix and sRGB: closed forms, and colour-science as an independent implementation."""

import numpy as np
import pytest

from isp.colour.camera_colour import (
    adapt_to_d65,
    encode_srgb,
    fit_matrix,
    gray_world,
    luminance_of_srgb,
    neutral_response,
    xyz_from_xy,
    xyz_to_srgb,
)
from render.illuminants import illuminant
from render.photometry import colour_matching_functions, photons_per_joule
from render.spectrum import DEFAULT_WAVELENGTH_NM
from rodcone.errors import InputError
from rodcone.tables import colour_science
from scenes.reflectances import color_checker
from sensor.curves import rgbw

NM = DEFAULT_WAVELENGTH_NM
WIDTH = np.full(NM.shape, 10.0)
SURFACES = np.array([reflectance.band_average(NM, WIDTH) for _, reflectance in color_checker()])
ERRORS = np.array([0.1, 0.1, 0.1])
NEUTRAL = np.array([1.0, 2.0, 0.8])


def planes(means: tuple[float, ...]) -> np.ndarray:
    return np.broadcast_to(means, (8, 8, len(means))).copy()


def test_srgb_matrix_agrees_with_colour_science() -> None:
    xyz = np.random.default_rng(0).uniform(0.05, 0.9, (50, 3))
    theirs = colour_science().XYZ_to_sRGB(xyz, apply_cctf_encoding=False)
    assert np.abs(xyz_to_srgb(xyz) - theirs).max() < 2e-3  # they use the standard's matrix, rounded to four digits


def test_d65_is_white_in_srgb() -> None:
    assert xyz_to_srgb(xyz_from_xy(np.array([0.3127, 0.3290]))) == pytest.approx([1.0, 1.0, 1.0], abs=1e-12)


def test_luminance_of_srgb_is_y() -> None:
    xyz = np.random.default_rng(1).uniform(0.05, 0.9, (20, 3))
    assert luminance_of_srgb(xyz_to_srgb(xyz)) == pytest.approx(xyz[:, 1], rel=1e-12)


def test_bradford_agrees_with_colour_science() -> None:
    white = xyz_from_xy(np.array([0.44757, 0.40745]))  # illuminant A
    xyz = np.random.default_rng(2).uniform(0.05, 0.9, (30, 3))
    d65 = xyz_from_xy(np.array([0.3127, 0.3290]))
    theirs = colour_science().adaptation.chromatic_adaptation_VonKries(xyz, white, d65, transform="Bradford")
    assert np.abs(adapt_to_d65(xyz, white) - theirs).max() < 1e-6


def test_encoding_agrees_with_colour_science_and_clips() -> None:
    linear = np.concatenate([np.linspace(0, 0.003, 20), np.linspace(0, 1, 200)])  # its straight foot, and all of it
    assert np.abs(encode_srgb(linear) - colour_science().cctf_encoding(linear, function="sRGB")).max() < 1e-6
    assert encode_srgb(np.array([-0.5, 2.0])) == pytest.approx([0.0, 1.0], abs=1e-15)


def test_gray_world_equalises_means() -> None:
    balance = gray_world(planes((3.0, 6.0, 2.0)), np.ones((8, 8), bool), ERRORS, NEUTRAL, green=1)
    assert balance.gains == pytest.approx([2.0, 1.0, 3.0])
    assert balance.sources == ("gray world",) * 3


def test_gray_world_leaves_unusable_pixels_out() -> None:
    values, usable = planes((3.0, 6.0, 2.0)), np.ones((8, 8), bool)
    values[:4], usable[:4] = 1000.0, False
    assert gray_world(values, usable, ERRORS, NEUTRAL, green=1).gains == pytest.approx([2.0, 1.0, 3.0])


def test_uncertain_channel_falls_back_to_calibrated_gain_and_says_so() -> None:
    errors = np.array([1.0, 0.1, 0.1])  # red's mean of 3 is 3 standard errors
    balance = gray_world(planes((3.0, 6.0, 2.0)), np.ones((8, 8), bool), errors, NEUTRAL, green=1)
    assert balance.sources == ("calibrated", "gray world", "gray world")
    assert balance.gains == pytest.approx([2.0 / 1.0, 1.0, 3.0])


def test_uncertain_green_or_no_pixel_makes_all_gains_calibrated() -> None:
    errors = np.array([0.1, 5.0, 0.1])
    for usable in (np.ones((8, 8), bool), np.zeros((8, 8), bool)):
        balance = gray_world(planes((3.0, 6.0, 2.0)), usable, errors, NEUTRAL, green=1)
        assert balance.sources == ("calibrated",) * 3
        assert balance.gains == pytest.approx([2.0, 1.0, 2.5])


def test_matrix_keeps_neutral_neutral_for_any_light() -> None:
    for light in ("D65", "A", "F11"):
        spd = illuminant(light).band_average(NM, WIDTH)
        matrix = fit_matrix(rgbw().band_average(("R", "G", "B"), NM, WIDTH), NM, spd, SURFACES)
        assert matrix @ np.ones(3) == pytest.approx([1.0, 1.0, 1.0], abs=1e-12)


def test_matrix_is_exact_for_a_camera_that_sees_as_the_observer_does() -> None:
    # Luther: with responses proportional to x, y, z per photon, a matrix maps every surface to its true colour.
    curves = np.array([curve.band_average(NM, WIDTH) for curve in colour_matching_functions()])
    spd = illuminant("D65").band_average(NM, WIDTH)
    responses = curves / photons_per_joule(NM) * 1e17
    matrix = fit_matrix(responses, NM, spd, SURFACES)
    xyz = (SURFACES * spd) @ curves.T
    white = curves @ spd
    target = xyz_to_srgb(adapt_to_d65(xyz / white[1], white))
    assert (xyz / white) @ matrix.T == pytest.approx(target, abs=1e-9)


def test_four_channels_fit_at_least_as_well_as_three() -> None:
    spd = illuminant("D65").band_average(NM, WIDTH)
    assert fit_matrix(rgbw().band_average(("R", "G", "B", "W"), NM, WIDTH), NM, spd, SURFACES).shape == (3, 4)


def test_fit_takes_transposed_tables_alike() -> None:
    spd = illuminant("D65").band_average(NM, WIDTH)
    responses = rgbw().band_average(("R", "G", "B"), NM, WIDTH)
    assert np.array_equal(fit_matrix(responses, NM, spd, SURFACES), fit_matrix(responses.T, NM, spd, SURFACES.T))


def test_neutral_response_has_the_published_electron_ratios() -> None:
    red, green, blue, white = neutral_response(("R", "G", "B", "W"))
    assert [white / red, white / green, white / blue] == pytest.approx([9.80, 4.88, 10.84], rel=0.03)


@pytest.mark.parametrize(
    ("responses", "surfaces", "name"),
    [(np.ones((3, 7)), SURFACES, "responses"), (np.ones((3, 40)), np.ones((2, 40)), "reflectances")],
)
def test_shapes_that_do_not_fit_are_refused(responses: np.ndarray, surfaces: np.ndarray, name: str) -> None:
    with pytest.raises(InputError, match=f"^{name}: .*; give"):
        fit_matrix(responses, NM, np.ones(40), surfaces)


def test_matrix_takes_bands_of_uneven_widths() -> None:
    # the first two bands as one of 20 nm, then every band as two, the first of them 2 and 8 nm wide
    spd = illuminant("D65").band_average(NM, WIDTH)
    curves = rgbw().band_average(("R", "G", "B"), NM, WIDTH)
    even = fit_matrix(curves, NM, spd, SURFACES)
    nm = np.concatenate([[NM[:2].mean()], NM[2:]])
    width = np.concatenate([[20.0], WIDTH[2:]])
    merged = [
        np.concatenate([values[..., :2].mean(-1, keepdims=True), values[..., 2:]], -1) for values in (curves, SURFACES)
    ]
    uneven = fit_matrix(merged[0], nm, np.concatenate([[spd[:2].mean()], spd[2:]]), merged[1], width)
    assert uneven == pytest.approx(even, abs=2e-3)  # 380-400 nm: a hundredth of B's light, in which curves bend
    split = [np.repeat(values, 2, axis=-1) for values in (curves, SURFACES, spd)]
    halves = np.ravel(np.stack([NM - 2.5, NM + 2.5], axis=1))
    widths = np.full(halves.shape, 5.0)
    widths[:2], halves[:2] = (2.0, 8.0), (NM[0] - 4.0, NM[0] + 1.0)  # the first band in two of 2 and 8 nm
    assert fit_matrix(split[0], halves, split[2], split[1], widths) == pytest.approx(even, abs=2e-3)
    with pytest.raises(InputError, match="width_nm"):
        fit_matrix(merged[0], nm, np.ones(nm.size), merged[1])
