"""Raw files of other cameras through LibRaw: levels, orientation, colours and noise, and what is refused."""

import struct
import sys
from pathlib import Path

import numpy as np
import pytest
import tifffile
from file_samples import CAMERA_MATRIX as MATRIX
from file_samples import CAMERA_WHITE as WHITE
from file_samples import other_camera, over_black
from loop import loop
from refusal import refusal

from sensor.cfa import channel_map
from sensor.raw_files.dng import rational
from sensor.raw_files.photograph import ASSUMED_DARK_NOISE_E, ASSUMED_FULL_WELL_E, read_noise_profile, read_photograph
from sensor.raw_files.raw_file import open_raw, read_raw

rawpy = pytest.importorskip("rawpy", reason="rodcone[photographs] (LibRaw) is not installed")

SHAPE = (40, 60)


def test_each_channels_black_is_taken_off(tmp_path: Path) -> None:
    above = np.random.default_rng(0).integers(0, 15_000, SHAPE).astype(np.float64)
    raw = read_raw(other_camera(tmp_path / "shot.dng", over_black(above)))
    assert (raw.cfa, raw.shape, raw.black_dn, raw.white_dn) == (("RG", "GB"), SHAPE, 520.0, 16_000.0)
    np.testing.assert_array_equal(raw.dn - raw.black_dn, above)
    assert (raw.exposure_s, raw.f_number, raw.iso) == (pytest.approx(0.01), pytest.approx(4.0), None)


def test_a_full_sample_is_full_whatever_its_black_was(tmp_path: Path) -> None:
    raw = read_raw(other_camera(tmp_path / "shot.dng", np.full(SHAPE, WHITE, np.uint16)))
    assert raw.saturated.all()
    np.testing.assert_array_equal(raw.dn, np.full(SHAPE, WHITE))


@loop("orientation", range(1, 9))
def test_frames_are_turned_upright_as_libraw_turns_its_own_pictures(orientation: int, tmp_path: Path) -> None:
    above = np.full(SHAPE, 2000.0)
    above[:20, :20] = 12_000.0  # a bright corner: its place and the frame's proportions tell all eight apart
    path = other_camera(tmp_path / "shot.dng", over_black(above), orientation=orientation)
    raw = read_raw(path)
    with rawpy.imread(str(path)) as theirs:
        picture = theirs.postprocess(output_bps=16, no_auto_bright=True, gamma=(1, 1), half_size=False)
    assert picture.shape[:2] == raw.shape
    assert brightest_corner(picture[..., 1]) == brightest_corner(raw.dn)
    # the channels are turned with the samples: each is found by its own level
    shares = np.select([np.indices(SHAPE).sum(0) % 2 == 1, np.indices(SHAPE)[0] % 2 == 0], [1.0, 0.5], 0.25)
    mosaic = read_raw(other_camera(tmp_path / "sites.dng", over_black(8000.0 * shares), orientation=orientation))
    by_value = np.where(mosaic.electrons == 8000 * mosaic.gain_e_per_dn, "G", "R")
    by_value[np.isclose(mosaic.electrons, 2000 * mosaic.gain_e_per_dn)] = "B"
    assert mosaic.cfa == tuple("".join(row) for row in by_value[:2, :2])


def brightest_corner(frame: np.ndarray) -> int:
    ends = (slice(2, 12), slice(-12, -2))
    return int(np.argmax([frame[row, column].mean() for row in ends for column in ends]))


def test_white_balance_and_matrix_are_the_files(tmp_path: Path) -> None:
    raw, facts = open_raw(other_camera(tmp_path / "shot.dng", over_black(np.full(SHAPE, 3000.0))))
    assert raw.colour is not None
    assert raw.colour.neutral == pytest.approx([0.5, 1.0, 0.7], rel=1e-5)
    assert raw.colour.to_srgb.sum(axis=1) == pytest.approx(np.ones(3), abs=1e-14)  # LibRaw's have 24 bits
    # ColorMatrix1 is for D65 here: a camera colour of an XYZ goes back to that XYZ in sRGB, as DNG's chapter 6 has it
    srgb_to_xyz = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]])
    to_camera = MATRIX @ srgb_to_xyz
    balanced = to_camera / to_camera.sum(axis=1, keepdims=True)
    assert raw.colour.to_srgb == pytest.approx(np.linalg.inv(balanced), abs=2e-3)
    white = np.array([0.9505, 1.0, 1.089])
    response = raw.colour.xyz_to_camera_d65 @ white
    assert response / response[1] == pytest.approx(MATRIX @ white / (MATRIX @ white)[1], abs=2e-3)
    assert raw.colour.camera_to_xyz_d65 @ np.ones(3) == pytest.approx([0.9642, 1.0, 0.8249], abs=2e-3)  # D50
    assert (facts["as_shot"], facts["colour_matrix"]) == ("file", "LibRaw")


