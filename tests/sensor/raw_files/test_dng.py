"""Digital negatives: LibRaw's reading of them, the exact way back, and what a damaged or changed file is told."""

import struct
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import tifffile
from builders import BAYER_PHASES, RGBW_PHASES
from file_samples import exposure, same
from loop import loop
from refusal import refusal

from render.illuminants import illuminant
from sensor.cfa import MOSAICS, RGBW, Tile, is_bayer
from sensor.presets import preset
from sensor.raw import RawImage
from sensor.raw_files.dng import (
    BLACK_LEVEL,
    OPCODES,
    PRIVATE_DATA,
    dng_tags,
    exif_tags,
    is_own,
    rational,
    read_dng,
    write_dng,
)
from sensor.raw_files.tiff import CFA, EXIF, write_mosaic
from sensor.readout import as_raw
from studies.photograph.camera import calibrate

rawpy = pytest.importorskip("rawpy", reason="rawpy (LibRaw) is not installed")


@loop("name", ["quad_bayer", "quad_rgbw"])
@loop("shape", [(24, 24), (31, 46)])
def test_a_quad_mosaic_comes_back_bit_for_bit_and_its_tags_say_4x4(
    name: str, shape: tuple[int, int], tmp_path: Path
) -> None:
    raw = exposure(MOSAICS[name], shape)
    path = write_dng(raw, tmp_path / "quad.dng")
    assert same(read_dng(path), raw)
    with tifffile.TiffFile(path) as file:
        tags = file.pages.first.tags
        assert tags[33421].value == (4, 4)  # CFARepeatPatternDim: rows, columns
        pattern = bytes(tags[33422].value)
    assert pattern == bytes({"R": 0, "G": 1, "B": 2, "W": 6}[x] for row in MOSAICS[name] for x in row)


@loop("shape", [(22, 22), (31, 64), (64, 45)])
@loop("cfa", BAYER_PHASES + RGBW_PHASES)
def test_libraw_and_the_way_back_read_each_phase_bit_for_bit(cfa: Tile, shape: tuple[int, int], tmp_path: Path) -> None:
    raw = exposure(cfa, shape)
    assert same(read_dng(write_dng(raw, tmp_path / "shot.dng")), raw)
    assert list(tmp_path.iterdir()) == [tmp_path / "shot.dng"]
    with rawpy.imread(str(tmp_path / "shot.dng")) as theirs:
        np.testing.assert_array_equal(theirs.raw_image, raw.dn)
        names = "RGBG" if is_bayer(cfa) else "RGBW"  # LibRaw counts a Bayer tile's second green as number 3
        assert tuple("".join(names[i] for i in row) for row in theirs.raw_pattern) == cfa
        assert theirs.white_level == 2**14 - 1
        assert theirs.black_level_per_channel == [10, 10, 10, 10]
        gains = np.array(theirs.camera_whitebalance[: theirs.num_colors])
        assert raw.colour is not None
        assert gains / gains[1] == pytest.approx(raw.colour.neutral[1] / raw.colour.neutral, rel=1e-6)


def test_libraw_reads_the_exposure(tmp_path: Path) -> None:
    with rawpy.imread(str(write_dng(exposure(), tmp_path / "shot.dng"))) as theirs:
        assert theirs.other.shutter_speed == pytest.approx(1 / 30, rel=1e-6)
        assert (theirs.other.aperture, theirs.other.iso_speed) == (pytest.approx(2.8, rel=1e-6), 52.0)
    bare = replace(exposure(), f_number=None, iso=None)
    assert same(read_dng(write_dng(bare, tmp_path / "shot.dng")), bare)


def test_other_programs_get_a_whole_black_and_ours_the_exact_one(tmp_path: Path) -> None:
    raw = replace(exposure(), black_dn=9.84)
    path = write_dng(raw, tmp_path / "shot.dng")
    assert same(read_dng(path), raw)
    with rawpy.imread(str(path)) as theirs:
        assert theirs.black_level_per_channel == [10, 10, 10, 10]


