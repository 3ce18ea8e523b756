"""Photographs as reflectances: the colours that they had come back, and what is no photograph is refused."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from refusal import refusal

from render.radiance_files.photo import MOST_SIDE, read_photo, srgb_basis
from render.radiance_files.radiance_source import extent_of, is_reflectance, load_radiance
from render.spectrum import DEFAULT_WAVELENGTH_NM, tristimulus
from rodcone.colour_spaces import D65_XY, decode_srgb, xyz_from_xy, xyz_to_srgb


def test_the_basis_is_of_reflectances_that_add_up_to_white() -> None:
    basis = srgb_basis(DEFAULT_WAVELENGTH_NM)
    assert basis.shape == (3, 40)
    assert basis.min() >= 0
    assert basis.sum(axis=0) == pytest.approx(np.ones(40), abs=2e-3)


def test_under_d65_the_colours_of_a_photograph_come_back(tmp_path: Path) -> None:
    levels = np.linspace(0, 255, 6)
    given = np.stack(np.meshgrid(levels, levels, levels), axis=-1).reshape(12, 18, 3).round().astype(np.uint8)
    Image.fromarray(given).save(tmp_path / "colours.png")
    radiance = load_radiance(tmp_path / "colours.png")
    xyz = tristimulus(radiance.values, radiance.wavelength_nm, radiance.widths_nm) / 100.0
    assert xyz[-1, -1] == pytest.approx(xyz_from_xy(D65_XY), abs=2e-3)  # white, of 100 cd/m^2
    assert np.abs(xyz_to_srgb(xyz) - decode_srgb(given / 255)).max() < 0.0125  # of white; in bands of 10 nm


def test_grey_deep_turned_and_transparent_pictures_are_read(tmp_path: Path) -> None:
    ramp = np.linspace(0, 65535, 20).reshape(4, 5).astype(np.uint16)
    Image.fromarray(ramp).save(tmp_path / "deep.png")
    Image.fromarray((ramp >> 8).astype(np.uint8)).save(tmp_path / "grey.png")
    assert read_photo(tmp_path / "deep.png").values[3, 4] == pytest.approx(np.ones(40), abs=2e-3)
    assert read_photo(tmp_path / "grey.png").values == pytest.approx(read_photo(tmp_path / "deep.png").values, abs=0.01)
    exif = Image.Exif()
    exif[0x0112] = 6  # turned by a quarter
    Image.fromarray((ramp >> 8).astype(np.uint8)).save(tmp_path / "turned.jpg", exif=exif)
    assert read_photo(tmp_path / "turned.jpg").shape == (5, 4)
    Image.new("RGBA", (20, 16), (255, 0, 0, 0)).save(tmp_path / "clear.png")
    assert read_photo(tmp_path / "clear.png").shape == (16, 20)
    assert is_reflectance(tmp_path / "clear.png")
    assert extent_of(tmp_path / "clear.png") == (320, 40, 1)


def test_what_is_no_photograph_is_refused_in_one_line(tmp_path: Path) -> None:
    Image.new("L", (MOST_SIDE + 1, 1)).save(tmp_path / "wide.png")
    Image.effect_noise((64, 64), 50).save(tmp_path / "cut.png")
    (tmp_path / "cut.png").write_bytes((tmp_path / "cut.png").read_bytes()[:-2000])
    (tmp_path / "text.jpg").write_text("no picture", "utf-8")
    Image.new("L", (16, 16)).save(tmp_path / "gif.png", format="GIF")
    for name, words in (
        ("wide.png", "allowed: 4096 a side"),
        ("cut.png", "pixels can't be read"),
        ("text.jpg", "no JPEG or PNG"),
        ("gif.png", "no JPEG or PNG"),
        ("absent.png", "no such file"),
    ):
        refusal(read_photo, tmp_path / name, match=words)