def test_a_file_without_colours_says_so(tmp_path: Path) -> None:
    raw, facts = open_raw(other_camera(tmp_path / "shot.dng", over_black(np.full(SHAPE, 3000.0)), colours=False))
    assert raw.colour is not None
    assert facts["colour_matrix"] == "none"
    np.testing.assert_array_equal(raw.colour.to_srgb, np.eye(3))


def test_noise_comes_from_the_files_profile(tmp_path: Path) -> None:
    # S = 1 / full scale in electrons, O = (dark / full scale)^2; three channels whose mean counts
    full, dark = 31_000.0, 6.0
    pair = (1 / full, (dark / full) ** 2)
    path = other_camera(tmp_path / "shot.dng", over_black(np.full(SHAPE, 3000.0)), noise=pair * 3)
    raw, facts = open_raw(path)
    assert facts["noise"] == "profile of the file"
    assert raw.gain_e_per_dn == pytest.approx(full / (WHITE - 520))
    assert raw.read_noise_e == pytest.approx(dark)


@loop("pair", [(0.0, 0.0), (float("nan"), 1.0), (-1e-4, 1e-9), (2.0, 1e-9), (1e-4, 2.0), (1e-4,)])
def test_a_profile_that_says_nothing_is_not_believed(pair: tuple[float, ...], tmp_path: Path) -> None:
    path = other_camera(tmp_path / "shot.dng", over_black(np.full(SHAPE, 3000.0)), noise=pair)
    assert read_noise_profile(path, 15_000.0) is None


