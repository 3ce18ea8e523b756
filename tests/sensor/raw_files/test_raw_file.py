"""Raw files by their ending: any mosaic as TIFF with its sidecar, exactly back, and what goes wrong in words."""

import json
import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import tifffile
from file_samples import colour, same
from file_samples import exposure as plain_exposure
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from loop import loop
from refusal import refusal

from rodcone.errors import InputError
from sensor.cfa import MOSAICS, Tile
from sensor.raw import RawImage
from sensor.raw_files.raw_file import read_raw, write_raw
from sensor.raw_files.raw_json import MOST_BYTES, VERSION


def exposure(cfa: Tile, shape: tuple[int, int] = (9, 11)) -> RawImage:
    """Of 16 bits, with numbers that a DNG can't hold."""
    hard = {"black_dn": -0.1, "gain_e_per_dn": 1 / 7, "read_noise_e": 1e-17, "dsnu_e": 2, "f_number": None, "iso": None}
    return replace(plain_exposure(cfa, shape, 16), **hard)


@loop("ending", [".tif", ".TIFF"])
@loop("cfa", [*MOSAICS.values(), ("QZ", "ZQ"), ("RGBCY",)])
def test_every_mosaic_comes_back_exactly_from_tiff_and_sidecar(cfa: Tile, ending: str, tmp_path: Path) -> None:
    raw = exposure(cfa)
    paths = write_raw(raw, tmp_path / f"shot{ending}")
    assert paths == (tmp_path / f"shot{ending}", tmp_path / "shot.json")
    assert sorted(tmp_path.iterdir()) == sorted(paths)
    back = read_raw(paths[0])
    assert same(back, raw)
    np.testing.assert_array_equal(tifffile.imread(paths[0]), raw.dn)


