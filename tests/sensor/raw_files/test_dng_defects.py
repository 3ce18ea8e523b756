"""Defective pixels in digital negatives: the opcode that DNG has for them, and whose file it is."""

import struct
from dataclasses import replace
from pathlib import Path

import numpy as np
import tifffile
from loop import loop
from refusal import refusal

from render.illuminants import illuminant
from sensor.presets import preset
from sensor.raw import RawImage
from sensor.raw_files.dng import OPCODES, is_own, read_dng, write_dng
from sensor.readout import as_raw
from studies.photograph.camera import calibrate

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
