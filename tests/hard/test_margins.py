"""Margins, transformed raw images and bias: closed forms."""

import numpy as np
import pytest
from builders import raw_image
from hard.case import Margin, worse, worst_of
from hard.invariants_raw import allowed_errors, bias
from hard.invariants_symmetry import mirrored
from loop import loop

from sensor.cfa import BAYER, MOSAICS, RGBW, channel_map


def exposure(shape, tile=RGBW, seed=0):
    dn = np.random.default_rng(seed).integers(0, 900, shape)
    return raw_image(dn, tile, black_dn=10.0, white_dn=1000.0, dsnu_e=0.0, defects=np.array([[0, 1], [2, 0]]))


def test_the_margin_is_taken_where_error_over_allowed_is_largest():
    margin = worst_of([1.0, -3.0, 0.5], [1.0, 4.0, 0.25], "e⁻")
    assert (margin.worst, margin.allowed, margin.share, margin.kept) == (0.5, 0.25, 2.0, False)
    assert worst_of([0.0, 0.0], 0.0, "e⁻").share == 0.0
    assert worst_of([[1e-9]], 0.0, "e⁻").share == np.inf
    assert not worst_of([np.nan, 0.0], 1.0, "e⁻").kept
    assert not worst_of([np.inf], np.inf, "e⁻").kept
    assert Margin(1.0, 1.0, "e⁻").kept
    assert worse(Margin(2.0, 4.0, "a"), Margin(1.0, 1.0, "b")).unit == "b"


@loop("tile", [RGBW, BAYER, MOSAICS["rgbw_4x4"], ("RGB",)])
@loop("shape", [(8, 12), (5, 7), (4, 9)])
@loop("axis", [0, 1])
def test_a_mirrored_frame_holds_each_sample_under_its_own_letter_and_each_defect_at_its_place(tile, shape, axis):
    raw = exposure(shape, tile)
    turned = mirrored(raw, axis)
    assert np.array_equal(turned.dn, np.flip(raw.dn, axis))
    assert np.array_equal(channel_map(turned.cfa, shape), np.flip(channel_map(raw.cfa, shape), axis))
    here, there = np.zeros(shape, bool), np.zeros(shape, bool)
    here[tuple(raw.defects.T)] = there[tuple(turned.defects.T)] = True
    assert np.array_equal(there, np.flip(here, axis))


def test_bias_is_a_mean_in_its_own_standard_errors():
    errors = np.array([1.0, 3.0])  # mean 2, standard error 1
    assert bias(errors, 1.0) == Margin(2.0, allowed_errors(2), "standard errors")
    assert allowed_errors(12) == pytest.approx(9.70, abs=0.01)  # Student's t of 11 degrees of freedom at 5e-7
    assert bias(np.full(4, 1e-3), 1.0).unit == "e⁻"
    assert not bias(np.full(4, 1e-3), 1.0).kept
