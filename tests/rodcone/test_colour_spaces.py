"""sRGB, XYZ and adaptation: closed forms, and colour-science as an independent implementation."""

import numpy as np
import pytest
from outside_truth import colour_science

from rodcone.colour_spaces import (
    A_XY,
    D50_XYZ,
    D65_XY,
    adapt_to_d65,
    encode_srgb,
    luminance_of_srgb,
    xyz_from_xy,
    xyz_to_srgb,
)


def test_srgb_matrix_agrees_with_colour_science() -> None:
    xyz = np.random.default_rng(0).uniform(0.05, 0.9, (50, 3))
    theirs = colour_science().XYZ_to_sRGB(xyz, apply_cctf_encoding=False)
    assert np.abs(xyz_to_srgb(xyz) - theirs).max() < 2e-3  # they use the standard's matrix, rounded to four digits


def test_luminance_of_srgb_is_y() -> None:
    xyz = np.random.default_rng(1).uniform(0.05, 0.9, (20, 3))
    assert luminance_of_srgb(xyz_to_srgb(xyz)) == pytest.approx(xyz[:, 1], rel=1e-12)


def test_bradford_agrees_with_colour_science() -> None:
    white = xyz_from_xy(A_XY)
    xyz = np.random.default_rng(2).uniform(0.05, 0.9, (30, 3))
    d65 = xyz_from_xy(D65_XY)
    theirs = colour_science().adaptation.chromatic_adaptation_VonKries(xyz, white, d65, transform="Bradford")
    assert np.abs(adapt_to_d65(xyz, white) - theirs).max() < 1e-6


def test_encoding_agrees_with_colour_science_and_clips() -> None:
    linear = np.concatenate([np.linspace(0, 0.003, 20), np.linspace(0, 1, 200)])  # its straight foot, and all of it
    assert np.abs(encode_srgb(linear) - colour_science().cctf_encoding(linear, function="sRGB")).max() < 1e-6
    assert encode_srgb(np.array([-0.5, 2.0])) == pytest.approx([0.0, 1.0], abs=1e-15)


def test_whites_are_the_cies() -> None:
    theirs = colour_science().CCS_ILLUMINANTS["CIE 1931 2 Degree Standard Observer"]
    np.testing.assert_allclose(A_XY, theirs["A"], atol=2e-5)
    np.testing.assert_allclose(D65_XY, theirs["D65"], atol=1e-9)
    np.testing.assert_allclose(D50_XYZ, xyz_from_xy(theirs["D50"]), atol=3e-4)
