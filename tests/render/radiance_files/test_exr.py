"""Spectral OpenEXR: bits kept, the layout's names and attributes, other readers and writers, hostile files."""

from contextlib import nullcontext
from pathlib import Path
from typing import Any

import numpy as np
import OpenEXR
import pytest
from loop import loop
from refusal import refusal

from render.loader import mitsuba_module
from render.radiance import SpectralRadiance
from render.radiance_files.exr import LAYOUT_UNITS, channel_name, read_bands, read_exr, spectral_channels, write_exr
from render.radiance_files.file_checks import MOST_BYTES, MOST_EXPANSION, MOST_SIDE, bands_between, require_extent
from render.radiance_files.radiance_source import is_reflectance, load_radiance
from rodcone.errors import InputError
from rodcone.jit import at_least_two_threads
from scenes.reflectances import color_checker_reflectances

FLOAT = np.finfo(np.float32)


def picture(height: int = 5, width: int = 7, bands: int = 4) -> SpectralRadiance:
    """Values from the least subnormal to 1e30, and none alike."""
    exponent = np.random.default_rng(1).uniform(-44.8, 30, (height, width, bands))
    values = (10**exponent).astype(np.float32)
    values.flat[0], values.flat[-1] = FLOAT.smallest_subnormal, 1e30
    return SpectralRadiance(values, 400.0 + 10 * np.arange(bands), 0.0123, np.full(bands, 10.0))


def write_by_hand(path: Path, channels: dict[str, Any], **attributes: Any) -> Path:
    """File of another program."""
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage, "emissiveUnits": LAYOUT_UNITS}
    OpenEXR.File({k: v for k, v in (header | attributes).items() if v is not None}, channels).write(str(path))
    return path


def plane(value: float, shape: tuple[int, int] = (3, 4), dtype: Any = np.float32) -> np.ndarray:
    return np.full(shape, value, dtype=dtype)


def layout_of(path: Path) -> tuple[list[str], dict[str, Any], dict[str, np.ndarray]]:
    """Channel names as they stand in the file, attributes, pixels."""
    part = OpenEXR.File(str(path), separate_channels=True).parts[0]
    names = [channel.name for channel in OpenEXR.File(str(path), header_only=True).parts[0].header["channels"]]
    return names, part.header, {name: channel.pixels for name, channel in part.channels.items()}


@loop(("height", "width", "bands"), [(5, 7, 4), (1, 1, 1), (1, 33, 2), (37, 1, 3), (6, 5, 401)])
def test_float32_radiance_reads_back_bit_by_bit(tmp_path: Path, height: int, width: int, bands: int) -> None:
    path, radiance = tmp_path / "a.exr", picture(height, width, bands)
    write_exr(radiance, path)
    read = read_exr(path)
    assert read.values.dtype == np.float32
    assert np.array_equal(read.values.view(np.uint32), radiance.values.view(np.uint32))


def test_centres_widths_and_error_read_back_as_the_same_float64(tmp_path: Path) -> None:
    centres = np.array([380 + 1 / 3, 588.9950, 589.5924, 780.0])
    widths = np.array([10 / 3, 0.1, 1.0, 1e-3 / 7])
    radiance = SpectralRadiance(np.ones((2, 2, 4)), centres, 1 / 7, widths)
    write_exr(radiance, tmp_path / "a.exr")
    read = read_exr(tmp_path / "a.exr")
    assert read.wavelength_nm.tolist() == centres.tolist()
    assert read.widths_nm.tolist() == widths.tolist()
    assert read.relative_mc_error == 1 / 7


def test_float64_is_rounded_once_to_float32(tmp_path: Path) -> None:
    values = np.random.default_rng(2).random((3, 4, 2)) * 1e-4
    write_exr(SpectralRadiance(values, np.array([500.0, 510.0])), tmp_path / "a.exr")
    assert np.array_equal(read_exr(tmp_path / "a.exr").values, values.astype(np.float32))


def test_header_states_layout_units_and_lossless_compression(tmp_path: Path) -> None:
    write_exr(picture(), tmp_path / "a.exr", scene="still_life")
    _, header, pixels = layout_of(tmp_path / "a.exr")
    assert header["spectralLayoutVersion"] == "1.0"
    assert header["emissiveUnits"] == "W.m^-2.sr^-1"
    assert header["rodconeUnits"] == "W.m^-2.sr^-1.nm^-1"
    assert header["rodconeScene"] == "still_life"
    assert header["compression"] == OpenEXR.PIZ_COMPRESSION
    assert {values.dtype for values in pixels.values()} == {np.dtype(np.float32)}