def test_a_file_of_an_earlier_version_with_a_fraction_in_its_black_level_is_still_read(tmp_path: Path) -> None:
    raw = replace(exposure(), black_dn=9.84)
    tags = {**dng_tags(raw), BLACK_LEVEL: ("2I", rational(9.84))}
    write_mosaic(tmp_path / "shot.dng", raw.dn, CFA, tags, exif_tags(raw))
    assert same(read_dng(tmp_path / "shot.dng"), raw)


def test_public_tags_hold_what_the_specification_asks_for(tmp_path: Path) -> None:
    raw = exposure(RGBW)
    write_dng(raw, tmp_path / "shot.dng")
    with tifffile.TiffFile(tmp_path / "shot.dng") as file:
        tags = {tag.name: tag.value for tag in file.pages[0].tags}
        np.testing.assert_array_equal(file.pages[0].asarray(), raw.dn)
    assert tags["DNGVersion"] == bytes([1, 4, 0, 0])
    assert (tags["PhotometricInterpretation"], tags["Compression"], tags["BitsPerSample"]) == (32803, 1, 16)
    assert (tags["CFAPattern"], tags["CFAPlaneColor"], tags["CFARepeatPatternDim"]) == (
        bytes([0, 1, 2, 6]),
        bytes([0, 1, 2, 6]),
        (2, 2),
    )
    assert (tags["CalibrationIlluminant1"], tags["CalibrationIlluminant2"]) == (17, 21)
    assert tags["ActiveArea"] == (0, 0, 30, 41)
    assert (tags["Make"], tags["Model"], tags["UniqueCameraModel"]) == ("rodcone", "low_noise", "rodcone low_noise")
    assert (tags["Orientation"], tags["WhiteLevel"]) == (1, 16383)
    exif = tags["ExifTag"]
    assert (exif["ExposureTime"], exif["FNumber"], exif["ISOSpeedRatings"]) == ((1, 30), (14, 5), 52)
    assert raw.colour is not None
    for name, matrix in (
        ("ColorMatrix1", raw.colour.xyz_to_camera_a),
        ("ColorMatrix2", raw.colour.xyz_to_camera_d65),
        ("ForwardMatrix1", raw.colour.camera_to_xyz_a),
        ("ForwardMatrix2", raw.colour.camera_to_xyz_d65),
    ):
        pairs = np.reshape(tags[name], (-1, 2))
        assert pairs[:, 0] / pairs[:, 1] == pytest.approx(matrix.ravel(), rel=1e-8), name


def test_noise_profile_is_shot_noise_and_dark_noise_over_full_scale() -> None:
    raw = replace(exposure(), black_dn=100.0, white_dn=1100, gain_e_per_dn=2.0, read_noise_e=3.0, dsnu_e=4.0)
    kind, (slope, offset) = dng_tags(raw)[51041]
    assert kind == "d"
    assert slope == pytest.approx(1 / 2000, rel=1e-12)  # N(1)^2 = 2000 e-^2 / (2000 e-)^2
    assert offset == pytest.approx((9 + 16 + 2.0**2 / 12) / 2000**2, rel=1e-12)
    columns = replace(raw, column_gain_spread=0.01, dark_current_e=500.0)  # 2 x 0.01^2 x 500 e- of light beside dark
    assert dng_tags(columns)[51041][1] == pytest.approx((1.1 / 2000, offset), rel=1e-12)


def test_the_response_counts_as_linear_up_to_where_pixels_count_as_saturated() -> None:
    raw = replace(exposure(), black_dn=100.0, white_dn=1100, gain_e_per_dn=2.0, read_noise_e=3.0, dsnu_e=4.0)
    numerator, denominator = dng_tags(raw)[50734][1]
    assert numerator / denominator == pytest.approx((2000 - 4 * np.sqrt(25 + 1 / 3) - 1) / 2000, rel=1e-9)


@loop(
    ("changes", "message"),
    [
        ({"colour": None}, r"colour: the raw image holds no colour calibration"),
        ({"black_dn": -1.0}, r"levels: black -1\.0 .* don't fit a DNG"),
        ({"white_dn": 1000.5}, r"levels: .*white 1000\.5 don't fit a DNG"),
        ({"dn": np.zeros((4, 4), np.int32)}, r"dn: int32 of shape \(4, 4\) is not allowed"),
    ],
)
def test_what_a_dng_cannot_hold_is_refused_and_nothing_written(
    changes: dict[str, object], message: str, tmp_path: Path
) -> None:
    refusal(write_dng, replace(exposure(), **changes), tmp_path / "shot.dng", match=message)
    assert list(tmp_path.iterdir()) == []


