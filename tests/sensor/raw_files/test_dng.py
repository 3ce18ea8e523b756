"""Digital negatives: LibRaw's reading of them, the exact way back, and what a damaged or changed file is told."""

import struct
from dataclasses import replace
from datetime import datetime
from math import log2
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
from sensor.raw_files.brightness import stops_to_white
from sensor.raw_files.dng import (
    BASELINE_EXPOSURE,
    BLACK_LEVEL,
    EXPOSURE_TIME,
    LEAST_BYTES,
    MAKER,
    OPCODES,
    PRIVATE_DATA,
    WHITE_LEVEL,
    dng_tags,
    exif_tags,
    is_own,
    rational,
    read_dng,
    write_dng,
)
from sensor.raw_files.raw_file import open_raw
from sensor.raw_files.tiff import CFA, EXIF, SUB_DIRECTORIES, write_mosaic
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
    assert numerator / denominator == pytest.approx((2000 - 4 * np.sqrt(25) - 1) / 2000, rel=1e-9)


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


# What converters and Adobe's writer ask for.


def tags_of(path: Path) -> dict[str, object]:
    with tifffile.TiffFile(path) as file:
        return {tag.name: tag.value for tag in file.pages.first.tags}


def merged(white_dn: float = 256 * 65_535, black_dn: float = 3 * 256) -> RawImage:
    """Floats as merged readings have them, with the smallest and the largest."""
    dn = np.random.default_rng(3).uniform(0, white_dn, (30, 41)).astype(np.float32)
    dn.flat[:3] = 0, white_dn, np.finfo(np.float32).tiny * 2**20
    return replace(exposure(), dn=dn, white_dn=white_dn, black_dn=black_dn)


def test_floats_stand_on_a_scale_of_16_bits_and_come_back_bit_for_bit(tmp_path: Path) -> None:
    for white_dn, black_dn, stored in (
        (256 * 65_535, 768, (65_535, 3)),
        (16_383, 10, (65_532, 40)),
        (1e5 + 1, 0, (50_000, 0)),
    ):
        raw = merged(white_dn, black_dn)
        path = write_dng(raw, tmp_path / "merged.dng")
        assert same(read_dng(path), raw)
        tags = tags_of(path)
        assert (tags["WhiteLevel"], tags["BlackLevel"]) == (stored[0], (stored[1], 1))
        assert tags["DNGBackwardVersion"] == bytes([1, 4, 0, 0])
        with tifffile.TiffFile(path) as file:
            assert 32_767 < file.pages.first.asarray().max() <= 65_535.5
    write_dng(exposure(), tmp_path / "whole.dng")
    assert tags_of(tmp_path / "whole.dng")["DNGBackwardVersion"] == bytes([1, 1, 0, 0])


def test_floats_of_an_earlier_version_stand_as_they_are_and_are_still_read(tmp_path: Path) -> None:
    raw = merged()
    earlier = {BLACK_LEVEL: ("2I", rational(raw.black_dn)), WHITE_LEVEL: ("I", (int(raw.white_dn),))}
    write_mosaic(tmp_path / "shot.dng", raw.dn, CFA, {**dng_tags(raw), **earlier}, exif_tags(raw))
    assert same(read_dng(tmp_path / "shot.dng"), raw)


def test_a_small_file_is_as_large_as_rawtherapee_wants_raw_files_to_be(tmp_path: Path) -> None:
    small = write_dng(exposure(), tmp_path / "small.dng").read_bytes()
    assert len(small) == LEAST_BYTES
    large = write_dng(exposure(shape=(222, 260)), tmp_path / "large.dng").stat().st_size
    assert 2 * 222 * 260 < large < 2 * 222 * 260 + 8000


def test_two_pixels_at_each_edge_are_left_to_interpolation(tmp_path: Path) -> None:
    tags = tags_of(write_dng(exposure(), tmp_path / "shot.dng"))
    assert (tags["DefaultCropOrigin"], tags["DefaultCropSize"]) == ((2, 2), (37, 26))
    assert "DefaultCropSize" not in tags_of(write_dng(exposure(shape=(4, 41)), tmp_path / "shot.dng"))


