"""`rodcone capture` and `rodcone develop`: files, exit codes, and grey walls whose picture is known on paper."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import tifffile
from builders import any_order, mosaic_of, raw_image
from command_line import call, check_refusals
from file_samples import CAMERA_BLACK, CAMERA_WHITE, other_camera, over_black, same
from PIL import Image
from scipy.io import savemat

from render.illuminants import illuminant
from render.radiance import SpectralRadiance
from render.radiance_files.exr import read_exr, write_exr
from render.spectrum import DEFAULT_WAVELENGTH_NM, band_widths, luminance, photons_per_joule
from rodcone.colour_spaces import decode_srgb, encode_srgb
from sensor.cfa import BAYER, RGBW, mask
from sensor.optics import form_image, left_out
from sensor.presets import preset
from sensor.raw import RawImage
from sensor.raw_files.raw_file import read_raw, write_raw
from sensor.response import expected_electrons
from studies.photograph import shot
from studies.photograph.camera import calibrate, capture, iso_speed
from studies.photograph.shot import Order, take
from studies.study.lit_scene import open_choice, white_spectrum
from studies.study.study import OWN, SceneChoice, Study

NM = DEFAULT_WAVELENGTH_NM
WIDTH = band_widths(NM)
SHAPE = (48, 64)
NEUTRAL = any_order(2 * 100)  # quotients of sums over less than 100 bands


def wall(light: str = "D65") -> SpectralRadiance:
    """A grey wall of 25 cd/m^2."""
    spectrum = illuminant(light).band_average(NM, WIDTH)
    spectrum *= 25.0 / luminance(spectrum, NM, WIDTH)
    return SpectralRadiance(np.broadcast_to(spectrum, (*SHAPE, NM.size)).astype(np.float32), NM, 0.0, WIDTH)


@pytest.fixture
def exr(tmp_path: Path) -> Path:
    path = tmp_path / "wall.exr"
    write_exr(wall(), path)
    return path


def test_a_scene_becomes_two_negatives_whose_paths_alone_are_printed(tmp_path: Path) -> None:
    arguments = ["capture", "flat_field", "--size", "32", "--spp", "4", "--level", "25cd/m2", "--exposure", "10ms"]
    out = tmp_path / "new" / "shot.dng"
    code, printed, _ = call([*arguments, "--sensor", "low_noise", "--cfa", "rgbw", "-o", str(out)])
    beside = out.with_name("shot_bayer.dng")
    assert (code, printed) == (0, f"{out}\n{beside}\n")
    assert sorted(out.parent.iterdir()) == [out, beside]
    raw, bayer = read_raw(out), read_raw(beside)
    assert (raw.cfa, bayer.cfa, raw.shape, bayer.shape) == (RGBW, BAYER, (32, 32), (32, 32))
    assert (raw.exposure_s, raw.camera, raw.f_number) == (0.01, "low_noise", 2.8)
    kept = mask(RGBW, "R", (32, 32)) | mask(RGBW, "G", (32, 32))
    np.testing.assert_array_equal(raw.dn[kept], bayer.dn[kept])


def test_the_slanted_edge_is_rendered_with_the_samples_that_its_lens_asks_for(tmp_path: Path, monkeypatch) -> None:
    """Two along each side of a pixel at f/2.8 and 2.2 um; a scene that measures no sharpness takes one."""
    sizes = []
    rendered = shot.render
    monkeypatch.setattr(shot, "render", lambda scene, size, **more: sizes.append(size) or rendered(scene, size, **more))
    for scene in ("slanted_edge", "flat_field"):
        out = str(tmp_path / f"{scene}.dng")
        assert call(["capture", scene, "--size", "24", "--spp", "2", "--cfa", "bayer", "-o", out])[0] == 0
        assert read_raw(Path(out)).shape == (24, 24)
    assert sizes == [(48, 48), (24, 24)]


@pytest.mark.parametrize(
    ("scene", "level", "told"),
    [
        ("cornell_box", "100cd/m2", "rodcone: the render's noise has "),
        ("cornell_box", "0.001cd/m2", ""),
        ("flat_field", "100cd/m2", ""),
    ],
)
def test_a_render_with_more_noise_than_the_sensor_is_told(scene: str, level: str, told: str, tmp_path: Path) -> None:
    arguments = ["capture", scene, "--size", "24", "--spp", "4", "--cfa", "bayer", "--level", level]
    code, _, err = call([*arguments, "-o", str(tmp_path / "shot.dng")])
    lines = [line for line in err.splitlines() if "lamps in view" not in line]
    assert (code, len(lines)) == (0, bool(told))
    assert "".join(lines).startswith(told)


@pytest.mark.parametrize(
    ("more", "name", "written"),
    [
        (["--cfa", "bayer_grbg"], "shot.dng", ["shot.dng"]),
        (["--cfa", "rgbw"], "shot.tif", ["shot.json", "shot.tif"]),
        (["--cfa", "rgbw_4x4"], "shot.tiff", ["shot.json", "shot.tiff"]),
    ],
)
def test_a_stored_radiance_becomes_what_its_name_says(more, name, written, exr, tmp_path):
    out = tmp_path / "o" / name
    code, printed, err = call(["capture", str(exr), "-o", str(out), "--exposure", "20ms", *more])
    assert (code, sorted(path.name for path in out.parent.iterdir())) == (0, written)
    assert sorted(printed.split()) == [str(out.parent / file) for file in written]
    assert err.startswith("rodcone: wall.exr: its light is taken to be smooth within bands")
    assert err.endswith("; its colours are judged under D65; give another light where that isn't so\n")
    assert read_raw(out).shape == SHAPE


def test_the_signal_is_that_of_the_level_and_exposure_asked_for(exr: Path, tmp_path: Path) -> None:
    sensor = preset("low_noise", "bayer")
    out = str(tmp_path / "shot.dng")
    for level, exposure_s, factor in ((None, 0.02, 1.0), ("50cd/m2", 0.02, 2.0), ("50cd/m2", 0.005, 0.5)):
        more = [] if level is None else ["--level", level]
        arguments = ["capture", str(exr), "--cfa", "bayer", "--exposure", f"{exposure_s}s", "-o", out, "--json", *more]
        code, printed, _ = call(arguments)
        facts = json.loads(printed)
        assert (code, facts["paths"], facts["exposure_s"]) == (0, [out], exposure_s)
        assert facts["left_out"] == list(left_out(sensor))
        assert facts["luminance_cd_m2"] == pytest.approx(25.0 if level is None else 50.0, rel=1e-6)
        expected = expected_electrons(form_image(wall(), sensor), sensor, 0.02) * factor
        # mean over 3072 pixels: shot noise, PRNU and the dark; five standard errors
        sigma = np.sqrt((expected + (0.01 * expected) ** 2 + 4).mean() / expected.size)
        assert abs((read_raw(out).electrons - expected).mean()) < 5 * sigma


def test_a_level_without_the_lamps_in_view_is_said_beside_the_mean_of_the_picture(tmp_path: Path) -> None:
    for scene, lamps_in_view in (("cornell_box", True), ("flat_field", False)):
        arguments = ["capture", scene, "--size", "24", "--spp", "4", "--level", "100cd/m2", "--json"]
        code, printed, err = call([*arguments, "-o", str(tmp_path / "shot.dng")])
        mean_cd_m2 = json.loads(printed)["luminance_cd_m2"]
        words = (
            f"100cd/m2 is the mean of what is no lamp; with the lamps in view the picture's is {mean_cd_m2:.3g} cd/m2"
        )
        assert (code, words in err, mean_cd_m2 > 200) == (0, lamps_in_view, lamps_in_view)


def test_a_frame_more_than_half_saturated_is_told(tmp_path: Path) -> None:
    lit, shot = tmp_path / "lit.exr", tmp_path / "shot.dng"
    for columns, told in ((31, False), (33, True)):
        values = wall().values.copy()
        values[:, :columns] *= 1e4
        write_exr(SpectralRadiance(values, NM, 0.0, WIDTH), lit)
        # its lens draws a sharp edge
        code, _, err = call(["capture", lit, "-o", shot, "--exposure", "10ms", "--sensor", "table1_output"])
        words = f"rodcone: {columns / 64:.0%} of the pixels are saturated at 0.01 s; shorten or omit --exposure\n"
        assert (code, words in err, "saturated" in err) == (0, told, told)
        assert "dark noise" not in err


@pytest.mark.filterwarnings("default:exposure_s")
def test_a_frame_that_shows_dark_noise_alone_is_told(exr: Path, tmp_path: Path) -> None:
    code, _, err = call(["capture", exr, "-o", tmp_path / "shot.dng", "--exposure", "1us"])
    assert (code, err.count("of the pixels read no more than dark noise (1.8 e-) at 1e-06 s; give a longer")) == (0, 1)


def cut(path: Path, first_nm: float, last_nm: float) -> Path:
    """A wall of whose bands those between two wavelengths alone are kept."""
    kept = (first_nm < NM) & (last_nm > NM)
    write_exr(SpectralRadiance(wall().values[..., kept], NM[kept], 0.0, WIDTH[kept]), path)
    return path


@pytest.mark.filterwarnings("default:radiance")
def test_a_cube_that_ends_inside_the_window_is_photographed_with_a_warning(tmp_path: Path) -> None:
    out = tmp_path / "shot.dng"
    code, printed, err = call(["capture", str(cut(tmp_path / "cut.exr", 380, 650)), "-o", str(out)])
    assert (code, printed.split()[0], err.count("radiance: its bands, 380 to 650 nm, don't fill")) == (0, str(out), 1)
    assert "they leave out 5.6% of R, 0.0% of G, 0.0% of B, 41.3% of W; give those bands, or narrow" in err


def test_an_isetcam_scene_is_judged_under_the_illuminant_that_it_holds(tmp_path: Path) -> None:
    lamp, nm = illuminant("A"), np.arange(390.0, 711.0, 10.0)
    photons = lamp.band_average(nm, 0 * nm + 10) * photons_per_joule(nm)
    held = {"data": {"photons": photons}, "spectrum": {"wave": nm}}
    path, out = tmp_path / "grey.mat", tmp_path / "shot.dng"
    savemat(path, {"photons": np.tile(photons, (32, 32, 1)), "wave": nm, "illuminant": held})
    code, _, err = call(["capture", path, "--cfa", "bayer", "-o", out])
    assert (code, "judged under the illuminant that it holds" in err, "D65" in err) == (0, True, False)
    colour = read_raw(out).colour
    assert colour is not None
    assert colour.neutral == pytest.approx(calibrate(preset("low_noise", "bayer"), lamp).neutral, rel=0.01)
    study = Study(scenes=(SceneChoice(str(path)),), sensors=("low_noise",), levels=("5cd/m2",))
    white = white_spectrum(open_choice(study.scenes[0], study), OWN)
    inner = nm[1:-1], np.full(nm.size - 2, 10.0)  # outside its samples the illuminant is 0
    assert white.band_average(*inner) == pytest.approx(lamp.band_average(*inner), rel=0.02)
    code, _, err = call(["capture", path, "--cfa", "bayer", "-o", out, "--light", "D65"])
    assert (code, "grey.mat: lit by D65 in place of the illuminant that it holds" in err) == (0, True)
    photo, sensor = read_raw(out), preset("low_noise", "bayer")
    means = {c: photo.electrons[mask(photo.cfa, c, photo.shape)].mean() for c in "RGB"}
    ratio = calibrate(sensor, illuminant("D65")).neutral
    # the file's bands end at 385 and 715 nm, the calibration's at 380 and 780; under A red would be twice as much
    assert means["R"] / means["G"] == pytest.approx(ratio[0] / ratio[1], rel=0.03)
    assert means["B"] / means["G"] == pytest.approx(ratio[2] / ratio[1], rel=0.03)


def test_the_file_carries_the_calibration_for_the_light_or_the_white_balance_asked_for(exr, tmp_path):
    sensor = preset("low_noise", "bayer")
    for more, light in (([], "D65"), (["--white-balance", "A"], "A"), (["--light", "A"], "A")):
        code, _, err = call(["capture", exr, "--cfa", "bayer", "-o", tmp_path / "shot.dng", *more])
        assert (code, "judged under D65" in err) == (0, not more)
        raw = read_raw(tmp_path / "shot.dng")
        assert raw.colour is not None
        assert raw.colour.neutral == pytest.approx(calibrate(sensor, illuminant(light)).neutral, rel=NEUTRAL)
        assert raw.iso == iso_speed(sensor)


REFUSED = (
    ("color_cheker", "scene: 'color_cheker' ... did you mean 'color_checker'"),
    ("flat_field --sensor lownoise", "sensor preset ... did you mean 'low_noise'"),
    ("flat_field --cfa RGGB", "cfa: 'RGGB' is unknown ... write 'bayer_rggb'"),
    ("flat_field --cfa rccc", "can't hold the mosaic ... shot.tif"),
    ("shot.dng", "'shot.dng' is a raw file, for rodcone develop ... .xml, .exr, .mat"),
    ("mine.toml", "'mine.toml' is a study or a sensor ... rodcone sweep or --sensor"),
    ("none.xml", "'none.xml' is missing"),
    ("missing.exr", "missing.exr"),
    ("flat_field --trust-scene", "trust-scene: True for 'flat_field' ... with an .xml scene"),
    ("scene.exr --trust-scene", "trust-scene: True for 'scene.exr', a stored picture"),
    ("scene.exr --extend hold", "extend: 'hold' for 'scene.exr', a stored picture ... leave it out"),
    ("flat_field --extend zero", "extend: 'zero' is unknown; allowed: hold"),
    ("flat_field -o o/shot.cr2", "another ending ... .dng, .tif, .tiff"),
    ("flat_field --level 5", "level: '5' has no unit ... write 5lux"),
    ("wall.exr --level 5lux", "needs a reference plane"),
    ("flat_field --exposure auto:V", "exposure: 'auto:V' is not a time ... did you mean 'auto:W'"),
    ("flat_field --exposure auto:W --cfa bayer", "looks at W ... give auto, or a time such as 20ms"),
    ("flat_field --exposure 1/0", "exposure: '1/0' is not a time ... or 1/50"),
    ("flat_field --exposure 9e9s", "exposure: 9000000000.0 is outside 0 to 1e+06"),
    ("flat_field --light 5000", "'5000' has no unit ... write 5000K"),
    ("flat_field --light lamp=A", "light group: 'lamp' ... sky"),
    ("flat_field --light sky=", "light: 'sky=' ... such as sky=A"),
    ("flat_field --light =A", "light: '=A' ... such as sky=A"),
    ("scene.exr --light lamp=A", "'lamp=A' for a picture ... give one"),
    ("scene.exr --light A --light D65", "'A D65' for a picture ... give one"),
    ("flat_field --white-balance gray-world", "'gray-world' is found in a picture ... give it to develop"),
    ("flat_field --white-balance D66", "illuminant: 'D66' ... D65"),
    ("flat_field --height 0", "height: 0 ... give pixels"),
    ("flat_field --width 1 --height 4", "doesn't fit the tile"),
    ("flat_field --size 8 --width 4", "width: 4 beside --size ... leave it out"),
    ("scene.exr --size 8", "size: 8 for 'scene.exr', a stored picture ... leave it out"),
    ("scene.exr --width 8", "width: 8 for 'scene.exr', a stored picture ... leave it out"),
    ("scene.exr --spp 64", "spp: 64 for 'scene.exr', a stored picture ... leave it out"),
    ("flat_field --size 0", "size: 0"),
    ("flat_field --spp 0", "spp: 0"),
    ("flat_field --seed -1", "seed: -1"),
    ("flat_field --frames 0", "frames: 0"),
    ("flat_field --frames 65", "frames: 65"),
)


def test_bad_input_is_refused_and_leaves_no_file(exr: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    check_refusals("capture", REFUSED, tmp_path)
    bad_place = [("flat_field -o wall.exr/shot.dng", "choose another place with --out")]
    check_refusals("capture", bad_place, tmp_path, code=1)


SCENE = """<scene version="3.0.0">
<sensor type="perspective"><float name="fov" value="20"/>
  <transform name="to_world"><lookat origin="0,0,4" target="0,0,0" up="0,1,0"/></transform>
  <film type="hdrfilm"><integer name="width" value="32"/><integer name="height" value="24"/></film></sensor>
