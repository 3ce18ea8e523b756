"""`rodcone render`: the file it writes, its facts, and one line with exit code 2 for bad input."""

import json
import re
import tracemalloc
import warnings
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from builders import transport_of
from command_line import call, check_refusals

from render.illuminants import illuminant
from render.radiance_files.exr import read_exr, write_exr
from render.scene import LightGroup
from render.spectrum import even_bands
from render.transport import Transport
from scenes.catalogue import load
from studies.commands import render as render_command
from studies.photograph.ready_light import Ready
from studies.study.lit_scene import asked_spectra

BANDS = ["--bands", "400:720:80"]
QUICK = ["--spp", "8", *BANDS]
SCENE = """<scene version="3.0.0">
<sensor type="perspective"><float name="fov" value="20"/>
  <transform name="to_world"><lookat origin="0,0,4" target="0,0,0" up="0,1,0"/></transform>
  <film type="hdrfilm"><integer name="width" value="8"/><integer name="height" value="6"/></film></sensor>
<bsdf type="diffuse" id="grey"><spectrum name="reflectance" value="0.5"/></bsdf>
<shape type="rectangle" id="wall"><ref id="grey"/></shape>
<emitter type="directional" id="sun"><vector name="direction" x="0" y="0" z="-1"/>
  <spectrum name="irradiance" value="2"/></emitter>
<emitter type="{}" id="sky"/>
</scene>"""


@pytest.fixture
def scene(tmp_path: Path) -> Path:
    path = tmp_path / "scene" / "room.xml"
    path.parent.mkdir()
    path.write_text(SCENE.format("point"))  # at the origin, in the wall's plane: it lights nothing
    return path


def test_a_users_scene_becomes_a_spectral_exr_of_absolute_radiance(scene: Path, tmp_path: Path) -> None:
    out = tmp_path / "made" / "out.exr"
    assert call(["render", str(scene), "-o", str(out), *QUICK]) == (0, f"{out}\n", "")
    radiance = read_exr(out)
    assert radiance.shape == (6, 8)
    np.testing.assert_allclose(radiance.wavelength_nm, [440.0, 520.0, 600.0, 680.0])
    np.testing.assert_allclose(radiance.widths_nm, 80.0)
    np.testing.assert_allclose(radiance.values, 0.5 * 2 / np.pi, rtol=1e-5)  # L = rho E / pi
    assert list(out.parent.iterdir()) == [out]


def test_facts_are_one_json_object(scene: Path, tmp_path: Path) -> None:
    scene.write_text(scene.read_text().replace("<sensor", '<integrator type="path"/><sensor'))
    arguments = [str(scene), "-o", str(tmp_path / "o.exr"), "--width", "4", "--level", "25cd/m2", "--json"]
    code, out, err = call(["render", *arguments, *QUICK])
    facts = json.loads(out)
    assert (code, facts["path"], facts["scene"], facts["size"]) == (0, str(tmp_path / "o.exr"), "room", [3, 4])
    assert (facts["spp"], facts["stopped_by"], facts["bands"]) == (8, "samples", 4)
    assert facts["groups"]["sun"] == {"emitters": ["sun"], "power": 1.0, "own_colour": False}
    assert facts["largest_band_error"] == pytest.approx(0.0, abs=1e-6)  # nothing here varies with wavelength
    assert facts["mean_luminance_cd_m2"] == pytest.approx(25.0, rel=1e-5)
    assert err == f"rodcone: {facts['notes'][0]}\n"
    assert "integrator 'path': the engine brings its own, with paths of any length" in err


@pytest.mark.filterwarnings("default:bands")
def test_bands_too_wide_for_the_surfaces_are_told(tmp_path: Path) -> None:
    arguments = ["render", "cornell_box", "-o", str(tmp_path / "box.exr"), "--width", "8", "--spp", "64", "--bands"]
    code, _, err = call([*arguments, "380:780:50", "--light", "F11"])
    assert code == 0
    assert re.search(r"^rodcone: bands: colours and a sensor's channels are off by about .* bands of up to 50 nm", err)
    assert call([*arguments, "400:700:10", "--light", "D65"])[2] == ""


def test_every_command_hands_a_scene_files_parameters_on(scene: Path, tmp_path: Path) -> None:
    for command in ("render", "capture", "explore --no-browser", "reference", "demo --scene"):
        rows = [(f"{scene} -D depth", "write NAME=VALUE"), (f"{scene} -D no_such_parameter=4", "no_such_parameter")]
        check_refusals(command, rows, tmp_path)