def test_preview_is_linear_srgb_over_the_luminance_that_the_header_states(tmp_path: Path) -> None:
    """Equal energy has x = y = 1/3: linear sRGB (1.2048, 0.9484, 0.9087) at Y = 1, by IEC 61966-2-1's matrix."""
    nm = 380.5 + np.arange(400)
    write_exr(SpectralRadiance(np.full((4, 5, 400), 0.002), nm), tmp_path / "a.exr")
    _, header, pixels = layout_of(tmp_path / "a.exr")
    # 683 lm/W times the integral of V, 106.857 nm (CIE 018:2019), times radiance; shown at 90 % of white.
    assert header["whiteLuminance"] == pytest.approx(683.0 * 106.857 * 0.002 / 0.9, rel=1e-4)
    rgb = [pixels[name][2, 3] for name in "RGB"]
    assert rgb == pytest.approx([0.9 * 1.2048, 0.9 * 0.9484, 0.9 * 0.9087], rel=1e-3)


@loop(
    ("values", "nm", "told"),
    [
        (np.full((1, 1, 1), 1e39), [500.0], "float32"),
        (np.ones((1, 1, 1)), [10_000.0], "9999"),
        (np.ones((1, 1, 2)), [500.0, 500.0 + 1e-8], "centres"),
    ],
)
def test_what_the_layout_cannot_hold_is_refused_and_nothing_is_written(
    tmp_path: Path, values: np.ndarray, nm: list[float], told: str
) -> None:
    radiance = SpectralRadiance(values, np.array(nm), width_nm=np.full(len(nm), 1e-8))
    refusal(write_exr, radiance, tmp_path / "a.exr", match=told)
    assert not list(tmp_path.iterdir())


def test_mitsuba_opens_it(tmp_path: Path) -> None:
    radiance = picture()
    write_exr(radiance, tmp_path / "a.exr")
    with at_least_two_threads():
        bitmap = mitsuba_module().Bitmap(str(tmp_path / "a.exr"))
    names = [field.name for field in bitmap.struct_()]
    pixels = np.array(bitmap)
    assert pixels.dtype == np.float32
    for band, nm in enumerate(radiance.wavelength_nm):
        assert np.array_equal(pixels[:, :, names.index(channel_name(nm))], radiance.values[:, :, band])


# Files of other programs.


@pytest.fixture
def samples() -> Path:
    """Files that colour-science ships, made by the layout's authors and by colour-science."""
    from outside_truth import colour_science

    folder = Path(colour_science().__file__).parent / "io" / "tests" / "resources"
    if not (folder / "D65.exr").is_file():
        pytest.skip("colour-science was installed without its test files")
    return folder


def test_the_authors_own_file_of_d65_is_read(samples: Path) -> None:
    """Relative D65 (100 at 560 nm) has the integral 10567 with V(lambda): CIE 15, k = 100/10567 for Y = 100."""
    read = read_exr(samples / "D65.exr")
    assert read.shape == (1, 1)
    assert read.values[0, 0, int(np.argmin(abs(read.wavelength_nm - 560)))] == pytest.approx(100.0, rel=1e-6)
    assert read.luminance()[0, 0] == pytest.approx(683 * 10567, rel=5e-4)


def test_reflectances_of_colour_science_are_those_of_the_colorchecker(samples: Path) -> None:
    path = samples / "Ohta1997.exr"
    assert is_reflectance(path)
    read = read_exr(path)
    assert read.shape[:2] == (4, 6)
    for patch, (_, curve) in zip(read.values.reshape(24, -1), color_checker_reflectances(), strict=True):
        assert patch == pytest.approx(np.interp(read.wavelength_nm, curve.wavelength_nm, curve.values), abs=2e-3)


def test_bispectral_reflectances_are_refused(samples: Path) -> None:
    refusal(read_exr, samples / "BiSpectral.exr", match="no wavelength in nm|radiance")


def test_reflectances_are_lit_by_any_light_as_those_of_a_cube(tmp_path: Path) -> None:
    nm = np.arange(400.0, 701.0, 20.0)
    path = write_by_hand(tmp_path / "a.exr", {f"T.{x:g}nm": plane(0.5) for x in nm}, emissiveUnits=None)
    np.save(tmp_path / "a.npy", np.full((3, 4, nm.size), 0.5))
    (tmp_path / "a.toml").write_text('holds = "reflectance"\nwavelength_nm = [400, 700]\n')
    for light in ("D65", "A"):
        lit, cube = load_radiance(path, light), load_radiance(tmp_path / "a.npy", light)
        assert lit.values == pytest.approx(cube.values, rel=1e-6)
        assert lit.luminance() == pytest.approx(np.full((3, 4), 50.0), rel=0.02)
    write_by_hand(path, {f"T.{x:g}nm": plane(50.0) for x in nm})
    refusal(load_radiance, path, match="100% of its reflectances exceed 1")


