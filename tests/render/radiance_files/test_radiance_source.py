"""A picture file where a scene would stand: the same radiance out, levels as a scene's, no plane for lux."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import scipy.io
from loop import loop
from PIL import Image
from refusal import refusal

from render.bands.known_lamp import OtherLampWarning
from render.illuminants import illuminant
from render.radiance import SpectralRadiance
from render.radiance_files.exr import write_exr
from render.radiance_files.photo import MOST_SIDE, read_photo
from render.radiance_files.radiance_source import (
    as_transport,
    extent_of,
    is_radiance_file,
    is_reflectance,
    load_picture,
    load_radiance,
    stored_illuminant,
)
from render.radiance_files.surface_spectra import srgb_basis
from render.spectrum import DEFAULT_WAVELENGTH_NM, LUMINOUS_EFFICACY_LM_W, Spectrum, observer, tristimulus
from rodcone.colour_spaces import D65_XY, decode_srgb, xyz_from_xy, xyz_to_srgb

NM = np.array([350.0, 450.0, 589.3, 1200.0])
WIDTHS = np.array([100 / 3, 20.0, 1.0, 0.7])
VALUES = (10 ** np.random.default_rng(4).uniform(-9, 3, (6, 5, 4))).astype(np.float32)


def test_relit_at_a_spectrum_of_one_every_bit_is_the_files() -> None:
    transport = as_transport(SpectralRadiance(VALUES, NM, width_nm=WIDTHS))
    relit = transport.relight()
    assert np.array_equal(relit.values, VALUES)
    assert relit.wavelength_nm.tolist() == NM.tolist()
    assert relit.widths_nm.tolist() == WIDTHS.tolist()
    even, odd = transport.relight_halves()
    assert np.array_equal(even.values, VALUES)
    assert np.array_equal(odd.values, VALUES)


def test_level_scales_to_a_mean_luminance() -> None:
    relit = as_transport(SpectralRadiance(VALUES, NM, width_nm=WIDTHS)).relight(luminance_cd_m2=25.0)
    assert relit.luminance().mean() == pytest.approx(25.0, rel=1e-6)
    assert relit.values / VALUES == pytest.approx(np.full(VALUES.shape, relit.values[0, 0, 0] / VALUES[0, 0, 0]))


def test_illuminance_has_no_plane_and_the_group_has_a_name() -> None:
    transport = as_transport(SpectralRadiance(VALUES, NM, width_nm=WIDTHS), "street")
    assert transport.illuminance_lux(25.0) is None
    assert list(transport.groups) == ["street"]
    refusal(transport.relight, illuminance_lux=100.0, match="reference plane")


def test_spectrum_of_the_group_is_a_factor() -> None:
    light = Spectrum(np.array([300.0, 600.0, 1300.0]), np.array([1.0, 3.0, 0.5]))
    relit = as_transport(SpectralRadiance(VALUES, NM, width_nm=WIDTHS)).relight({"scene": light})
    assert relit.values == pytest.approx(VALUES * light.band_average(NM, WIDTHS), rel=1e-6)


@loop("error", [0.0, 0.02])
def test_error_of_an_even_picture_is_what_the_file_states(error: float) -> None:
    picture = SpectralRadiance(np.full((6, 5, 4), 3e-5), NM, error, WIDTHS)
    assert as_transport(picture).relight().relative_mc_error == pytest.approx(error, rel=1e-5)


def test_radiance_whose_square_is_over_float32_has_a_finite_error() -> None:
    picture = SpectralRadiance(np.full((2, 2, 4), 1e30, np.float32), NM, 0.1, WIDTHS)
    assert np.isfinite(as_transport(picture).relight().relative_mc_error)


def test_ending_tells_the_reader(tmp_path: Path) -> None:
    radiance = SpectralRadiance(VALUES, NM, width_nm=WIDTHS)
    write_exr(radiance, tmp_path / "a.EXR")
    assert np.array_equal(load_radiance(tmp_path / "a.EXR").values, VALUES)
    scipy.io.savemat(tmp_path / "a.mat", {"photons": np.ones((2, 3, 2)), "wave": [500.0, 510.0]})
    assert load_radiance(str(tmp_path / "a.mat")).shape == (2, 3)
    assert [is_radiance_file(name) for name in ("a.exr", "b/A.MAT", "still_life", "exr", "a.exr.txt")] == [
        *(True, True),
        *(False, False, False),
    ]
    refusal(load_radiance, "a.ext", match=r"'\.ext' is unknown; allowed: .*; did you mean '\.exr'")


# Photographs as reflectances: the colours that they had come back, and what is no photograph is refused.


def test_the_basis_is_of_reflectances_that_add_up_to_white() -> None:
    basis = srgb_basis(DEFAULT_WAVELENGTH_NM)
    assert basis.shape == (3, 40)
    assert basis.min() >= 0
    assert basis.sum(axis=0) == pytest.approx(np.ones(40), abs=2e-3)


def test_under_d65_the_colours_of_a_photograph_come_back(tmp_path: Path) -> None:
    levels = np.linspace(0, 255, 6)
    given = np.stack(np.meshgrid(levels, levels, levels), axis=-1).reshape(12, 18, 3).round().astype(np.uint8)
    Image.fromarray(given).save(tmp_path / "colours.png")
    with pytest.warns(UserWarning, match="sRGB's basis"):
        radiance = load_radiance(tmp_path / "colours.png")
    xyz = tristimulus(radiance.values, radiance.wavelength_nm, radiance.widths_nm) / 100.0
    assert xyz[-1, -1] == pytest.approx(xyz_from_xy(D65_XY), abs=2e-3)  # white, of 100 cd/m^2
    assert np.abs(xyz_to_srgb(xyz) - decode_srgb(given / 255)).max() < 0.0125  # of white; in bands of 10 nm


def test_grey_deep_turned_and_transparent_pictures_are_read(tmp_path: Path) -> None:
    ramp = np.linspace(0, 65535, 20).reshape(4, 5).astype(np.uint16)
    Image.fromarray(ramp).save(tmp_path / "deep.png")
    Image.fromarray((ramp >> 8).astype(np.uint8)).save(tmp_path / "grey.png")
    white = read_photo(tmp_path / "deep.png", "srgb_basis").values[3, 4]
    assert white == pytest.approx(np.ones(40), abs=2e-3)
    assert read_photo(tmp_path / "grey.png").values == pytest.approx(read_photo(tmp_path / "deep.png").values, abs=0.01)
    exif = Image.Exif()
    exif[0x0112] = 6  # turned by a quarter
    Image.fromarray((ramp >> 8).astype(np.uint8)).save(tmp_path / "turned.jpg", exif=exif)
    assert read_photo(tmp_path / "turned.jpg").shape == (5, 4)
    Image.new("RGBA", (20, 16), (255, 0, 0, 0)).save(tmp_path / "clear.png")
    with pytest.warns(UserWarning, match="sRGB's basis"):
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


# The lamp behind a file of radiance: stated by the file, or named by who opens it.

BANDS_NM = np.arange(390.0, 780.0, 20.0)
SURFACES = 0.2 + 0.6 * np.random.default_rng(2).random((3, 4, 1)) * np.linspace(0.3, 1.0, BANDS_NM.size)


def under_f11() -> SpectralRadiance:
    return SpectralRadiance(SURFACES * illuminant("F11").band_average(BANDS_NM, np.full(20, 20.0)), BANDS_NM)


def test_a_picture_that_states_its_lamp_reads_back_as_it_was_lit(tmp_path: Path) -> None:
    lit = replace(under_f11(), light=illuminant("F11"))
    write_exr(lit, tmp_path / "a.exr")
    again = load_radiance(tmp_path / "a.exr")
    assert again.light is not None
    assert np.array_equal(again.light.values, illuminant("F11").values)
    relit = load_picture(tmp_path / "a.exr", illuminant("D65")).relight()
    assert relit.values == pytest.approx(lit.values, rel=1e-6)
    assert relit.luminance() == pytest.approx(lit.luminance(), rel=1e-6)
    stored = stored_illuminant(tmp_path / "a.exr")
    assert stored is not None
    assert stored.values == pytest.approx(illuminant("F11").values, rel=1e-3)


@pytest.mark.parametrize("lamp", ["sodium_low", "F11"])
def test_a_named_lamp_of_lines_gives_the_eye_the_light_that_its_lines_hold(tmp_path: Path, lamp: str) -> None:
    """True band means of a ramp of reflectance under the lamp, against the sum over the lamp's own points."""
    light = illuminant(lamp)
    nm = np.unique(np.concatenate([np.arange(380.0, 780.0, 0.05), light.wavelength_nm]))
    nm = nm[(nm >= 380.0) & (nm <= 780.0)]
    surface = np.interp(nm, [380.0, 780.0], [0.1, 0.9]) * np.interp(nm, light.wavelength_nm, light.values, 0.0, 0.0)
    means = Spectrum(nm, surface).band_average(BANDS_NM, np.full(20, 20.0))
    write_exr(SpectralRadiance(np.broadcast_to(means, (2, 2, 20)), BANDS_NM), tmp_path / "a.exr")
    exact = LUMINOUS_EFFICACY_LM_W * np.trapezoid(surface * observer(nm), nm)
    made = load_radiance(tmp_path / "a.exr", lamp)
    assert made.widths_nm.max() == 10.0
    xyz = tristimulus(made.values, made.wavelength_nm, made.widths_nm, made.light)[0, 0]
    assert xyz[:2] == pytest.approx(exact[:2], rel=2e-3)
    smooth = load_radiance(tmp_path / "a.exr")
    assert tristimulus(smooth.values, smooth.wavelength_nm, smooth.widths_nm)[0, 0, 0] != pytest.approx(exact[0], 5e-3)


def test_a_lamp_that_is_dark_where_the_file_holds_light_is_not_taken_for_its_lamp(tmp_path: Path) -> None:
    write_exr(under_f11(), tmp_path / "a.exr")
    with pytest.warns(OtherLampWarning, match=r"nothing at \d+ nm, where the picture holds \d+\.\d% of its light"):
        made = load_radiance(tmp_path / "a.exr", "sodium_low")
    assert np.array_equal(made.values, under_f11().values.astype(np.float32))


def test_an_attribute_that_is_no_lamp_is_left_aside_and_told(tmp_path: Path) -> None:
    write_exr(replace(under_f11(), light=illuminant("F11")), tmp_path / "a.exr")
    data = (tmp_path / "a.exr").read_bytes()
    at = data.index(b"rodconeLamp")
    (tmp_path / "a.exr").write_bytes(data[: at + 30] + data[at + 30 : at + 60].replace(b":", b"?") + data[at + 60 :])
    with pytest.warns(UserWarning, match="rodconeLamp is no spectrum"):
        assert load_radiance(tmp_path / "a.exr").light is None