def test_another_illuminant_comes_at_the_same_luminance(scene: Path, tmp_path: Path) -> None:
    fine = ["--spp", "8", "--bands", "380:780:25", "-o"]
    call(["render", str(scene), *fine, str(tmp_path / "own.exr")])
    call(["render", str(scene), *fine, str(tmp_path / "a.exr"), "--light", "sun=A"])
    own, a = read_exr(tmp_path / "own.exr"), read_exr(tmp_path / "a.exr")
    expected = illuminant("A").band_average(a.wavelength_nm, a.widths_nm)
    np.testing.assert_allclose(a.values[2, 3] / a.values[2, 3, 0], expected / expected[0], rtol=1e-5)
    # 1 %: 25 nm bands weigh V(lambda) by its band averages, the illuminant is scaled in bands of 1 nm.
    np.testing.assert_allclose(a.luminance().mean(), own.luminance().mean(), rtol=0.01)


def test_a_catalogue_scene_is_rendered_by_name(tmp_path: Path) -> None:
    out = tmp_path / "f.exr"
    arguments = ["flat_field", "-o", str(out), "--height", "2", "--width", "3", "--level", "500lux", *QUICK]
    assert call(["render", *arguments])[:2] == (0, f"{out}\n")
    assert read_exr(out).shape == (2, 3)


