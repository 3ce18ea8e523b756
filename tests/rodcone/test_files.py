"""Files appear whole or not at all, and a place that can't be written is named as it was asked for."""

import errno
import json
import shutil
import subprocess
import sys
from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np
import pytest
from any_cpu.configurations import environment
from loop import loop
from refusal import refusal

from rodcone.digests import digest, digest_inputs
from rodcone.files import check_place, inside, replacing


def test_all_files_take_their_names_at_the_end(tmp_path):
    first, second = tmp_path / "a.txt", tmp_path / "b.txt"
    first.write_text("old")
    with replacing(first, second) as (one, two):
        one.write_text("new")
        two.write_text("beside")
        assert first.read_text() == "old"
        assert not second.exists()
    assert [path.read_text() for path in (first, second)] == ["new", "beside"]
    assert sorted(tmp_path.iterdir()) == [first, second]


def test_a_failure_leaves_everything_as_it_was(tmp_path):
    path = tmp_path / "a.txt"
    path.write_text("old")
    with pytest.raises(UnicodeEncodeError), replacing(path) as (place,):
        place.write_text("half\n\ud800", "utf-8")
    with pytest.raises(FileNotFoundError), replacing(path, tmp_path / "b.txt") as (_, second):
        second.write_text("the first was never written")
    assert [(found, found.read_text()) for found in tmp_path.iterdir()] == [(path, "old")]


def test_a_missing_folder_is_told_by_the_file_s_own_name(tmp_path):
    path = tmp_path / "absent" / "a.txt"
    with pytest.raises(FileNotFoundError) as error, replacing(path):
        pass
    assert error.value.filename == str(path)


@loop("error", [OSError("100 requested and 0 written"), OSError(errno.ENOSPC, "No space left on device")])
def test_a_full_disk_is_told_with_path_and_cause(tmp_path, error, monkeypatch):
    """As NumPy, which names neither, and libraries that name no file."""
    monkeypatch.setattr(shutil, "disk_usage", lambda _: SimpleNamespace(free=0))
    with pytest.raises(OSError, match="No space left") as caught, replacing(tmp_path / "a.dng"):
        raise error
    assert (caught.value.filename, caught.value.errno) == (str(tmp_path / "a.dng"), errno.ENOSPC)
    assert list(tmp_path.iterdir()) == []


def test_an_error_in_writing_names_the_file_that_was_asked_for(tmp_path):
    with pytest.raises(OSError, match="short write") as caught, replacing(tmp_path / "a.dng"):
        raise OSError("short write")
    assert caught.value.filename == str(tmp_path / "a.dng")


def test_a_place_is_checked_by_making_its_folder_and_leaves_no_file(tmp_path):
    path = tmp_path / "new" / "deep" / "a.txt"
    check_place(path)
    assert list(path.parent.iterdir()) == []


def test_a_name_that_leads_out_of_its_folder_is_refused_and_one_below_it_is_a_place_in_it(tmp_path):
    folder = tmp_path / "pictures"
    (folder / "sub").mkdir(parents=True)
    (folder / "link").symlink_to(tmp_path)
    for name in ("../a.png", "/a.png", "sub/../../a.png", "link/a.png", "", "a\0b"):
        refusal(inside, folder, name, match="does not lie in")
    for name in ("a.png", "sub/a.png", "sub/../a.png", "..a.png"):
        assert inside(folder, name) == folder / name


# Hashes: of values to the last bit, and of a result's inputs alike on every processor.


# Scenes, lamps and sensors by name, each with its hash: spectra from tables, resampled and scaled.
CATALOGUE = """
import json
from render.illuminants import illuminant, illuminant_names
from rodcone.digests import digest_inputs
from scenes import catalogue
from sensor import presets
held = {f"scene {name}": catalogue.load(name) for name in catalogue.scene_names()}
held |= {f"lamp {name}": illuminant(name) for name in illuminant_names()}
held |= {f"sensor {name}": presets.preset(name) for name in presets.preset_names()}
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
    "order of a mapping": ({"a": 1, "b": 2}, {"b": 2, "a": 1}, {"a": 2, "b": 1}),
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
