"""Public frames of real cameras: `make verify FRAMES=folder`, where the folder holds EMVA1288/datasets of GitHub.

The frames (CC BY-SA 3.0) are fetched by a person and are no part of this repository.
"""

import os
from pathlib import Path

import numpy as np
import pytest

from sensor.cameras.frame_sets import open_set, read_frame_pixels
from sensor.cameras.frames import measure_place
from sensor.emva1288.from_frames import figures_of_stacks, stack_of

CCD, CMOS = "EMVA1288_ReferenceSet_001_CCD_12Bit", "EMVA1288_ReferenceSet_002_CMOS_08Bit"
REFERENCE_K = 0.28006  # DN/e-, of emva1288 1.0.2 (PyPI) on the CCD's frames
DRAWS, LEAST_INSIDE = 25, 23

pytestmark = pytest.mark.slow


def place(name):
    folder = Path(os.environ.get("FRAMES", "")) / name
    if not os.environ.get("FRAMES") or not folder.is_dir():
        pytest.skip(f"{name} isn't here: fetch EMVA1288/datasets of GitHub, then make verify FRAMES=folder")
    return folder


def test_half_of_the_ccds_lights_holds_the_reference_gain_and_that_of_the_other_half():
    with open_set(place(CCD)) as frames:
        stacks = {True: [], False: []}
        for light in frames.lights:
            dn = [read_frame_pixels(frame, frames).dn for frame in light.frames]
            stacks[light.lit].append(stack_of(dn, ("W",), frames.white_dn, light.exposure_s, light.photons))
    rng, inside = np.random.default_rng(61), {"reference": 0, "other half": 0}
    for _ in range(DRAWS):
        order = rng.permutation(len(stacks[True]))
        half, other = (
            figures_of_stacks([stacks[True][k] for k in part], stacks[False], ("W",), frames.white_dn).gain_dn_per_e
            for part in np.array_split(order, 2)
        )
        for name, value in (("reference", REFERENCE_K), ("other half", other.value)):
            inside[name] += half.low <= value <= half.high
    assert min(inside.values()) >= LEAST_INSIDE, inside


def test_the_ccd_and_the_cmos_are_measured_whole_and_the_uneven_one_with_a_word():
    ccd, cmos = measure_place(place(CCD), None), measure_place(place(CMOS), None)
    assert ccd.gain_dn_per_e.value == pytest.approx(REFERENCE_K, rel=2e-3)
    assert ccd.gain_change < -0.02
    assert cmos.gain_change < -0.1
    for found in (ccd, cmos):
        assert any("the camera is not linear" in note for note in found.notes)
