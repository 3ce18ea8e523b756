"""Hashes: of values to the last bit, and of a result's inputs alike on every processor."""

import json
import subprocess
import sys
from dataclasses import dataclass

import numpy as np
import pytest
from any_cpu.configurations import environment

from rodcone.digests import digest, digest_inputs

# Scenes, lamps and sensors by name, each with its hash: spectra from tables, resampled and scaled.
CATALOGUE = """
import json
from render.illuminants import illuminant, names
from rodcone.digests import digest_inputs
from scenes import catalog
from sensor import presets
held = {f"scene {name}": catalog.load(name) for name in catalog.names()}
held |= {f"lamp {name}": illuminant(name) for name in names()}
held |= {f"sensor {name}": presets.preset(name) for name in presets.names()}
print(json.dumps({name: digest_inputs(value) for name, value in held.items()}))
"""


@dataclass(frozen=True)
class Curve:
    values: np.ndarray


CASES = {  # a value, the same as another processor may have it, and one that is another
    "number": (0.3, 0.1 * 3, 0.3 + 1e-8),
    "array": (np.array([1.0, 0.3]), np.array([1.0 + 1e-15, 0.3]), np.array([1.0, 0.3 + 1e-8])),
    "beside a larger one": (np.eye(2), np.array([[1.0, 6e-17], [-6e-17, 1.0]]), np.array([[1.0, 1e-8], [0.0, 1.0]])),
    "sign of nothing": (0.0, -0.0, 1e-300),
    "dataclass": (Curve(np.array([0.3])), Curve(np.array([0.1 * 3])), Curve(np.array([0.31]))),
    "nested": ({"a": [0.3, "x"]}, {"a": (0.1 * 3, "x")}, {"a": [0.3, "y"]}),
    "table in text": ("1.0,0.3", "1.0,0.30000000000000004", "1.0,0.31"),
    "text": ("0.3 m, wide", "0.3 m, wide", "0.30000000000000004 m, wide"),
    "not finite": ([np.inf, 0.3], [np.inf, 0.1 * 3], [-np.inf, 0.3]),
    "ends of the range": ([5e-324, 1.7e308], [5e-324, 1.7e308], [1e-323, 1.7e308]),
    "whole number": (2**53 + 1, 2**53 + 1, 2**53),
}


def test_inputs_count_as_far_as_processors_agree() -> None:
    for name, (value, same, other) in CASES.items():
        assert digest_inputs(value) == digest_inputs(same) != digest_inputs(other), name


def test_stored_values_count_to_the_last_bit() -> None:
    assert digest(0.3) != digest(0.1 * 3)


@pytest.mark.thorough
def test_the_catalogue_has_the_same_inputs_on_another_processor() -> None:
    """Plain NumPy and BLAS's oldest kernel make most of these values otherwise in their last bits."""
    command = [sys.executable, "-c", CATALOGUE]
    here, there = (
        json.loads(subprocess.check_output(command, env=environment(*names), text=True))
        for names in ((), ("nehalem", "numpy-baseline"))
    )
    assert here == there
