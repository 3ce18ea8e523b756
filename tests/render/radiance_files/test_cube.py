"""Cubes with their descriptions, however the numbers lie in the file; and what is refused."""

from pathlib import Path

import numpy as np
import pytest
from file_samples import ENVI_NM as NM
from file_samples import envi_header
from loop import loop
from refusal import refusal
from scipy.io import savemat

from render.illuminants import illuminant
from render.radiance_files.cube import read_cube
from render.radiance_files.radiance_source import extent_of, files_of, is_reflectance, load_picture, load_radiance
from render.spectrum import luminance

CUBE = np.random.default_rng(4).uniform(0.05, 0.95, (5, 6, NM.size))
PLAIN = 'holds = "reflectance"\nwavelength_nm = [400, 700]\n'


def npy(folder: Path, cube: np.ndarray = CUBE, text: str = PLAIN) -> Path:
    np.save(folder / "desk.npy", cube)
    (folder / "desk.toml").write_text(text, "utf-8")
    return folder / "desk.npy"


def envi(folder: Path, more: str = "", **changes: object) -> Path:
    (folder / "desk.hdr").write_text(envi_header(**changes) + more, "utf-8")
    (folder / "desk.toml").write_text('holds = "reflectance"\n', "utf-8")
    return folder / "desk.hdr"


def test_an_array_is_read_in_any_order_of_its_axes_and_any_number_type(tmp_path: Path) -> None:
    assert read_cube(npy(tmp_path)).values == pytest.approx(CUBE, rel=1e-6)
    turned = PLAIN + 'axes = ["wavelength", "height", "width"]\nscale = 1e-4\n'
    stored = np.asfortranarray(np.rint(np.moveaxis(CUBE, 2, 0) * 1e4).astype(">u2"))
    assert read_cube(npy(tmp_path, stored, turned)).values == pytest.approx(CUBE, abs=1e-4)
    assert read_cube(npy(tmp_path)).wavelength_nm.tolist() == NM.tolist()


@pytest.mark.thorough
def test_a_mat_file_is_read_by_the_names_that_its_description_gives(tmp_path: Path) -> None:
    savemat(tmp_path / "desk.mat", {"ref": np.moveaxis(CUBE, 2, 1), "bands": NM})
    names = 'variable = "ref"\naxes = ["height", "wavelength", "width"]\n'
    (tmp_path / "desk.toml").write_text('holds = "radiance"\nwavelength_nm = "bands"\n' + names, "utf-8")
    assert read_cube(tmp_path / "desk.mat").values == pytest.approx(CUBE, rel=1e-6)
    assert not is_reflectance(tmp_path / "desk.mat")
    (tmp_path / "desk.toml").write_text(PLAIN, "utf-8")
    assert "variable and axes are missing" in refusal(read_cube, tmp_path / "desk.mat")
    (tmp_path / "desk.toml").write_text(PLAIN + names.replace("ref", "other"), "utf-8")
    assert "no numbers 'other'" in refusal(read_cube, tmp_path / "desk.mat")
    (tmp_path / "desk.toml").unlink()
    assert "an ISETCam scene" in refusal(load_radiance, tmp_path / "desk.mat")


@loop("order", ["bsq", "bil", "bip"])
@loop(("kind", "dtype", "big"), [(4, "<f4", 0), (5, ">f8", 1), (12, ">u2", 1), (2, "<i2", 0)])
def test_envis_interleaves_types_and_byte_orders(order: str, kind: int, dtype: str, big: int, tmp_path: Path) -> None:
    axes = {"bsq": (2, 0, 1), "bil": (0, 2, 1), "bip": (0, 1, 2)}[order]
    whole = dtype[1] in "iu"
    stored = (np.rint(CUBE * 1e4) if whole else CUBE).astype(dtype).transpose(axes)
    (tmp_path / "desk.img").write_bytes(b"head" + stored.tobytes())
    factor = "reflectance scale factor = 10000\n" if whole else ""
    found = read_cube(envi(tmp_path, factor, offset=4, kind=kind, order=order, big=big))
    assert found.values == pytest.approx(CUBE, abs=1e-4)
    assert found.wavelength_nm.tolist() == NM.tolist()
    assert [path.name for path in files_of(tmp_path / "desk.hdr")] == ["desk.hdr", "desk.toml", "desk.img"]


