"""Noise of a DNG's profile and of darktable's file: what they tell, what they don't, and what is refused."""

import json
from math import sqrt

import numpy as np
import pytest
from builders import raw_image
from loop import loop

from rodcone.errors import InputError
from sensor.calibration import ColourCalibration
from sensor.cameras.noise_files import darktable_numbers, dng_numbers
from sensor.cfa import BAYER
from sensor.raw_files.raw_file import write_raw

COLOUR = ColourCalibration(np.ones(3), np.eye(3), *[np.eye(3)] * 4)


def test_a_noise_profile_gives_the_electrons_at_white_and_the_read_noise(tmp_path):
    raw = raw_image(
        np.full((16, 16), 500), BAYER, gain_e_per_dn=0.8, read_noise_e=3.0, dsnu_e=0.0, iso=400.0, colour=COLOUR
    )
    write_raw(raw, tmp_path / "a.dng")
    numbers = dng_numbers(tmp_path / "a.dng")
    assert numbers.pixel["full_well_e"].value == pytest.approx(15_000 * 0.8)
    assert numbers.pixel["read_noise_e"].value == pytest.approx(3.0)
    assert {key: each.value for key, each in numbers.settings.items()} == {"bits": 14, "black_level_dn": 100}
    assert numbers.cfa == BAYER
    assert "ends at 16383, so its K is 1.086 times that" in numbers.settings["bits"].source  # 16 283 over 15 000 DN
    assert "ISO 400" in numbers.pixel["full_well_e"].source
    assert {"dsnu_e", "prnu", "dark_current_e_per_s"} <= set(numbers.left_out)


def test_a_file_without_a_profile_says_how_to_measure_one(tmp_path):
    write_raw(raw_image(np.full((16, 16), 500), BAYER), tmp_path / "a.tif")
    with pytest.raises(InputError, match=r"has no NoiseProfile of use.*characterise --from"):
        dng_numbers(tmp_path / "a.tif")


def darktable(folder, *profiles, maker="Nikon", model="D850"):
    path = folder / "noiseprofiles.json"
    held = {"version": 0, "noiseprofiles": [{"maker": maker, "models": [{"model": model, "profiles": list(profiles)}]}]}
    path.write_text(json.dumps(held), "utf-8")
    return path


PROFILE = {"name": "D850 iso 100", "iso": 100, "a": [4e-6, 2e-6, 3e-6], "b": [2e-8, 1e-8, 2e-8]}


def test_darktables_profile_tells_no_electrons_by_itself(tmp_path):
    numbers = darktable_numbers(darktable(tmp_path, PROFILE), "Nikon D850", None, None)
    assert numbers.pixel == {}
    assert "5e+05 is of a demosaicked picture" in numbers.left_out["full_well_e"]


def test_with_the_electrons_at_white_it_tells_the_read_noise(tmp_path):
    # variance a x + b of averaged pixels is the share k of a pixel's x / white + (read / white)^2
    white_e, read_e, k = 60_000.0, 3.5, 0.15
    a, b = k / white_e, k * (read_e / white_e) ** 2
    path = darktable(tmp_path, PROFILE, {"iso": 200, "a": [1, a, 1], "b": [1, b, 1]})
    numbers = darktable_numbers(path, "Nikon D850", 200, white_e)
    assert numbers.pixel["full_well_e"].value == white_e
    assert numbers.pixel["read_noise_e"].value == pytest.approx(read_e, rel=1e-9)
    assert "k = a * 60000 = 0.15" in numbers.pixel["read_noise_e"].source
    assert sqrt(b * white_e / a) == pytest.approx(read_e)


def test_a_profile_without_dark_noise_says_so(tmp_path):
    path = darktable(tmp_path, {**PROFILE, "b": [0, -1e-9, 0]})
    numbers = darktable_numbers(path, "Nikon D850", 100, 6e4)
    assert "read_noise_e" not in numbers.pixel
    assert "not above 0" in numbers.left_out["read_noise_e"]


@loop(
    "content",
    [
        b"",
        b"\xff",
        b"[]",
        b"5",
        b"[" * 100_000,
        b'{"noiseprofiles": 5}',
        b'{"noiseprofiles": [{"maker": "a", "models": [{"model": "b"}]}]}',
        b'{"noiseprofiles": [{"maker": "a", "models": [{"model": "", "profiles": [{"iso": 1, "a": [1], "b": [1]}]}]}]}',
        b'{"noiseprofiles": [{"maker": "a", "models": [{"model": "b", "profiles": [{"iso": [], "a": 1, "b": 1}]}]}]}',
    ],
)
def test_a_hostile_file_is_refused_in_one_line(tmp_path, content):
    path = tmp_path / "noiseprofiles.json"
    path.write_bytes(content)
    with pytest.raises(InputError, match=r"noise: .* can't be read") as error:
        darktable_numbers(path, "a b", None, None)
    assert "\n" not in str(error.value)


@loop(
    ("camera", "iso", "white", "words"),
    [
        ("Nikon D85", None, None, "did you mean 'Nikon D850'"),
        ("Nikon D850", 125.0, None, "iso: 125 is unknown"),
        ("Nikon D850", 100.0, 0.0, "white-e: 0.0"),
        ("Nikon D850", 100.0, float("nan"), "white-e: nan"),
    ],
)
def test_what_the_file_does_not_have_is_told(tmp_path, camera, iso, white, words):
    with pytest.raises(InputError) as error:
        darktable_numbers(darktable(tmp_path, PROFILE), camera, iso, white)
    assert words in str(error.value)


def test_profiles_out_of_range_and_those_to_skip_are_left_out(tmp_path):
    path = darktable(
        tmp_path, {**PROFILE, "skip": True}, {**PROFILE, "iso": 200, "a": [1, 0, 1]}, {**PROFILE, "iso": 400}
    )
    with pytest.raises(InputError, match="allowed: 400"):
        darktable_numbers(path, "Nikon D850", 100.0, None)