def test_channels_in_any_order_are_put_in_the_order_of_wavelength(tmp_path: Path) -> None:
    channels = {"S0.700nm": plane(7), "S0.600,0nm": plane(6), "S0.5e2nm": plane(5), "Z": plane(99)}
    path = write_by_hand(tmp_path / "a.exr", channels)
    read = read_exr(path)
    assert read.wavelength_nm.tolist() == [500.0, 600.0, 700.0]
    assert read.values[0, 0].tolist() == [5, 6, 7]
    assert read.widths_nm == pytest.approx([100.0] * 3)
    assert read.relative_mc_error == 0


@loop(("name", "nm"), [("S0.550nm", 550.0), ("S0.550,25nm", 550.25), ("S0.5,5E2nm", 550.0)])
def test_wavelength_of_a_channel_name(name: str, nm: float) -> None:
    assert list(spectral_channels([name])[1].values()) == [pytest.approx(nm, rel=1e-12)]


@loop("compression", ["NO", "RLE", "ZIPS", "ZIP", "PIZ", "PXR24", "DWAA"])
@loop("dtype", [np.float16, np.float32])
def test_half_and_float_are_read_in_every_compression(tmp_path: Path, compression: str, dtype: Any) -> None:
    channels = {f"S0.{400 + 10 * k}nm": plane(k / 4, (20, 18), dtype) for k in range(5)}
    kind = getattr(OpenEXR, f"{compression}_COMPRESSION")
    read = read_exr(write_by_hand(tmp_path / "a.exr", channels, compression=kind))
    assert read.values[11, 13] == pytest.approx(np.arange(5) / 4, abs=1e-3 if compression == "DWAA" else 0)


def test_tiled_files_and_windows_off_the_origin_are_read(tmp_path: Path) -> None:
    values = np.arange(600, dtype=np.float32).reshape(20, 30)
    corner, end = np.array([-7, 3], np.int32), np.array([22, 22], np.int32)
    path = write_by_hand(
        tmp_path / "a.exr",
        {"S0.500nm": values, "S0.510nm": values + 1},
        type=OpenEXR.tiledimage,
        tiles=OpenEXR.TileDescription(),
        dataWindow=(corner, end),
    )
    read = read_exr(path)
    assert read.shape == (20, 30)
    assert np.array_equal(read.values[:, :, 1], values + 1)


@loop(("tile", "read"), [((4096, 2048), True), ((4096, 2049), False), ((1, 1 << 23 | 1), False)])
def test_a_tile_far_larger_than_the_picture_is_refused(tmp_path: Path, tile: tuple[int, int], read: bool) -> None:
    path = write_by_hand(
        tmp_path / "a.exr",
        {"S0.500nm": plane(1), "S0.510nm": plane(1)},
        type=OpenEXR.tiledimage,
        tiles=OpenEXR.TileDescription(),
    )
    content = path.read_bytes()
    name = content.index(b"tiles\0tiledesc\0") + len(b"tiles\0tiledesc\0") + 4
    path.write_bytes(content[:name] + np.array(tile, "<u4").tobytes() + content[name + 8 :])
    with nullcontext() if read else pytest.raises(InputError, match=f"its tiles have {tile[0]} x {tile[1]} pixels"):
        read_exr(path)


def test_attributes_that_change_nothing_are_let_through(tmp_path: Path) -> None:
    stated = {"EV": 2.0, "spectralLayoutVersion": "1.0", "polarisationHandedness": "left", "owner": "me", "mine": "1"}
    channels = {f"S0.{nm}nm": plane(nm) for nm in (500, 510)}
    assert read_exr(write_by_hand(tmp_path / "a.exr", channels, **stated)).values[0, 0].tolist() == [500, 510]


def test_stokes_vector_is_read_as_its_radiance(tmp_path: Path) -> None:
    channels = {f"S{s}.{nm}nm": plane(s + nm) for s in range(4) for nm in (500, 510)}
    assert read_exr(write_by_hand(tmp_path / "a.exr", channels)).values[0, 0].tolist() == [500, 510]