def test_a_failed_write_leaves_the_older_file_alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = write_dng(exposure(), tmp_path / "shot.dng")
    before = path.read_bytes()

    def full(*_: object, **__: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(tifffile.TiffWriter, "write", full)
    with pytest.raises(OSError, match="No space"):
        write_dng(exposure(bits=8), path)
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]


def patched(content: bytes, code: int, entry: bytes) -> bytes:
    """File with the type, count and value of one tag of the first directory replaced."""
    (start,) = struct.unpack_from("<I", content, 4)
    (count,) = struct.unpack_from("<H", content, start)
    for place in range(start + 2, start + 2 + 12 * count, 12):
        if struct.unpack_from("<H", content, place) == (code,):
            return content[: place + 2] + entry + content[place + 2 + len(entry) :]
    raise AssertionError(f"no tag {code}")


@loop(
    ("code", "entry", "message"),
    [
        (256, struct.pack("<HII", 4, 1, 1 << 17), r"131072 x 30 pixels of 2 bytes don't fit its \d+ bytes"),
        (256, struct.pack("<HII", 4, 1, 1 << 31), r"2147483648 x 30 pixels; allowed: 1 to 131072 a side"),
        (257, struct.pack("<HII", 4, 1, 0), r"41 x 0 pixels; allowed: 1 to 131072"),
        (256, struct.pack("<HII", 2, 1, 65), r"tag 256 is missing or holds no whole numbers"),
        (258, struct.pack("<HII", 3, 1, 8), r"tag 258 is \(8,\); allowed: 16"),
        (262, struct.pack("<HII", 3, 1, 2), r"tag 262 is \(2,\); allowed: 32803"),
        (273, struct.pack("<HII", 4, 1 << 30, 8), r"tag 273 claims bytes 8 to 4294967304 of \d+; it is cut off"),
        (PRIVATE_DATA, struct.pack("<HII", 2, 4, 0), r"its DNGPrivateData holds no calibration in electrons"),
        (33422, struct.pack("<HI4B", 1, 4, 2, 1, 1, 0), r"CFAPattern is \(2, 1, 1, 0\), the calibration says \(0,"),
        (50717, struct.pack("<HII", 4, 1, 4095), r"WhiteLevel is \(4095,\), the calibration says \(16383,\)"),
        (EXIF, struct.pack("<HII", 4, 1, 1 << 30), r"its directory of tags at byte 1073741824 is not all there"),
        (EXIF, struct.pack("<HII", 4, 1, 8), r"ExposureTime is missing, the calibration says \(1, 30\)"),
        (EXIF, struct.pack("<HI4s", 2, 4, b"abc"), r"tag 34665 is missing or holds no whole numbers"),
        (50717, struct.pack("<HI4s", 2, 4, b"abc"), r"WhiteLevel is \(97, 98, 99, 0\), the calibration says"),
    ],
)  # fmt: skip
def test_a_changed_tag_is_refused_in_one_line(code: int, entry: bytes, message: str, tmp_path: Path) -> None:
    path = write_dng(exposure(), tmp_path / "shot.dng")
    path.write_bytes(patched(path.read_bytes(), code, entry))
    refusal(read_dng, path, match=message)


def test_strips_that_all_claim_the_same_bytes_are_refused(tmp_path: Path) -> None:
    strips, length, first = 512, 1024, 8 + 1024
    arrays = struct.pack(f"<{strips}I", *[8] * strips) + struct.pack(f"<{strips}I", *[length] * strips)
    one = {256: 512, 257: 512, 258: 16, 259: 1, 262: 32803, 277: 1}
    tags = [(code, 1, value) for code, value in one.items()]
    tags += [(273, strips, first), (279, strips, first + 4 * strips)]
    entries = b"".join(struct.pack("<HHII", code, 4, count, value) for code, count, value in sorted(tags))
    content = b"II*\0" + struct.pack("<I", first + len(arrays)) + bytes(length) + arrays
    (tmp_path / "shot.dng").write_bytes(content + struct.pack("<H", len(tags)) + entries + bytes(4))
    refusal(read_dng, tmp_path / "shot.dng", match=r"512 x 512 pixels of 2 bytes don't fit its \d{4} bytes")