@pytest.mark.parametrize("lit", [(), ("--light", "F11"), ("--light", "F11", "--level", "3cd/m2")])
def test_the_file_has_the_bytes_of_light_that_is_relit_with_all_bands_at_once(
    lit: tuple[str, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    rendered, made = render_command.render_transport, []

    def kept(*arguments: Any, **options: Any) -> Transport:
        made.append(rendered(*arguments, **options))
        return made[0]

    monkeypatch.setattr(render_command, "render_transport", kept)
    out = tmp_path / "box.exr"
    asked = ["render", "cornell_box", "-o", str(out), "--width", "24", "--spp", "8", "--json", *lit]
    code, printed, _ = call(asked)
    spectra = asked_spectra(load("cornell_box"), lit[1:2])
    at_once = made[0].relight(spectra, luminance_cd_m2=3.0 if "--level" in lit else None)
    write_exr(at_once, tmp_path / "at_once.exr", scene="cornell_box")
    assert code == 0
    assert out.read_bytes() == (tmp_path / "at_once.exr").read_bytes()
    facts = json.loads(printed)
    assert facts["relative_mc_error"] == at_once.relative_mc_error > 0
    assert facts["relative_level_error"] == at_once.relative_level_error
    assert facts["mean_luminance_cd_m2"] == at_once.luminance().mean()
    assert facts["largest_band_error"] == max(made[0].band_error(spectra).values())


@pytest.mark.parametrize("stored", [False, True])
def test_light_is_written_in_the_memory_that_its_render_holds_at_its_end(
    stored: bool, scene: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Three arrays of all bands: mean, half difference and variance."""
    shape = (1, 20, 600, 800)
    groups = {"sun": LightGroup(("sun",), illuminant("E"), 1.0)}
    bands = even_bands((380.0, 780.0), 20)

    def ended(*_: Any, **__: Any) -> Transport:
        tracemalloc.start()  # here, because what the command imports counts too
        return transport_of(np.random.default_rng(1).random(shape, dtype=np.float32), groups, *bands)

    monkeypatch.setattr(render_command, "render_transport", ended)
    if stored:
        monkeypatch.setattr(render_command, "find_ready", lambda *_: Ready(ended(), shape[2:], "light: ready"))
    for _ in range(2):  # the first run computes tables that stay
        code, _, err = call(["render", str(scene), "-o", str(tmp_path / "o.exr")])
        _, peak = tracemalloc.get_traced_memory()
        tracemalloc.stop()
    assert (code, "light: ready" in err) == (0, stored)
    assert peak < 3.5 * 4 * np.prod(shape)


def test_what_an_interrupt_left_is_written_and_told(scene, tmp_path, monkeypatch):
    whole = render_command.render_transport

    def interrupted(*arguments: Any, **options: Any) -> Any:
        return replace(whole(*arguments, **options), stopped_by="interrupt")

    monkeypatch.setattr(render_command, "render_transport", interrupted)
    out = tmp_path / "o.exr"
    code, printed, err = call(["render", str(scene), "-o", str(out), *QUICK])
    assert (code, printed) == (130, f"{out}\n")
    assert f"rodcone: stopped; 8 samples a pixel are kept in {out}" in err
    assert read_exr(out).shape == (6, 8)


def test_surfaces_go_on_at_their_ends_where_it_is_asked_for(scene: Path, tmp_path: Path) -> None:
    scene.write_text(scene.read_text().replace('"reflectance" value="0.5"', '"reflectance" value="450:0.5, 700:0.5"'))
    out = tmp_path / "o.exr"
    code, _, err = call(["render", str(scene), "-o", str(out), *QUICK])
    assert (code, err.count("\n")) == (2, 1)
    assert "bands reach 400-720 nm, and grey/reflectance is known over 450-700 nm alone; give bands within" in err
    assert "--extend hold" in err
    assert call(["render", str(scene), "-o", str(out), *QUICK, "--extend", "hold"]) == (0, f"{out}\n", "")
    np.testing.assert_allclose(read_exr(out).values, 0.5 * 2 / np.pi, rtol=1e-5)


def test_a_light_that_ends_within_the_bands_is_told_once(scene, tmp_path, monkeypatch):
    monkeypatch.setattr(warnings, "filters", [("always", None, Warning, None, 0)])  # not as errors, as in these tests
    scene.write_text(scene.read_text().replace('"irradiance" value="2"', '"irradiance" value="450:2, 700:2"'))
    code, _, err = call(["render", str(scene), "-o", str(tmp_path / "o.exr"), *QUICK])
    known = "light group 'sun' is known over 450-700 nm, and bands reach 400-720 nm"
    assert (code, err.count("known over")) == (0, 1)
    assert err.startswith(f"rodcone: {known}: outside its table it is taken as dark\n")


REFUSED = (
    ("stil_life", "scene: 'stil_life' ... did you mean 'still_life'?"),
    ("none.xml", "'none.xml' is missing"),
    ("scene/room.xml -o o.png", "'o.png' ... .exr"),
    ("scene/room.xml --light sum=A", "light group: 'sum' ... did you mean 'sun'?"),
    ("scene/room.xml --light sun=D56", "illuminant: 'D56'"),
    ("scene/room.xml --light =A", "'=A' ... GROUP=ILLUMINANT"),
    ("scene/sky.xml --light sky=A", "'sky' ... colours of its own"),
    ("scene/room.xml --level 3nits", "'nits' ... cd/m2, lux"),
    ("scene/room.xml --level 3lux", "'3lux' needs a reference plane ... irradiancemeter"),
    ("scene/room.xml --height 0", "height: 0 ... give pixels"),
    ("scene/room.xml --bands 400:705:10", "'400:705:10' ... 380:780:10"),
    ("scene/room.xml --bands 400:700", "'400:700' ... 380:780:10"),
    ("scene/room.xml --bands 700:400:-10", "'700:400:-10'"),
    ("scene/room.xml --bands 400:inf:10", "'400:inf:10'"),
    ("scene/room.xml --noise -1", "noise: -1 ... 0.02"),
    ("still_life --trust-scene", "trust-scene: True for 'still_life'"),
    ("scene/room.xml --extend hol", "extend: 'hol' ... did you mean 'hold'?"),
    ("scene/hostile.xml", "(line 2, col 1) ... '../secret.xml' lies outside the scene's folder ... --trust-scene"),
)


def test_bad_input_is_refused_and_a_bad_place_is_told_before_the_render(scene, tmp_path, monkeypatch):
    (scene.parent / "sky.xml").write_text(SCENE.format("sunsky"))
    (scene.parent / "hostile.xml").write_text(SCENE.replace("<sensor", '<include filename="../secret.xml"/><sensor', 1))
    (tmp_path / "taken.exr").mkdir()
    monkeypatch.chdir(tmp_path)
    check_refusals("render", REFUSED, tmp_path)
    monkeypatch.setattr(render_command, "render_transport", lambda *_, **__: pytest.fail("rendered"))
    for place in ("taken.exr", "scene/room.xml/o.exr"):
        rows = [(f"scene/room.xml -o {place}", "choose another place with --out")]
        check_refusals("render", rows, tmp_path, code=1)


def test_denoised_light_is_written_with_its_measured_error(tmp_path: Path) -> None:
    pytest.importorskip("mitsuba_oidn", reason="rodcone[denoise] is not installed")
    made, asked = [], ["cornell_box", "--height", "32", "--width", "32", *QUICK, "--json"]
    for name, more in (("plain", []), ("denoised", ["--denoise"])):
        out = tmp_path / f"{name}.exr"
        code, told, _ = call(["render", *asked, "-o", str(out), *more])
        made.append((code, read_exr(out).values, json.loads(told)["relative_mc_error"]))
    (_, plain, _), (code, denoised, error) = made
    assert code == 0
    assert not np.array_equal(plain, denoised)
    assert denoised.mean() == pytest.approx(plain.mean(), rel=0.1)
    assert np.isfinite(error)  # at 8 samples, of folds of two
    assert error > 0