<shape type="rectangle" id="wall"><bsdf type="diffuse"><spectrum name="reflectance" value="0.5"/></bsdf></shape>
<emitter type="directional" id="sun"><vector name="direction" x="0" y="0" z="-1"/>{}</emitter>
</scene>"""


def test_a_users_scene_is_photographed_as_large_as_its_film_says(tmp_path: Path) -> None:
    scene, out = tmp_path / "room.xml", tmp_path / "shot.dng"
    scene.write_text(SCENE.format('<spectrum name="irradiance" value="2"/>'))
    arguments = ["capture", str(scene), "-o", str(out), "--cfa", "bayer", "--spp", "1"]
    for more, shape in (([], (24, 32)), (["--size", "16"], (12, 16))):
        code, printed, err = call([*arguments, "--level", "25cd/m2", *more])
        assert (code, printed, err, read_raw(out).shape) == (0, f"{out}\n", "", shape)
    code, _, err = call([*arguments, "--level", "25lux"])
    assert (code, err.count("\n")) == (2, 1)
    assert "needs a reference plane, which scene room doesn't state" in err


def test_light_with_colours_of_its_own_leaves_the_balance_at_daylight_and_says_so(tmp_path: Path) -> None:
    scene, out = tmp_path / "room.xml", tmp_path / "shot.dng"
    two = '<spectrum name="irradiance" value="2"/></emitter><emitter type="directional" id="sun:b">'
    scene.write_text(SCENE.format(two + '<spectrum name="irradiance" value="380:1, 780:2"/>'))
    arguments = ["capture", str(scene), "-o", str(out), "--cfa", "bayer", "--spp", "1", "--level", "25cd/m2"]
    code, _, err = call(arguments)
    assert code == 0
    assert "light group 'sun' has colours of its own; white balance is set to D65, --white-balance sets it" in err
    colour = read_raw(out).colour
    assert colour is not None
    expected = calibrate(preset("low_noise", "bayer"), illuminant("D65")).neutral
    assert colour.neutral == pytest.approx(expected, rel=NEUTRAL)


@pytest.mark.thorough
def test_a_time_with_a_unit_is_the_time_in_seconds(exr: Path, tmp_path: Path) -> None:
    frames = []
    for given in (["--exposure", "20ms"], ["--exposure", "20", "ms"], ["--exposure", "1/50"]):
        code, _, err = call(["capture", str(exr), "-o", str(tmp_path / "shot.dng"), *given])
        assert code == 0
        assert "raw converters" not in err
        frames.append(read_raw(tmp_path / "shot.dng"))
    assert same(frames[0], frames[1])
    assert same(frames[0], frames[2])


@pytest.mark.thorough
def test_another_lamp_gives_its_own_colours_and_white_balance_another_neutral(tmp_path: Path) -> None:
    out, sensor = tmp_path / "shot.dng", preset("low_noise", "bayer")
    arguments = ["capture", "flat_field", "--spp", "4", "--size", "32", "--cfa", "bayer", "--level", "25cd/m2"]
    for more, lit, neutral in (
        ([], "D65", "D65"),
        (["--light", "A"], "A", "A"),
        (["--light", "sky=A"], "A", "A"),
        (["--light", "A", "--white-balance", "D65"], "A", "D65"),
        (["--light", "A", "--white-balance", "as-shot"], "A", "A"),
    ):
        code, printed, _ = call([*arguments, "--exposure", "10ms", "-o", str(out), "--json", *more])
        assert (code, json.loads(printed)["luminance_cd_m2"]) == (0, pytest.approx(25.0, rel=1e-6))
        raw = read_raw(out)
        assert raw.colour is not None
        assert raw.colour.neutral == pytest.approx(calibrate(sensor, illuminant(neutral)).neutral, rel=NEUTRAL)
        signal = [raw.electrons[mask(raw.cfa, channel, raw.shape)].mean() for channel in "RGB"]
        expected = calibrate(sensor, illuminant(lit)).neutral
        # 256 pixels of R and of B with over 500 e- each: 5 standard errors of the ratio to G
        assert np.array(signal) / signal[1] == pytest.approx(expected, rel=5 * np.sqrt(2 / (256 * 500)) + 1e-3)


def test_a_lamps_lines_reach_the_sensor_as_lines(tmp_path: Path) -> None:
    arguments = ["capture", "flat_field", "--spp", "4", "--size", "64", "--level", "10lux", "--light", "sodium_low"]
    assert call([*arguments, "--exposure", "200ms", "-o", tmp_path / "a.tif"])[0] == 0
    raw, curves = read_raw(tmp_path / "a.tif"), preset("low_noise").responses.curves
    signal = {channel: raw.electrons[mask(raw.cfa, channel, raw.shape)].mean() for channel in "RGW"}
    at = {channel: np.interp(589.2, curve.wavelength_nm, curve.values) for channel, curve in curves.items()}
    for channel in "RG":  # 1024 pixels of over 180 e-
        assert signal[channel] / signal["W"] == pytest.approx(at[channel] / at["W"], rel=0.02)


def negative(path: Path, cfa: str = "bayer", share: float = 0.25, light: str = "D65") -> RawImage:
    """Noise-free exposure of the grey wall, written to `path`: green at `share` of the well."""
    sensor = preset("low_noise", cfa)
    expected = expected_electrons(form_image(wall(light=light), sensor), sensor, 0.02)
    expected *= share * sensor.pixel.full_well_e / expected[mask(sensor.cfa, "G", SHAPE)].mean()
    raw = raw_image(
        np.rint(np.minimum(expected, 15_000) / sensor.gain_e_per_dn + sensor.black_dn),
        sensor.cfa,
        black_dn=sensor.black_dn,
        white_dn=sensor.white_dn,
        gain_e_per_dn=sensor.gain_e_per_dn,
        read_noise_e=1.5,
        prnu=0.01,
        exposure_s=0.02,
        colour=calibrate(sensor, illuminant(light)),
    )
    write_raw(raw, path)
    return raw


# These give an even mosaic back to rounding, in the colours of the plain matrix.
PAPERS_PAIR = {"bayer": "bayer", "rgbw": "interleaved_paper"}


@pytest.mark.parametrize(("cfa", "share"), [("bayer", 0.25), ("rgbw", 0.18)])
@pytest.mark.parametrize("ev", [0.0, 1.0, -3.0])
def test_a_grey_wall_at_a_share_of_the_well_is_shown_at_that_share(cfa, share, ev, tmp_path):
    negative(tmp_path / "shot.dng", cfa, share)
    code, out, _ = call(["develop", str(tmp_path / "shot.dng"), "--isp", PAPERS_PAIR[cfa], "--ev", str(ev)])
    assert (code, out) == (0, f"{tmp_path / 'shot.png'}\n")
    with Image.open(tmp_path / "shot.png") as picture:
        pixels = np.asarray(picture)
    assert pixels.shape == (*SHAPE, 3)
    # half a level of 8 bits, and the raw data's rounding: 0.5 DN of 2000 and more
    assert np.abs(pixels - 255 * encode_srgb(np.array(share * 2.0**ev))).max() <= 0.6


def test_the_default_brightness_puts_the_99th_percentile_at_nine_tenths(tmp_path: Path) -> None:
    negative(tmp_path / "shot.dng", share=0.01)
    arguments = ["develop", str(tmp_path / "shot.dng"), "-o", str(tmp_path / "p" / "o.png"), "--json"]
    code, out, _ = call(arguments)
    facts = json.loads(out)
    assert (code, facts["path"], facts["isp"]) == (0, str(tmp_path / "p" / "o.png"), "ple")
    assert facts["ev"] == pytest.approx(np.log2(0.9 / 0.01), abs=0.01)
    with Image.open(tmp_path / "p" / "o.png") as picture:
        assert np.abs(np.asarray(picture) - 255 * encode_srgb(np.array(0.9))).max() <= 1.0


@pytest.mark.parametrize("cfa", ["bayer", "rgbw"])
def test_as_shot_balance_keeps_the_light_s_colour_that_gray_world_takes_away(cfa: str, tmp_path: Path) -> None:
    raw = negative(tmp_path / "shot.dng", cfa, 0.1, light="A")
    colour = calibrate(preset("low_noise", cfa), illuminant("D65"))
    write_raw(replace(raw, colour=colour), tmp_path / "shot.dng")  # balanced for daylight, taken under a lamp
    signal = np.array([raw.electrons[mask(raw.cfa, channel, SHAPE)].mean() for channel in "RGB"])
    orange = colour.to_srgb @ (signal / colour.neutral[:3] / raw.full_well_e)
    grey = np.full(3, 0.1)
    by_default = [([], "given", orange)] if cfa == "bayer" else []  # the paper's own camera has Gray World
    for balance, source, expected in (
        *by_default,
        (["--white-balance", "as-shot"], "given", orange),
        (["--white-balance", "gray-world"], "gray world", grey),
        (["--white-balance", "A"], "given", grey),
        (["--white-balance", "2856 K"], "given", grey),
    ):
        out = tmp_path / "shot.png"
        arguments = ["develop", str(tmp_path / "shot.dng"), "--isp", PAPERS_PAIR[cfa], "--ev", "1", *balance]
        code, printed, _ = call([*arguments, "-o", str(out), "--json"])
        assert (code, set(json.loads(printed)["balance"].values())) == (0, {source})
        with Image.open(out) as picture:
            pixels = np.asarray(picture)
        # half a level of 8 bits, and the raw data's rounding: half a DN of 340 in B, 0.15 % of linear light
        assert np.abs(pixels - 255 * encode_srgb(2 * expected)).max() <= 0.7
    assert orange[0] > 2 * orange[2]  # R over B of illuminant A seen by daylight


@pytest.mark.parametrize("processor", ["interleaved", "ple"])
def test_without_a_word_the_balance_is_as_shot(processor: str, tmp_path: Path) -> None:
    raw = negative(tmp_path / "shot.dng", "rgbw", 0.1, light="A")
    colour = calibrate(preset("low_noise", "rgbw"), illuminant("D65"))
    write_raw(replace(raw, colour=colour), tmp_path / "shot.dng")
    pictures = []
    for balance in ([], ["--white-balance", "as-shot"]):
        out = tmp_path / "shot.png"
        arguments = ["develop", str(tmp_path / "shot.dng"), "--isp", processor, "--ev", "1", *balance]
        code, printed, _ = call([*arguments, "-o", str(out), "--json"])
        assert (code, set(json.loads(printed)["balance"].values())) == (0, {"given"})
        with Image.open(out) as picture:
            pictures.append(np.asarray(picture).astype(int))
    assert np.array_equal(*pictures)
    red, _, blue = decode_srgb(pictures[0].mean(axis=(0, 1)) / 255)
    assert red > 2 * blue, "a lamp's light seen by daylight is orange"


@pytest.mark.parametrize(
    ("asked", "shape"),
    [(["--width", "32"], (24, 32)), (["--height", "12"], (12, 16)), (["--height", "48", "--width", "1"], (48, 1))],
)
def test_a_smaller_picture_holds_the_means_of_linear_light(asked, shape, tmp_path):
    raw = negative(tmp_path / "shot.dng")
    stripes = np.arange(SHAPE[1]) % 8 < 4  # of half the light: no colour leaves the display's range
    dn = np.where(stripes, np.rint((raw.dn + raw.black_dn) / 2), raw.dn).astype(np.uint16)
    write_raw(replace(raw, dn=dn), tmp_path / "shot.dng")
    arguments = ["develop", str(tmp_path / "shot.dng"), "--isp", "bayer", "--ev", "0", "--bits", "16", *asked, "--json"]
    assert call(arguments)[0] == 0
    with Image.open(tmp_path / "shot.png") as picture:
        assert (picture.height, picture.width) == shape
    call(["develop", str(tmp_path / "shot.dng"), "--isp", "bayer", "--ev", "0", "-o", str(tmp_path / "w.png")])
    small, whole = (np.asarray(Image.open(tmp_path / name).convert("RGB")) / 255 for name in ("shot.png", "w.png"))
    means = [decode_srgb(x).mean(axis=(0, 1)) for x in (small, whole)]
    assert means[0] == pytest.approx(means[1], rel=0.01)  # half a level of 8 bits at 0.13 of linear light
    assert means[0] == pytest.approx(np.full(3, 0.75 * 0.25), rel=0.02)  # and the edges' own width


def test_the_bits_the_encoding_and_the_processor_asked_for_are_the_files(tmp_path: Path) -> None:
    negative(tmp_path / "shot.dng")
    asked = ["develop", tmp_path / "shot.dng", "--bits", "16", "--isp", "bayer_malvar", "--json", "-o"]
    code, printed, _ = call([*asked, tmp_path / "shot.png"])
    assert (code, json.loads(printed)["isp"]) == (0, "bayer_malvar")
    assert (tmp_path / "shot.png").read_bytes()[24] == 16  # IHDR's depth
    code, printed, _ = call([*asked, tmp_path / "wide.tif", "--encoding", "display-p3"])
    assert (code, json.loads(printed)["encoding"]) == (0, "display-p3")
    assert tifffile.imread(tmp_path / "wide.tif").dtype == np.uint16
    with Image.open(tmp_path / "wide.tif") as picture:
        assert b"D\0i\0s\0p\0l\0a\0y\0 \0P\x003" in picture.info["icc_profile"]


def test_a_picture_of_another_program_beside_the_raw_file_is_left_alone(tmp_path: Path) -> None:
    negative(tmp_path / "shot.dng", "bayer", 0.25)
    picture = tmp_path / "shot.png"
    picture.write_bytes(b"\x89PNG of another program")
    code, _, err = call(["develop", str(tmp_path / "shot.dng")])
    assert (code, picture.read_bytes()) == (2, b"\x89PNG of another program")
    assert err.endswith(f"{str(picture)!r} exists and isn't rodcone's; to write over it give -o {picture}\n")
    for asked in (["-o", str(picture)], []):  # by its name, and rodcone's own
        assert call(["develop", str(tmp_path / "shot.dng"), *asked])[0] == 0
    with Image.open(picture) as image:
        assert image.text == {"Software": "rodcone"}


def test_a_photograph_of_another_camera_is_developed_and_says_what_was_assumed(tmp_path: Path) -> None:
    pytest.importorskip("rawpy", reason="rodcone[photographs] (LibRaw) is not installed")
    neutral = mosaic_of({"R": 0.5, "G": 1.0, "B": 0.7}, BAYER, SHAPE)  # as it was shot
    other_camera(tmp_path / "other.dng", over_black(0.25 * neutral * (CAMERA_WHITE - max(CAMERA_BLACK))))
    code, out, _ = call(["develop", str(tmp_path / "other.dng"), "--isp", "bayer", "--ev", "0", "--json"])
    facts = json.loads(out)
    assert (code, facts["isp"], facts["noise"], facts["as_shot"]) == (0, "bayer", "assumed", "file")
    assert facts["reader"].startswith("LibRaw 0.")
    with Image.open(tmp_path / "other.png") as picture:
        # the levels' rounding as above
        assert np.abs(np.asarray(picture) - 255 * encode_srgb(np.array(0.25))).max() <= 0.7
        assert picture.size == SHAPE[::-1]


def test_black_frames_are_black_and_no_division_by_zero(tmp_path: Path) -> None:
    raw = negative(tmp_path / "shot.dng")
    write_raw(replace(raw, dn=np.zeros_like(raw.dn)), tmp_path / "shot.dng")
    code, out, _ = call(["develop", str(tmp_path / "shot.dng"), "--white-balance", "gray-world", "--json"])
    assert (code, json.loads(out)["ev"], set(json.loads(out)["balance"].values())) == (0, 0.0, {"calibrated"})
    with Image.open(tmp_path / "shot.png") as picture:
        assert not np.asarray(picture).any()


NOT_DEVELOPED = (
    ("none.dng", "none.dng ... no such file"),
    ("none.cr2", "none.cr2 ... no such file"),
    (".", "'.' is a folder"),
    ("cut.dng", "cut.dng ... cut off"),
    ("shot.jpeg", "it is a picture, developed already"),
    ("shot.dng new.png", "'new.png' is a picture; allowed: raw files; to write it give --out new.png"),
    ("mono.tif", "no colour calibration"),
    ("four.tif --isp interleaved", "use ple, which develops any mosaic"),
    ("shot.dng --isp interleaved", "holds ('R', 'G', 'B') ... use ple, which develops any mosaic"),
    ("shot.dng --isp rgbw_sato", "holds ('R', 'G', 'B')"),
    ("shot.dng --isp cmyw_yamagami", "is not C, M, Y and W"),
    ("shot.dng --isp bayr", "isp: 'bayr' ... did you mean 'bayer'"),
    ("shot.dng --bits 12", "bits: 12 ... give 8 or 16"),
    ("shot.dng --encoding p3", "encoding: 'p3' ... display-p3, srgb"),
    ("shot.dng --ev inf", "ev: inf ... give stops"),
    ("shot.dng -o shot.jpg", "another ending ... .png"),
    ("shot.dng --width 65", "height, width: (49, 65) ... (48, 64) ... give less"),
    ("shot.dng --height 0", "height: 0 ... give pixels"),
    ("shot.dng --white-balance as_shot", "white_balance ... did you mean 'as-shot'"),
    ("shot.dng --white-balance D66", "white_balance: 'D66' is unknown ... as-shot ... did you mean 'D65'"),
    ("shot.dng --white-balance F11", "'F11' has bands ... give it to capture instead"),
    ("shot.dng --white-balance FL3.12", "'FL3.12' has bands ... give it to capture instead"),
    ("shot.dng --white-balance 10K", "white_balance: '10K' is unknown"),
)


def test_what_cannot_be_developed_is_refused_and_leaves_no_picture(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    raw = negative(Path("shot.dng"))
    Path("cut.dng").write_bytes(Path("shot.dng").read_bytes()[:2000])
    Path("shot.jpeg").write_bytes(b"\xff\xd8")
    write_raw(replace(raw, cfa=("W",), colour=None), Path("mono.tif"))
    four = calibrate(preset("low_noise", "rgbw"), illuminant("D65"))  # none of its channels is a W
    write_raw(replace(raw, cfa=("RC", "GB"), colour=four), Path("four.tif"))
    check_refusals("develop", NOT_DEVELOPED, tmp_path)


@pytest.mark.thorough
def test_a_burst_is_captured_and_its_merged_frames_are_developed(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    asked = ["flat_field", "--size", "32", "--spp", "4", "--level", "2cd/m2", "--cfa", "bayer"]
    assert call(["capture", *asked, "-o", "one.dng"])[0] == 0
    assert call(["capture", *asked, "--frames", "4", "-o", "shot.dng"])[1].split() == [
        *(f"shot_{n}.dng" for n in (1, 2, 3, 4))
    ]
    frames = [read_raw(Path(f"shot_{n}.dng")).dn for n in (1, 2, 3, 4)]
    assert np.array_equal(frames[0], read_raw(Path("one.dng")).dn)
    assert not np.array_equal(frames[0], frames[1])
    assert call(["develop", "one.dng"])[0] == 0
    names = [f"shot_{n}.dng" for n in (1, 2, 3, 4)]
    code, out, _ = call(["develop", *names, "--json"])
    assert code == 0
    assert json.loads(out)["raw"] == names
    spread = [np.asarray(Image.open(name), dtype=float).std() for name in ("one.png", "shot_1.png")]
    assert spread[1] < 0.75 * spread[0]
    assert call(["capture", *asked[:-1], "rgbw", "-o", "other.dng"])[0] == 0
    code, _, err = call(["develop", "one.dng", "other.dng", "-o", "no.png"])
    assert code == 2
    assert "cfa of frame 1" in err
    assert not Path("no.png").exists()


def test_capture_in_python_gives_the_commands_frame(exr: Path, tmp_path: Path) -> None:
    take(Order(exr, tmp_path / "shot.dng"))
    ours, theirs = capture(read_exr(exr)), read_raw(tmp_path / "shot.dng")
    assert ours.exposure_s == pytest.approx(theirs.exposure_s, rel=1e-6)
    assert np.array_equal(ours.dn, theirs.dn)