@settings(max_examples=40, suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
@given(st.floats(-65_535, 0), st.floats(1e-3, 65_535), st.floats(1e-12, 1e12), st.floats(1e-6, 1e9))
def test_any_calibration_comes_back_exactly(
    tmp_path: Path, black: float, white: float, gain: float, iso: float
) -> None:
    raw = replace(exposure(("RC", "CC"), (2, 2)), black_dn=black, white_dn=white, gain_e_per_dn=gain, iso=iso)
    back = read_raw(write_raw(raw, tmp_path / "shot.tif")[0])
    assert (back.black_dn, back.white_dn, back.gain_e_per_dn, back.iso) == (black, white, gain, iso)


@loop(
    ("name", "cfa", "message"),
    [
        ("shot.png", "bayer", r"raw file: .*shot\.png' has another ending; allowed: \.dng, \.tif, \.tiff; rename it"),
        ("shot", "bayer", r"has another ending"),
        ("shot.dng", "rccc", r"can't hold the mosaic \('RC', 'CC'\); .*write shot\.tif"),
        ("shot.dng", "rgbw_4x4", r"can't hold the mosaic .*write shot\.tif"),
    ],
)
def test_a_name_that_does_not_fit_is_refused(name: str, cfa: str, message: str, tmp_path: Path) -> None:
    refusal(write_raw, exposure(MOSAICS[cfa]), tmp_path / name, match=message)
    assert list(tmp_path.iterdir()) == []


@loop("name", ["shot.cr2", "shot.dng", "shot.tif"])
def test_a_missing_file_is_named(name: str, tmp_path: Path) -> None:
    refusal(read_raw, tmp_path / name, match=rf"{name}: there is no such file; give the path of a raw file")


def test_a_list_of_defects_comes_back_from_the_sidecar(tmp_path: Path) -> None:
    raw = replace(exposure(("RC", "CC")), defects=np.array([(3, 1), (8, 10)]))
    back = read_raw(write_raw(raw, tmp_path / "shot.tif")[0])
    np.testing.assert_array_equal(back.defects, [(3, 1), (8, 10)])


def test_a_file_from_before_there_were_lists_is_read(tmp_path: Path) -> None:
    write_raw(exposure(("RC", "CC")), tmp_path / "shot.tif")
    assert "defects" not in json.loads((tmp_path / "shot.json").read_text())
    assert read_raw(tmp_path / "shot.tif").defects is None


STEP = {"from_e": 10.0, "shot": 2.0, "read_noise_e": 1.0, "dsnu_e": 0.0, "prnu": 0.01}
PLACES = r"shot\.json: defects: .* is not allowed; give rows and columns"
COLOUR = r"shot\.json: .* is not allowed; give"


@loop(
    ("changes", "colour", "message"),
    [
        ({"defects": [[9, 0]]}, {}, PLACES),
        ({"defects": [[0]]}, {}, PLACES),
        ({"defects": "all"}, {}, PLACES),
        ({"defects": [[0, 1.5]]}, {}, PLACES),
        ({"noise_steps": 3}, {}, "not iterable"),
        ({"noise_steps": [{"from_e": 1.0}]}, {}, "NoiseStep.* missing"),
        ({"noise_steps": [STEP | {"more": 1}]}, {}, "unexpected keyword argument 'more'"),
        ({"noise_steps": [STEP | {"shot": 0.0}]}, {}, "noise_steps: shot: 0.0 is outside"),
        ({"noise_steps": [STEP | {"prnu": "1"}]}, {}, "noise_steps: prnu: '1'"),
        ({"noise_steps": [STEP, STEP | {"from_e": 5.0}]}, {}, r"noise_steps: from_e \[10.0, 5.0\] doesn't rise"),
        ({}, {"neutral": [1.0, 1.0]}, COLOUR),
        ({}, {"neutral": [1.0, -1.0, 1.0]}, COLOUR),
        ({}, {"neutral": [1.0, float("nan"), 1.0]}, COLOUR),
        ({}, {"neutral": [10**400, 1, 1]}, COLOUR),
        ({}, {"to_srgb": [[1, 2, 3], [1, 2], [1]]}, COLOUR),
        ({}, {"to_srgb": [[float("inf"), 0, 0], [0, 1, 0], [0, 0, 1]]}, COLOUR),
        ({}, {"camera_to_xyz_d65": [[1, 0, 0, 0]] * 3}, COLOUR),
    ],
)
def test_a_sidecar_that_cannot_be_is_refused(changes, colour, message, tmp_path: Path) -> None:
    write_raw(exposure(("RG", "GB")), tmp_path / "shot.tif")
    held = json.loads((tmp_path / "shot.json").read_text())
    assert held["version"] == VERSION
    (tmp_path / "shot.json").write_text(json.dumps(held | changes | {"colour": held["colour"] | colour}))
    refusal(read_raw, tmp_path / "shot.tif", match=message)


def test_a_sidecar_of_another_exposure_is_refused(tmp_path: Path) -> None:
    raw = exposure(("RC", "CC"))
    write_raw(raw, tmp_path / "one.tif")
    other = raw.dn.copy()
    other[3, 4] ^= 1
    write_raw(replace(raw, dn=other), tmp_path / "two.tif")
    (tmp_path / "two.json").replace(tmp_path / "one.json")
    with pytest.raises(InputError, match=r"one\.json: it describes other pixels than one\.tif; keep the two files"):
        read_raw(tmp_path / "one.tif")


@loop(
    ("text", "message"),
    [
        (b"", r"its calibration is not that of a raw image"),
        (b"[" * 100_000, r"its calibration is not that of a raw image"),
        (b"[1]", r"its calibration is not that of a raw image"),
        (b'{"format": "rodcone raw image", "version": 1}', r"its calibration lacks cfa, black_dn"),
        (b'{"format": "rodcone raw image", "version": 1, "dn": 3}', r"'dn' is unknown"),
        (b" " * (MOST_BYTES + 1), r"over \d+ bytes"),
    ],
)
def test_a_sidecar_that_is_none_is_refused_in_one_line(text: bytes, message: str, tmp_path: Path) -> None:
    write_raw(exposure(("RC", "CC")), tmp_path / "shot.tif")
    (tmp_path / "shot.json").write_bytes(text)
    refusal(read_raw, tmp_path / "shot.tif", match=message)


def test_colours_of_another_mosaic_are_refused() -> None:
    with pytest.raises(InputError, match=r"colour: 3 channels don't fit the mosaic's \('R', 'G', 'B', 'W'\)"):
        replace(exposure(("RG", "BW")), colour=colour(3))


def test_a_part_of_a_calibration_keeps_rows_and_columns_of_its_channels() -> None:
    whole = colour(4)
    part = whole.part((0, 1, 2))
    np.testing.assert_array_equal(part.neutral, whole.neutral[:3])
    np.testing.assert_array_equal(part.to_srgb, whole.to_srgb)
    for light in ("a", "d65"):
        forth, back = f"xyz_to_camera_{light}", f"camera_to_xyz_{light}"
        np.testing.assert_array_equal(getattr(part, forth), getattr(whole, forth)[:3])
        np.testing.assert_array_equal(getattr(part, back), getattr(whole, back)[:, :3])


@pytest.mark.timeout(10)
def test_a_sidecar_that_is_a_pipe_is_refused_and_not_waited_for(tmp_path: Path) -> None:
    picture, sidecar = write_raw(exposure(("RG", "BW")), tmp_path / "shot.tif")
    sidecar.unlink()
    os.mkfifo(sidecar)
    refusal(read_raw, picture, match="a folder or a device")