def test_noise_is_estimated_from_a_frame_large_enough_and_assumed_otherwise(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    ramp = np.tile(np.geomspace(20.0, 4000.0, 512), (400, 1))
    electrons = rng.poisson(ramp) + 3.0 * rng.standard_normal(ramp.shape)  # at 0.5 e- a DN
    raw, facts = open_raw(other_camera(tmp_path / "shot.dng", over_black(electrons / 0.5)))
    assert facts["noise"] == "estimated from the frame"
    assert facts["gain_e_per_dn"] == raw.gain_e_per_dn == pytest.approx(0.5, rel=0.2)
    raw, facts = open_raw(other_camera(tmp_path / "small.dng", over_black(np.full(SHAPE, 3000.0))))
    assert facts["noise"] == "assumed"
    assert (raw.white_dn - raw.black_dn) * raw.gain_e_per_dn == pytest.approx(ASSUMED_FULL_WELL_E)
    assert raw.read_noise_e == ASSUMED_DARK_NOISE_E


def test_mosaics_that_are_not_bayers_are_refused(tmp_path: Path) -> None:
    dn = over_black(np.full((36, 60), 3000.0))
    x_trans = tuple(int(colour) for colour in "121101010212121101101121212010101121")
    other_camera(tmp_path / "x.dng", dn, pattern=x_trans, repeat=(6, 6))
    other_camera(tmp_path / "row.dng", dn, pattern=(0, 1, 0, 2))
    for name in ("x.dng", "row.dng"):
        refusal(read_photograph, tmp_path / name, match=rf"{name}: .*; allowed: Bayer")


def test_without_rawpy_the_extra_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = other_camera(tmp_path / "shot.dng", over_black(np.full(SHAPE, 3000.0)))
    monkeypatch.setitem(sys.modules, "rawpy", None)
    refusal(read_raw, path, match=r"^rawpy: not installed .*pip install 'rodcone\[photographs\]'")


@loop("content", [b"", b"no raw file", b"II*\0" + bytes(40), b"MM\0*" + bytes(40)])
@loop("name", ["shot.nef", "shot.dng", "shot"])
def test_what_libraw_cannot_read_is_one_line(name: str, content: bytes, tmp_path: Path) -> None:
    (tmp_path / name).write_bytes(content)
    assert "b'" not in refusal(
        read_raw, tmp_path / name, match=r"shot.*: LibRaw can't read it \(.+\); allowed: raw files"
    )


@loop("side", [20_000, 60_000])
def test_pixels_that_a_file_can_not_hold_are_refused_before_memory_is_taken(side: int, tmp_path: Path) -> None:
    """LibRaw itself takes 0.8 GB for 20 000 pixels a side, whatever the file holds."""
    content = other_camera(tmp_path / "shot.dng", over_black(np.zeros(SHAPE))).read_bytes()
    for code, held in ((256, SHAPE[1]), (257, SHAPE[0])):
        entry = struct.pack("<HHII", code, 4, 1, held)
        assert content.count(entry) == 1
        content = content.replace(entry, struct.pack("<HHII", code, 4, 1, side))
    (tmp_path / "shot.dng").write_bytes(content)
    refusal(read_photograph, tmp_path / "shot.dng", match=rf"bytes can't hold the {side} x {side} pixels")


@loop("order", ["<", ">"])
@loop("below", [False, True])
def test_a_profile_is_found_in_either_byte_order_and_below_the_first_picture(
    order: str, below: bool, tmp_path: Path
) -> None:
    """Cameras keep a small picture in the first directory and the raw one below it; tifffile writes both here."""
    profile, picture = [(51041, 12, 6, (1e-4, 1e-8) * 3, True)], np.zeros((8, 8), np.uint16)
    with tifffile.TiffWriter(tmp_path / "a.dng", byteorder=order) as file:  # type: ignore[arg-type]
        file.write(picture, subifds=2 if below else 0, extratags=[] if below else profile)
        if below:
            file.write(picture, subfiletype=1)
            file.write(picture, extratags=profile)
    read = read_noise_profile(tmp_path / "a.dng", 1000.0)
    assert read is not None
    assert read.gain_e_per_dn == pytest.approx(10.0)
    assert read.dark_noise_e == pytest.approx(1.0)


# Levels, areas and patterns as a file's own tags have them: LibRaw moves an odd margin, and not the levels with it.

LEVELS = np.array([[200.0, 256.0], [300.0, 240.0]])
COLOURS = np.array([[300.0, 800.0], [800.0, 400.0]])  # R, G, G, B of RGGB over black


def repeated(pattern: np.ndarray, area: tuple[int, int, int, int], shape: tuple[int, int]) -> np.ndarray:
    """Pattern over a frame, from the first row and column of an area on."""
    rows, columns = np.mgrid[: shape[0], : shape[1]]
    return pattern[(rows - area[0]) % pattern.shape[0], (columns - area[1]) % pattern.shape[1]]


@loop("area", [(0, 0, 66, 66), (1, 0, 65, 66), (0, 1, 66, 65), (1, 1, 65, 65), (2, 2, 64, 64), (3, 5, 60, 62)])
@loop("orientation", [1, 6])
def test_black_and_colours_begin_where_the_active_area_begins(
    area: tuple[int, int, int, int], orientation: int, tmp_path: Path
) -> None:
    dn = repeated(COLOURS + LEVELS, area, (66, 66)).astype(np.uint16)
    more = {50713: ("H", (2, 2)), 50714: ("2I", rational(LEVELS)), 50829: ("I", area)}
    raw = read_raw(other_camera(tmp_path / "shot.dng", dn, orientation=orientation, more=more))
    assert raw.shape == (area[2] - area[0], area[3] - area[1])[:: -1 if orientation == 6 else 1]
    for channel, level in (("R", 300.0), ("G", 800.0), ("B", 400.0)):
        held = raw.dn[np.array(channel_map(raw.cfa, raw.shape)) == channel] - raw.black_dn
        assert (held.min(), held.max()) == (level, level)


def test_rows_and_columns_have_blacks_of_their_own(tmp_path: Path) -> None:
    area, rows, columns = (1, 3, 65, 64), np.arange(64) - 30.0, np.arange(61) * 0.5
    pattern = np.array([[500.0, 510.0, 520.0]])  # a repeat of another size than the mosaic's
    black = repeated(pattern, area, (66, 66))[1:65, 3:64] + rows[:, None] + columns[None]
    dn = np.zeros((66, 66), np.uint16)
    dn[1:65, 3:64] = np.rint(black + repeated(COLOURS, (0, 0, 0, 0), (64, 61)))
    more = {
        50713: ("H", (1, 3)),
        50714: ("2I", rational(pattern)),
        50715: ("2i", rational(columns)),
        50716: ("2i", rational(rows)),
        50829: ("I", area),
    }
    raw = read_raw(other_camera(tmp_path / "shot.dng", dn, more=more))
    assert np.abs(raw.dn - raw.black_dn - repeated(COLOURS, (0, 0, 0, 0), (64, 61))).max() <= 1.0  # two roundings


def test_a_table_of_linear_values_comes_before_black(tmp_path: Path) -> None:
    table = tuple(min(2 * number, 16_000) for number in range(8192))
    more = {50712: ("H", table), 50713: ("H", (1, 1)), 50714: ("2I", (100, 1))}
    raw = read_raw(other_camera(tmp_path / "shot.dng", np.full(SHAPE, 400, np.uint16), more=more))
    assert np.unique(raw.dn - raw.black_dn).tolist() == [700.0]


@loop(
    ("more", "words"),
    [
        ({50711: ("H", (2,))}, "CFALayout"),
        ({50718: ("2I", (2, 1, 1, 1))}, "DefaultScale"),
        ({50715: ("2i", (1, 1))}, "BlackLevelDeltaH has 1 values for 60"),
        ({50713: ("H", (2, 3))}, "BlackLevel has 4 values for a pattern of (2, 3)"),
    ],
)
def test_tags_that_change_samples_and_do_not_fit_are_refused_by_name(more: dict, words: str, tmp_path: Path) -> None:
    path = other_camera(tmp_path / "shot.dng", over_black(np.full(SHAPE, 3000.0)), more=more)
    refusal(read_photograph, path, words=(words,))


def test_opcodes_that_are_not_applied_are_told(tmp_path: Path) -> None:
    gains = struct.pack(">5I", 1, 9, 0x01030000, 1, 4) + bytes(4)
    path = other_camera(tmp_path / "shot.dng", over_black(np.full(SHAPE, 3000.0)), more={51009: ("U", gains)})
    with pytest.warns(UserWarning, match="GainMap of OpcodeList2 is not applied"):
        read_photograph(path)


# DNG 1.6, chapter 7, by number from 1 on.
OPCODES = (
    *("WarpRectilinear", "WarpFisheye", "FixVignetteRadial", "FixBadPixelsConstant", "FixBadPixelsList", "TrimBounds"),
    *("MapTable", "MapPolynomial", "GainMap", "DeltaPerRow", "DeltaPerColumn", "ScalePerRow", "ScalePerColumn"),
    "WarpRectilinear2",
)


@loop("number", range(1, 16))
def test_each_opcode_is_told_by_its_name_and_list(number: int, tmp_path: Path) -> None:
    """Flag 1 makes it optional; one that no version of DNG has goes by its number."""
    name = OPCODES[number - 1] if number <= len(OPCODES) else str(number)
    code = (51008, 51009, 51022)[number % 3]
    operation = struct.pack(">5I", 1, number, 0x01030000, 1, 4) + bytes(4)
    path = other_camera(tmp_path / "shot.dng", over_black(np.full(SHAPE, 3000.0)), more={code: ("U", operation)})
    with pytest.warns(UserWarning, match=rf"\b{name} of OpcodeList{number % 3 + 1} is not applied"):
        read_photograph(path)


def test_a_mosaic_below_a_preview_has_its_own_levels(tmp_path: Path) -> None:
    dn = (repeated(COLOURS + LEVELS, (0, 0, 0, 0), SHAPE)).astype(np.uint16)
    camera = [(50706, "B", 4, bytes((1, 4, 0, 0))), (271, "s", 6, b"Other\0"), (272, "s", 2, b"X\0")]
    camera += [(50708, "s", 8, b"Other X\0"), (50721, "2i", 9, rational(MATRIX)), (50778, "H", 1, 21)]
    mosaic = [(33421, "H", 2, (2, 2)), (33422, "B", 4, bytes((0, 1, 1, 2))), (50713, "H", 2, (2, 2))]
    mosaic += [(50714, "2I", 4, rational(LEVELS)), (50717, "I", 1, WHITE)]
    types = {"B": 1, "s": 2, "H": 3, "I": 4, "2I": 5, "2i": 10}
    first, second = ([(c, types[form], n, value, True) for c, form, n, value in tags] for tags in (camera, mosaic))
    with tifffile.TiffWriter(tmp_path / "a.dng", byteorder="<", bigtiff=False) as file:
        file.write(
            np.zeros((8, 8, 3), np.uint8), photometric="rgb", subifds=1, subfiletype=1, metadata=None, extratags=first
        )
        file.write(dn, photometric=32803, subfiletype=0, metadata=None, extratags=second)
    raw = read_raw(tmp_path / "a.dng")
    assert np.array_equal(raw.dn - raw.black_dn, repeated(COLOURS, (0, 0, 0, 0), SHAPE))