def test_a_file_tells_when_it_was_written_and_which_exposure_of_a_burst_it_is(tmp_path: Path) -> None:
    path = tmp_path / "shot.dng"
    write_dng(exposure(), path, frame=3, written=datetime(2026, 2, 3, 14, 5, 6, 78_900))
    exif = tags_of(path)["ExifTag"]
    assert isinstance(exif, dict)
    assert (exif["DateTimeOriginal"], exif["DateTimeDigitized"]) == ("2026:02:03 14:05:06",) * 2
    assert (exif["SubsecTimeOriginal"], exif["ImageNumber"]) == ("078", 3)
    write_dng(exposure(), path)
    exif = tags_of(path)["ExifTag"]
    assert isinstance(exif, dict)
    assert "ImageNumber" not in exif


def test_baseline_exposure_is_what_development_adds_to_a_converter(tmp_path: Path) -> None:
    # Converters scale the channel that answers most to a neutral to 1, development green.
    for cfa in ("bayer", "rgbw"):
        raw = negative(cfa)
        assert raw.colour is not None
        numerator, denominator = dng_tags(raw)[BASELINE_EXPOSURE][1]
        expected = stops_to_white(raw) - log2(raw.colour.neutral.max())
        assert numerator / denominator == pytest.approx(expected, abs=1e-6)


def test_adobe_s_writer_may_write_rationals_otherwise_and_round_the_exposure(tmp_path: Path) -> None:
    raw, path = exposure(), tmp_path / "shot.dng"
    for time, allowed in (((1, 30), True), ((1, 32), True), ((1, 40), False)):
        exif = {**exif_tags(raw), EXPOSURE_TIME: ("2I", time)}
        write_mosaic(path, raw.dn, CFA, {**dng_tags(raw), BLACK_LEVEL: ("2I", (2560, 256))}, exif)
        if allowed:
            assert same(read_dng(path), raw)
        else:
            refusal(read_dng, path, match=r"ExposureTime is \(1, 40\), the calibration says \(1, 30\)")


def with_preview(raw: RawImage, path: Path) -> Path:
    """Negative as Adobe's writer makes it: a preview of 8 bits first, the mosaic in a directory below."""

    def extra(chosen: dict[int, tuple[str, object]]) -> list[tuple[object, ...]]:
        kinds = {"2I": 5, "2i": 10, "s": 2, "B": 1, "I": 4, "H": 3, "d": 12, "U": 7}
        halves = {"2I": 2, "2i": 2}
        return [
            (code, kinds[form], len(values) // halves.get(form, 1), values, True)
            for code, (form, values) in chosen.items()
        ]

    tags = dict(dng_tags(raw)) | {EXPOSURE_TIME: exif_tags(raw)[EXPOSURE_TIME]}
    tags |= {code: tag for code, tag in exif_tags(raw).items() if code != 36864}
    first = {code: tags.pop(code) for code in (MAKER, PRIVATE_DATA, 50706, 50721, 33434, 33437, 34855)}
    del tags[254], tags[272], tags[274]
    with tifffile.TiffWriter(path, byteorder="<") as file:
        preview = np.zeros((8, 12, 3), np.uint8)
        file.write(preview, photometric="rgb", subifds=1, subfiletype=1, metadata=None, extratags=extra(first))
        file.write(raw.dn, photometric="cfa", metadata=None, extratags=extra(tags))
    return path


def test_a_mosaic_below_a_preview_is_read(tmp_path: Path) -> None:
    raw = exposure()
    path = with_preview(raw, tmp_path / "adobe.dng")
    with tifffile.TiffFile(path) as file:
        assert (file.pages.first.photometric, len(file.pages.first.tags[SUB_DIRECTORIES].value)) == (2, 1)
    assert is_own(path)
    assert same(open_raw(path)[0], raw)


def test_a_mosaic_that_another_program_compressed_is_libraws_to_read(tmp_path: Path) -> None:
    path = write_dng(exposure(), tmp_path / "shot.dng")
    path.write_bytes(patched(path.read_bytes(), 259, struct.pack("<HIHH", 3, 1, 7, 0)))
    assert not is_own(path)
    assert "LibRaw" in open_raw(path)[1]["reader"]