def test_uneven_wavelengths_get_edges_half_way_and_say_so(tmp_path: Path) -> None:
    path = write_by_hand(tmp_path / "a.exr", {f"S0.{nm}nm": plane(1) for nm in (400, 410, 430, 470)})
    with pytest.warns(UserWarning, match="half-way"):
        read = read_exr(path)
    assert read.widths_nm.tolist() == [10, 15, 30, 40]
    assert read.wavelength_nm.tolist() == [400, 412.5, 435, 470]  # bands meet at 405, 420 and 450 nm


def test_missing_units_are_assumed_and_told(tmp_path: Path) -> None:
    path = write_by_hand(tmp_path / "a.exr", {f"S0.{nm}nm": plane(1) for nm in (400, 410)}, emissiveUnits=None)
    with pytest.warns(UserWarning, match="emissiveUnits"):
        read_exr(path)


@loop("bands", ["400.0:10.0", "400.0:10.0;410.0:-1", "400:10;411:10", "nonsense", ""])
def test_band_attribute_that_does_not_fit_is_left_aside_and_told(tmp_path: Path, bands: str) -> None:
    channels = {channel_name(nm): plane(1) for nm in (400, 410)}
    path = write_by_hand(tmp_path / "a.exr", channels, rodconeBands_nm=bands)
    with pytest.warns(UserWarning, match="rodconeBands_nm"):
        read = read_exr(path)
    assert read.widths_nm.tolist() == [10, 10]


def test_one_band_of_unknown_width_is_refused(tmp_path: Path) -> None:
    refusal(read_exr, write_by_hand(tmp_path / "a.exr", {"S0.550nm": plane(1)}), match="rodconeBands_nm")
    assert read_bands({channel_name(550): 550.0}, {"rodconeBands_nm": "550.0:25.0"})[1].tolist() == [25]


@loop(
    ("channels", "attributes", "told"),
    [
        ({"S0.500nm": 1, "S0.510nm": 1, "T.500nm": 1}, {}, "radiance (S0 channels) and reflectance (T)"),
        ({"S0.500nm": 1, "S0.510nm": 1}, {"pixelAspectRatio": 2.0}, "pixelAspectRatio: 2 is not allowed"),
        ({"S0.500nm": 1, "S0.510nm": 1}, {"multiView": "left,right"}, "multiView: 'left,right' changes values"),
        ({"S0.500nm": 1, "S0.510nm": 1}, {"spectralLayoutVersion": "2.0"}, "spectralLayoutVersion: '2.0' changes"),
        (
            {"S0.500nm": 1, "S0.510nm": 1},
            {"emissiveUnit": "lm"},
            "'emissiveUnit' is unknown; did you mean 'emissiveUnits'",
        ),
        ({"R": 1, "G": 1, "B": 1}, {}, "channels B, G, R;"),
        ({"S1.500nm": 1}, {}, "channels S1.500nm;"),
        ({"beauty.S0.500nm": 1}, {}, "beauty"),
        ({"S0.500nm": 1, "S0.5e2nm": 1}, {}, "one wavelength"),
        ({"S0.nm": 1, "S0.500nm": 1}, {}, "no wavelength"),
        ({"S0.600THz": 1, "S0.500nm": 1}, {}, "no wavelength in nm"),
        ({"S0.1e999nm": 1, "S0.500nm": 1}, {}, "no wavelength"),
        ({"S0.500nm": 1, "S0.510nm": 1}, {"emissiveUnits": "cd.m^-2"}, "cd.m"),
        ({"S0.500nm": 1, "S0.510nm": 1}, {"rodconeUnits": "lux"}, "lux"),
        ({"S0.500nm": 1, "S0.510nm": -1}, {}, "-1.0 at row 0, column 0, band 1"),
        ({"S0.500nm": np.nan, "S0.510nm": 1}, {}, "nan at row 0"),
        ({"S0.500nm": 1, "S0.510nm": 1}, {"rodconeRelativeMcError": "-1"}, "relative_mc_error"),
    ],
)
def test_what_is_no_radiance_is_refused_in_one_line(
    tmp_path: Path, channels: dict[str, float], attributes: dict[str, Any], told: str
) -> None:
    path = write_by_hand(tmp_path / "a.exr", {name: plane(value) for name, value in channels.items()}, **attributes)
    message = refusal(read_exr, path)
    assert told in message
    assert message.startswith(f"{path}: ")
    assert message.count(str(path)) == 1


