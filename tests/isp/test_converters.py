"""Negatives that every raw converter takes: Bayer, whole numbers of 16 bits, and what is said of them."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import tifffile
from loop import loop

from isp.converters import MOST_STEP, converter_note, for_converters, sixteen_bit_step_e, write_with_bayer
from isp.remosaic import remosaic
from render.illuminants import illuminant
from sensor.capture import expose
from sensor.cfa import is_bayer
from sensor.device import draw_device
from sensor.presets import preset
from sensor.raw import RawImage
from sensor.raw_files.raw_file import read_raw
from studies.photograph.camera import calibrate

SHAPE = (16, 24)


def frame(name: str, cfa: str, level_e: float = 800.0) -> RawImage:
    sensor = preset(name, cfa)
    light_e = np.full(SHAPE, level_e)
    light_e[:, 20:] = 100 * level_e  # lamps
    device = draw_device(sensor, SHAPE, np.random.default_rng(1))
    raw = expose(light_e, sensor, 0.01, device, np.random.default_rng(2))
    return replace(raw, colour=calibrate(sensor, illuminant("D65")))


def test_bayer_in_whole_numbers_is_as_converters_want_it(tmp_path: Path) -> None:
    raw = frame("low_noise", "bayer_gbrg")
    assert for_converters(raw) is None
    assert converter_note(raw, Path("a.dng")) == ""
    assert write_with_bayer(raw, tmp_path / "a.dng") == (tmp_path / "a.dng",)


@loop(
    ("name", "cfa"),
    [("low_noise", "rgbw"), ("low_noise", "quad_bayer"), ("low_noise", "quad_rgbw"), ("white_apart", "rgbw")],
)
def test_other_mosaics_get_a_bayer_file_beside_them(name: str, cfa: str, tmp_path: Path) -> None:
    raw = frame(name, cfa)
    written = write_with_bayer(raw, tmp_path / "a.dng")
    assert [path.name for path in written] == ["a.dng", "a_bayer.dng"]
    bayer = read_raw(written[1])
    assert (is_bayer(bayer.cfa), bayer.dn.dtype, bayer.white_dn) == (True, np.uint16, raw.white_dn)
    again = remosaic(raw)
    assert bayer.dn == pytest.approx(np.clip(again.dn, 0, 65_535), abs=1)  # estimates may round otherwise
    merged = raw.dn.dtype.kind == "f"  # of whole numbers `rodcone --help` says it once
    note = "a.dng: give a_bayer.dng to raw converters: it is re-mosaiced" if merged else ""
    assert converter_note(raw, written[0]).startswith(note)
    assert bool(converter_note(raw, written[0])) == merged
    assert [path.name for path in write_with_bayer(raw, tmp_path / "b.tif")] == ["b.tif", "b.json"]


@loop("name", ["dual_gain", "split_pixel", "staggered"])
def test_merged_readings_become_whole_numbers_in_steps_of_16_bits(name: str) -> None:
    raw = frame(name, "bayer")
    whole = for_converters(raw)
    assert whole is not None
    step_e = sixteen_bit_step_e(raw)
    assert (whole.dn.dtype, whole.white_dn, whole.black_dn) == (np.uint16, 65_535, raw.black_dn / 256)
    assert whole.full_well_e == pytest.approx(raw.full_well_e, rel=1e-12)
    assert np.abs(whole.electrons - raw.electrons).max() <= step_e / 2 * (1 + 1e-9)
    # What it adds is in its calibration: step / sqrt(12).
    assert whole.dark_noise_e == pytest.approx(np.hypot(raw.dark_noise_e, step_e / np.sqrt(12)), rel=1e-12)
    assert f"steps of {step_e:.2g} e- beside dark noise of {raw.dark_noise_e:.2g} e-" in converter_note(
        raw, Path("a.dng")
    )


def test_a_range_that_16_bits_don_t_hold_stays_in_floats(tmp_path: Path) -> None:
    for cfa in ("bayer", "rgbw"):
        raw = frame("staggered", cfa)
        dark_e = sixteen_bit_step_e(raw) / (1.01 * MOST_STEP)
        wide = replace(raw, read_noise_e=dark_e, dsnu_e=0.0)
        made = for_converters(wide)
        assert (made is None) == (cfa == "bayer")
        assert made is None or (made.dn.dtype.kind == "f" and is_bayer(made.cfa))
        assert ("in floats" in converter_note(wide, Path("a.dng"))) == (cfa == "rgbw")


def test_a_burst_s_frames_are_numbered(tmp_path: Path) -> None:
    written = write_with_bayer(frame("staggered", "bayer"), tmp_path / "night_2.dng", frame=2)
    assert [path.name for path in written] == ["night_2.dng", "night_2_bayer.dng"]
    for path in written:
        with tifffile.TiffFile(path) as file:
            assert file.pages.first.tags["ExifTag"].value["ImageNumber"] == 2