@loop(("unit", "per_nm"), [("Micrometers", 1e-3), ("um", 1e-3), ("µm", 1e-3), ("Nanometres", 1.0), ("nm", 1.0)])
def test_units_of_wavelengths_are_those_that_instruments_write(tmp_path: Path, unit: str, per_nm: float) -> None:
    (tmp_path / "desk").write_bytes(CUBE.transpose(2, 0, 1).astype("<f4").tobytes())
    found = read_cube(envi(tmp_path, unit=unit, nm=", ".join(map(str, NM * per_nm)) + " ,"))
    assert found.wavelength_nm == pytest.approx(NM)


def list_of(values: np.ndarray) -> str:
    return f"{{{', '.join(map(repr, values.tolist()))}}}"


def test_envis_gains_and_offsets_are_applied_band_by_band(tmp_path: Path) -> None:
    gains, offsets = 1e-5 * np.arange(1, 8), 0.002 * np.arange(1, 8)
    (tmp_path / "desk.img").write_bytes(np.full((7, 5, 6), 1000, "<u2").tobytes())
    law = f"data gain values = {list_of(gains)}\ndata offset values = {list_of(offsets)}\n"
    found = read_cube(envi(tmp_path, law, kind=12))
    assert found.values[0, 0] == pytest.approx(1000 * gains + offsets, rel=1e-6)
    assert found.values[0, 0, 0] == pytest.approx(0.012)  # 1000 x 1e-5 + 0.002
    reflectance = law.replace("data ", "data reflectance ")
    assert read_cube(envi(tmp_path, reflectance, kind=12)).values == pytest.approx(found.values)
    envi(tmp_path, law, kind=12)
    (tmp_path / "desk.toml").write_text('holds = "radiance"\n', "utf-8")
    assert "in which unit of radiance" in refusal(read_cube, tmp_path / "desk.hdr")
    (tmp_path / "desk.toml").write_text('holds = "radiance"\nscale = 0.001\n', "utf-8")
    assert read_cube(tmp_path / "desk.hdr").values[0, 0, 0] == pytest.approx(0.012e-3)


def test_bands_are_sorted_and_bad_ones_left_out(tmp_path: Path) -> None:
    stored = CUBE[..., ::-1].transpose(2, 0, 1).astype("<f4")
    (tmp_path / "desk.img").write_bytes(stored.tobytes())
    header = envi(tmp_path, nm=", ".join(map(str, NM[::-1])))
    found = read_cube(header)
    assert found.wavelength_nm.tolist() == NM.tolist()
    assert found.values == pytest.approx(CUBE, rel=1e-6)
    (tmp_path / "desk.hdr").write_text(header.read_text() + "bbl = {0, 1, 1, 1, 1, 1, 1}\n")
    with pytest.warns(UserWarning, match="1 bands that its bbl marks as bad"):
        found = read_cube(header)
    assert found.wavelength_nm.tolist() == NM[:-1].tolist()  # the file's first is the longest wavelength
    assert found.values == pytest.approx(CUBE[..., :-1], rel=1e-6)


def test_reflectances_are_lit_by_any_light_and_white_has_100_cd_m2(tmp_path: Path) -> None:
    path = npy(tmp_path, np.ones((4, 5, 40)), 'holds = "reflectance"\nwavelength_nm = [385, 775]\n')
    assert load_radiance(path).luminance() == pytest.approx(np.full((4, 5), 100.0), rel=2e-3)  # in bands of 10 nm
    lit = load_picture(path, illuminant("A"))
    again = lit.relight({"light": illuminant("D65")})
    assert again.values == pytest.approx(load_radiance(path).values, rel=1e-6)
    radiance = npy(tmp_path, CUBE, PLAIN.replace("reflectance", "radiance"))
    direct = load_radiance(radiance)
    assert direct.values == pytest.approx(CUBE, rel=1e-6)
    assert direct.luminance() == pytest.approx(luminance(CUBE, NM, np.full(NM.size, 50.0)), rel=1e-5)
    assert extent_of(path)[0] > 0


