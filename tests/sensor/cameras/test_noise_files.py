"""Noise of a DNG's profile: what it tells, what it doesn't, and what is refused."""

import numpy as np
import pytest
from builders import raw_image
from file_samples import profiled
from refusal import refusal

from sensor.cameras.noise_files import dng_numbers
from sensor.cfa import BAYER
from sensor.raw_files.raw_file import write_raw


def test_a_noise_profile_gives_the_electrons_at_white_and_the_read_noise(tmp_path):
    numbers = dng_numbers(profiled(tmp_path / "a.dng"))
    assert numbers.pixel["full_well_e"].value == pytest.approx(15_000 * 0.8)
    assert numbers.pixel["read_noise_e"].value == pytest.approx(3.0)
    assert {key: each.value for key, each in numbers.settings.items()} == {"bits": 14, "black_level_dn": 100}
    assert numbers.cfa == BAYER
    assert "ends at 16383, so its K is 1.086 times that" in numbers.settings["bits"].source  # 16 283 over 15 000 DN
    assert "ISO 400" in numbers.pixel["full_well_e"].source
    assert {"dsnu_e", "prnu", "dark_current_e_per_s"} <= set(numbers.left_out)


def test_a_file_without_a_profile_says_how_to_measure_one(tmp_path):
    write_raw(raw_image(np.full((16, 16), 500), BAYER), tmp_path / "a.tif")
    refusal(dng_numbers, tmp_path / "a.tif", match=r"has no NoiseProfile of use.*characterise --from")