@loop("content", [b"", b"II*\0", b"MM\0*" + bytes(40), b"II*\0\xff\xff\xff\xff", bytes(100)])
def test_what_is_no_dng_is_refused(content: bytes, tmp_path: Path) -> None:
    (tmp_path / "shot.dng").write_bytes(content)
    refusal(read_dng, tmp_path / "shot.dng", match=r"not a little-endian TIFF or DNG|cut off")


def test_a_dng_of_another_camera_is_refused(tmp_path: Path) -> None:
    tifffile.imwrite(tmp_path / "shot.dng", np.zeros((4, 4), np.uint16), photometric="cfa", metadata=None,
                     extratags=[(50706, "B", 4, (1, 4, 0, 0), True)])  # fmt: skip
    refusal(read_dng, tmp_path / "shot.dng", match="holds no calibration in electrons")


# Defective pixels in digital negatives: the opcode that DNG has for them, and whose file it is.

PLACES = np.array([(1, 2), (7, 0)])


def negative(cfa: str) -> RawImage:
    sensor = preset("low_noise", cfa)
    raw = as_raw(np.full((24, 26), 3000, np.uint16), sensor, 0.01, "numpy")
    return replace(raw, colour=calibrate(sensor, illuminant("D65")), defects=PLACES)


@loop(("cfa", "phase"), [("bayer_rggb", 0), ("bayer_grbg", 1), ("bayer_gbrg", 2), ("bayer_bggr", 3)])
def test_a_bayer_negative_tells_every_program(cfa: str, phase: int, tmp_path: Path) -> None:
    # DNG 1.4, chapter 7: FixBadPixelsList is opcode 5, from DNG 1.3, here optional, always big-endian; its parameters
    # are the phase of the pattern, the number of points and of rectangles, then row and column of each point
    write_dng(negative(cfa), tmp_path / "shot.dng")
    with tifffile.TiffFile(tmp_path / "shot.dng") as file:
        content = file.pages[0].tags[OPCODES].value
    expected = struct.pack(">I IIII", 1, 5, 0x01030000, 1, 12 + 16) + struct.pack(">III 4I", phase, 2, 0, 1, 2, 7, 0)
    assert bytes(content) == expected
    np.testing.assert_array_equal(read_dng(tmp_path / "shot.dng").defects, PLACES)


def test_an_rgbw_negative_keeps_the_list_to_itself(tmp_path: Path) -> None:
    # the opcode interpolates as Bayer's pattern is
    write_dng(negative("rgbw"), tmp_path / "shot.dng")
    with tifffile.TiffFile(tmp_path / "shot.dng") as file:
        assert OPCODES not in file.pages[0].tags
    np.testing.assert_array_equal(read_dng(tmp_path / "shot.dng").defects, PLACES)


def test_a_changed_list_is_refused(tmp_path: Path) -> None:
    path = write_dng(negative("bayer"), tmp_path / "shot.dng")
    content = path.read_bytes()
    point = struct.pack(">4I", 1, 2, 7, 0)
    assert content.count(point) == 1
    path.write_bytes(content.replace(point, struct.pack(">4I", 1, 2, 7, 1)))
    refusal(read_dng, path, match=r"OpcodeList1 is .* allowed: an unchanged file")


def test_whose_negative_it_is(tmp_path: Path) -> None:
    path = write_dng(negative("bayer"), tmp_path / "shot.dng")
    assert is_own(path)
    path.write_bytes(path.read_bytes()[:-100])  # cut off, but still ours: its own error is told, LibRaw isn't asked
    assert is_own(path)
    (tmp_path / "other.dng").write_bytes(b"MM\0*" + bytes(20))
    assert not is_own(tmp_path / "other.dng")
    assert not is_own(tmp_path / "none.dng")