@loop("content", [b"", b"\x89PNG\r\n\x1a\n", b"\x76\x2f\x31\x01", b"\x76\x2f\x31\x01" + bytes(100)])
def test_what_is_no_openexr_file_is_refused(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "a.exr").write_bytes(content)
    refusal(read_exr, tmp_path / "a.exr", match="no OpenEXR file" if content[:1] != b"\x76" else "can't read it")
    for name in ("missing.exr", "."):
        refusal(read_exr, tmp_path / name, match="no such file")


def test_subsampled_channels_are_refused(tmp_path: Path) -> None:
    path = write_by_hand(tmp_path / "a.exr", {name: plane(1, (8, 8)) for name in ("BY", "S0.500nm", "S0.510nm")})
    content = path.read_bytes()
    at = content.index(b"BY\0") + 3 + 8  # past name, type and flags
    path.write_bytes(content[:at] + np.array([2, 2], "<i4").tobytes() + content[at + 8 :])
    refusal(read_exr, path, match="has subsampled channels")


def test_deep_data_is_refused(tmp_path: Path) -> None:
    deep = np.empty((2, 2), dtype=object)
    for place in np.ndindex(2, 2):
        deep[place] = np.ones(1, np.float32)
    kind = {"type": OpenEXR.deepscanline, "compression": OpenEXR.ZIPS_COMPRESSION}
    path = write_by_hand(tmp_path / "a.exr", {"S0.500nm": deep, "S0.510nm": deep}, **kind)
    refusal(read_exr, path, match="holds deep data")


# Hostile files.


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, bytes]:
    path = tmp_path_factory.mktemp("hostile") / "a.exr"
    write_exr(SpectralRadiance(np.random.default_rng(3).random((9, 40, 4)), 400.0 + 10 * np.arange(4)), path)
    return path, path.read_bytes()


def with_window(content: bytes, right: int, bottom: int) -> bytes:
    """The same file that declares another size."""
    for name in (b"dataWindow\0box2i\0", b"displayWindow\0box2i\0"):
        at = content.index(name) + len(name) + 4 + 8
        content = content[:at] + np.array([right, bottom], "<i4").tobytes() + content[at + 8 :]
    return content


@loop(
    ("right", "bottom", "told"),
    [(32768, 8, "32769 pixels"), (39, 1 << 20, "1048577 x 40"), (32767, 32767, "bytes"), (1999, 1999, "can't hold")],
)
def test_declared_size_is_bounded_before_memory_is_taken(
    whole: tuple[Path, bytes], right: int, bottom: int, told: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    path, content = whole
    path.write_bytes(with_window(content, right, bottom))

    def no_memory(*_: Any, **__: Any) -> None:
        raise AssertionError("memory was taken")

    monkeypatch.setattr(np, "empty", no_memory)
    message = refusal(read_exr, path, match=told)
    assert message.startswith(f"{path}: ")
    assert message.count(str(path)) == 1


def test_widths_of_wavelengths_that_do_not_increase_are_refused() -> None:
    for nm in ([500.0], [510.0, 500.0], [500.0, np.nan], [np.inf, np.inf]):
        refusal(bands_between, np.array(nm), match="wavelength_nm")


def test_extent_is_allowed_up_to_its_limits() -> None:
    least_bytes = MOST_BYTES / MOST_EXPANSION
    require_extent(MOST_SIDE, MOST_SIDE, 2, least_bytes)
    refusal(require_extent, MOST_SIDE, MOST_SIDE, 2, least_bytes - 1, match="bytes can't hold")
    for height, width, channels in ((MOST_SIDE, MOST_SIDE, 3), (MOST_SIDE + 1, 1, 1), (0, 1, 1), (1, -1, 1)):
        refusal(require_extent, height, width, channels, match=f"{height} x {width} pixels")


@loop(("count", "read"), [(4096, True), (4097, False)])
def test_channels_are_read_up_to_a_number_that_takes_no_time(count: int, read: bool, tmp_path: Path) -> None:
    """OpenEXR takes 0.6 s for the header of 16 000 channels and 2.8 s for that of 30 000, longer for their pixels."""
    header = {"compression": OpenEXR.NO_COMPRESSION, "type": OpenEXR.scanlineimage, "emissiveUnits": "W.m^-2.sr^-1"}
    channels = {channel_name(400.0 + 0.1 * number): np.ones((1, 1), np.float32) for number in range(count)}
    OpenEXR.File(header, channels).write(str(tmp_path / "a.exr"))
    if read:
        assert read_exr(tmp_path / "a.exr").values.shape == (1, 1, count)
    else:
        refusal(read_exr, tmp_path / "a.exr", match="4097 channels are not allowed")