@loop(
    ("cube", "text", "words"),
    [
        (CUBE, "", "holds is missing; add it, or give holds and wavelength_nm"),
        (CUBE, PLAIN.replace("reflectance", "reflexion"), "did you mean 'reflectance'"),
        (CUBE, PLAIN + "scales = 2\n", "'scales' is unknown"),
        (CUBE, PLAIN + "scale = nan\n", "scale: nan is outside"),
        (CUBE, PLAIN + 'axes = ["height", "width"]\n', "axes: ['height', 'width'] are not allowed"),
        (CUBE, PLAIN + 'axes = ["wavelength", "height", "width"]\n', ""),  # 5 bands of a cube of 7: another picture
        (CUBE, 'holds = "reflectance"\n', "wavelength_nm: nothing states it"),
        (CUBE, 'holds = "reflectance"\nwavelength_nm = [400, 500, 600]\n', "3 numbers don't fit 7 bands"),
        (CUBE, 'holds = "reflectance"\nwavelength_nm = [0.4, 0.7]\n', "desk.npy"),
        (CUBE, 'holds = "reflectance"\nwavelength_nm = [700, 400]\n', "2 numbers don't fit"),
        (CUBE, 'holds = "reflectance"\nwavelength_nm = [400, inf]\n', "2 numbers don't fit"),
        (CUBE, "holds = [", "desk.toml: can't be read"),
        (CUBE * 100, PLAIN, "of its reflectances exceed 1"),
        (np.where(CUBE > 0.9, np.nan, CUBE), PLAIN, "finite numbers >= 0"),
        (CUBE[0], PLAIN, "an array of 2 axes"),
        (CUBE.astype(complex), PLAIN, "3 axes of real numbers"),
        (CUBE[:0], PLAIN, "0 x 6 pixels are not allowed"),
    ],
)
def test_what_does_not_agree_is_refused_in_one_line(cube: np.ndarray, text: str, words: str, tmp_path: Path) -> None:
    path = npy(tmp_path, cube, text)
    if words:
        assert words in refusal(read_cube, path)
    else:
        assert read_cube(path).shape == (6, 7)


@loop(
    ("changes", "words"),
    [
        ({"kind": -4}, "data type: '-4' is not a whole number"),
        ({"order": "bis"}, "interleave 'bis'"),
        ({"offset": 1}, "has 840 bytes, its header stands for 841"),
        ({"offset": "9" * 14}, "header offset"),
        ({"unit": "Parsec"}, "wavelength units: 'parsec'"),
        ({"nm": "400, x"}, "wavelength: 'x' in its header is not a number"),
        ({"unit": "Wavenumber"}, "wavelength units: 'wavenumber'"),
        ({"more": "data gain values = {1, 2}\n"}, "data gain values: 2 numbers don't fit 7 bands"),
        ({"more": "data gain valeus = {1, 2}\n"}, "did you mean 'data gain values'"),
        ({"more": "major frame offsets = {0, 16}\n"}, "major frame offsets: '{0, 16}' changes values"),
        ({"more": "file type = ENVI Classification\n"}, "file type: 'ENVI Classification'"),
        ({"more": f"data ignore value = {np.float32(CUBE[0, 0, 0])}\n"}, "data ignore value: 1 of its numbers"),
        (
            {"more": f"reflectance scale factor = 10\ndata reflectance gain values = {{{', '.join(7 * ['0.2'])}}}\n"},
            "reflectance scale factor: 10 and the data reflectance gain and offset values disagree",
        ),
        ({"more": f"bbl = {{{', '.join(7 * '0')}}}\n"}, "bbl: it marks every band as bad"),
        ({"nm": "400, 500"}, "2 numbers don't fit"),
        ({"more": "file compression = 1\n"}, "file compression: 1"),
        ({"more": "lines = 1000000\n"}, "1000000 x 6 pixels are not allowed"),
        ({"more": "reflectance scale factor = 0\n"}, "0 is not a number above 0"),
    ],
)
def test_a_damaged_envi_header_is_refused_in_one_line(changes: dict[str, object], words: str, tmp_path: Path) -> None:
    (tmp_path / "desk.img").write_bytes(CUBE.transpose(2, 0, 1).astype("<f4").tobytes())
    assert words in refusal(read_cube, envi(tmp_path, **changes))  # type: ignore[arg-type]
