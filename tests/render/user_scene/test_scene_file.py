"""A user's scene: what is read, how its lights are grouped, and that nothing hostile gets as far as being loaded."""

import shutil
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from loop import loop
from PIL import Image
from refusal import refusal

from render.engine import render
from render.loader import mitsuba_module, own_mitsuba_variant
from render.scene_range import check_range
from render.user_scene.scene_file import load_scene_file
from render.user_scene.scene_parts import LONGEST_CHAIN, SceneFile
from render.user_scene.scene_paths import MOST_NESTED
from rodcone.errors import InputError
from rodcone.file_keys import formats
from studies.study.scene_source import open_scene

CAMERA = """
<sensor type="perspective" id="camera">
  <float name="fov" value="20"/>
  <transform name="to_world"><lookat origin="0,0,4" target="0,0,0" up="0,1,0"/></transform>
  <film type="hdrfilm"><integer name="width" value="8"/><integer name="height" value="6"/></film>
  <sampler type="independent"/>
</sensor>"""
SUN = '<emitter type="directional" id="sun"><vector name="direction" x="0" y="0" z="-1"/></emitter>'
WALL = '<shape type="rectangle" id="wall"/>'
QUAD = "v -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\nf 1 2 3 4\n"


def write(folder: Path, *parts: str, name: str = "scene.xml") -> Path:
    path = folder / name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(f'<scene version="3.0.0">{"".join(parts)}\n</scene>\n')
    return path


def told(folder: Path, *parts: str, trust: bool = False) -> str:
    """Line with which a scene of these parts is refused."""
    return refusal(load_scene_file, write(folder, *parts), trust=trust)


def loaded_libraries() -> str:
    maps = Path("/proc/self/maps")
    if not maps.is_file():
        pytest.skip("no /proc: the libraries that this process has loaded can't be listed")
    return maps.read_text()


@pytest.fixture
def nothing_is_loaded(monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails the test where anything is instantiated."""

    def refuse(*_: Any) -> None:
        raise AssertionError("instantiated")

    mi = mitsuba_module()
    for module, name in ((mi, "load_dict"), (mi, "load_file"), (mi.parser, "instantiate")):
        monkeypatch.setattr(module, name, refuse)


# --- what is read


def test_lit_mesh_has_the_radiance_of_the_closed_form(tmp_path: Path) -> None:
    (tmp_path / "meshes").mkdir()
    (tmp_path / "meshes" / "quad.obj").write_text(QUAD)
    path = write(
        tmp_path,
        CAMERA,
        '<emitter type="directional" id="sun"><vector name="direction" x="0" y="0" z="-1"/>'
        '<spectrum name="irradiance" value="3"/></emitter>',
        '<bsdf type="diffuse" id="grey"><spectrum name="reflectance" value="0.5"/></bsdf>',
        '<shape type="obj" id="quad"><string name="filename" value="meshes/quad.obj"/><ref id="grey"/></shape>',
    )
    opened = load_scene_file(path)
    assert (opened.size, opened.scene.reference_plane, opened.notes) == ((6, 8), None, ())
    transport = render(opened.scene, opened.size, wavelength_nm=np.arange(420.0, 700.0, 80.0), spp=16)
    # A diffuse surface under collimated irradiance E at normal incidence: L = rho E / pi, without Monte Carlo error.
    np.testing.assert_allclose(transport.relight().values, 0.5 * 3 / np.pi, rtol=1e-5)


def test_an_irradiance_meter_marks_the_plane_on_which_lux_are_meant(tmp_path: Path) -> None:
    wall = '<shape type="rectangle" id="wall"><sensor type="irradiancemeter"/></shape>'
    opened = load_scene_file(write(tmp_path, CAMERA, wall, '<emitter type="constant" id="sky"/>'))
    assert opened.scene.reference_plane == "wall"
    transport = render(opened.scene, (1, 1), wavelength_nm=np.arange(420.0, 700.0, 80.0), spp=16)
    np.testing.assert_allclose(transport.irradiance, np.pi, rtol=1e-5)  # E = pi L under a constant environment
    # A light without size would be left out of what the meter reads, so the plane is left out instead.
    opened = load_scene_file(write(tmp_path, CAMERA, wall, SUN))
    assert opened.scene.reference_plane is None
    assert "irradiance meter is left out" in opened.notes[0]


FORMS = {
    "absent": "",
    "rgb": '<rgb name="{0}" value="3 1 0.5"/>',
    "float": '<float name="{0}" value="2.5"/>',
    "uniform": '<spectrum name="{0}" value="2.5"/>',
    "even points": '<spectrum name="{0}" value="400:1,500:2,600:0.5"/>',
    "uneven points": '<spectrum name="{0}" value="400:1,450:2,700:0.5"/>',
    "blackbody": '<spectrum name="{0}" type="blackbody"><float name="temperature" value="3000"/></spectrum>',
    "d65": '<spectrum name="{0}" type="d65"/>',
    "tinted d65": '<spectrum name="{0}" type="d65"><rgb name="color" value="1 2 3"/></spectrum>',
    "regular": '<spectrum name="{0}" type="regular"><float name="wavelength_min" value="400"/>'
    '<float name="wavelength_max" value="700"/><string name="values" value="1, 2, 0.5"/></spectrum>',
    "irregular": '<spectrum name="{0}" type="irregular"><string name="wavelengths" value="400, 450, 700"/>'
    '<string name="values" value="1, 2, 0.5"/></spectrum>',
}


@loop("form", FORMS.values())
def test_spectrum_of_a_light_is_what_stock_mitsuba_emits(form: str, tmp_path: Path) -> None:
    lamp = f'<shape type="rectangle"><emitter type="area" id="lamp">{form.format("radiance")}</emitter></shape>'
    path = write(tmp_path, CAMERA, lamp)
    mi, nm = mitsuba_module(), [412.0, 451.5, 555.0, 687.25]
    emitter = mi.load_file(str(path)).emitters()[0]
    seen = mi.SurfaceInteraction3f()
    seen.wi, seen.wavelengths = mi.Vector3f(0, 0, 1), mi.Spectrum(*nm)
    group = load_scene_file(path).scene.groups["lamp"]
    assert not group.coloured
    ours = np.interp(nm, group.spectrum.wavelength_nm, group.spectrum.values, left=0.0, right=0.0)
    # 1e-3: between points 1 nm apart, d65's own 5 nm kinks are met half-way.
    np.testing.assert_allclose(ours, np.array(emitter.eval(seen)).ravel(), rtol=1e-3)


def test_a_lamps_line_keeps_its_height_and_width(tmp_path: Path) -> None:
    lamp = '<spectrum name="intensity" value="400:0,588.95:0,589:20,589.05:0,700:0"/>'
    spectrum = load_scene_file(write(tmp_path, CAMERA, f'<emitter type="point">{lamp}</emitter>')).scene.groups
    # A triangle 0.1 nm wide and 20 high holds 1; a grid of 1 nm would make it 20.
    assert spectrum["emitter_0"].spectrum.band_average([589.0], [1.0])[0] == pytest.approx(1.0, rel=1e-9)


def test_lights_are_grouped_by_id_or_their_shapes_up_to_a_colon(tmp_path: Path) -> None:
    blue = '<rgb name="radiance" value="0 0 1"/>'
    red = '<rgb name="radiance" value="1 0 0"/>'
    path = write(
        tmp_path,
        CAMERA,
        *(f'<shape type="disk" id="lamp:{i}"><emitter type="area">{blue}</emitter></shape>' for i in range(2)),
        f'<shape type="disk" id="panel"><emitter type="area" id="own.id">{blue}</emitter></shape>',
        f'<shape type="disk"><emitter type="area">{blue}</emitter></shape>',
        f'<shape type="disk" id="mixed:a"><emitter type="area">{blue}</emitter></shape>',
        f'<shape type="disk" id="mixed:b"><emitter type="area">{red}</emitter></shape>',
        '<emitter type="point"/><emitter type="sunsky" id="sky"/>',
    )
    scene = load_scene_file(path).scene
    assert {name: len(group.emitters) for name, group in scene.groups.items()} == {
        **dict.fromkeys(("lamp", "mixed"), 2),
        **dict.fromkeys(("own.id", "shape_0", "emitter_0", "sky"), 1),
    }
    assert {name for name, group in scene.groups.items() if group.coloured} == {"mixed", "sky"}
    assert scene.geometry["mixed:b"]["_arg_0"]["radiance"] == {"type": "rgb", "value": [1.0, 0.0, 0.0]}
    assert "radiance" not in scene.geometry["lamp:1"]["_arg_0"]


@pytest.mark.usefixtures("nothing_is_loaded")
def test_a_file_is_checked_where_mitsuba_opens_it(tmp_path: Path) -> None:
    home = tmp_path / "home"
    (tmp_path / "secret.spd").write_text("400 1\n700 1\n")
    write(home, '<bsdf type="diffuse"><spectrum name="reflectance" filename="r.spd"/></bsdf>', name="in/real.xml")
    (home / "in" / "r.spd").write_text("380 0.25\n780 0.75\n")
    (home / "r.spd").symlink_to(tmp_path / "secret.spd")  # Mitsuba takes this one, beside the including file
    (home / "link.xml").symlink_to(home / "in" / "real.xml")
    for included in ("in/real.xml", "link.xml"):
        assert "file 'r.spd' lies outside" in told(home, f'<include filename="{included}"/>', CAMERA, SUN)


def test_includes_defaults_aliases_and_spectrum_files_are_followed(tmp_path: Path) -> None:
    write(
        tmp_path,
        '<bsdf type="diffuse" id="a"><spectrum name="reflectance" filename="parts/r.spd"/></bsdf>',
        '<alias id="a" as="b"/>',
        name="parts/materials.xml",
    )
    (tmp_path / "parts" / "r.spd").write_text("380 0.25\n780 0.75\n")
    (tmp_path / "parts" / "parts").mkdir()  # not there: Mitsuba looks beside the including file
    (tmp_path / "parts" / "parts" / "r.spd").write_text("400 1\n700 1\n")
    path = write(
        tmp_path,
        '<default name="side" value="5"/><include filename="parts/materials.xml"/>',
        CAMERA.replace('value="6"', 'value="$side"'),
        SUN,
        '<shape type="sphere"><ref id="b" name="bsdf"/></shape>',
    )
    opened = load_scene_file(path)
    assert opened.size == (5, 8)
    assert opened.scene.geometry["shape_0"]["bsdf"] == {"type": "ref", "id": "a"}
    assert opened.scene.geometry["a"]["reflectance"]["values"] == "0.25,0.75"
    mitsuba_module().load_dict(opened.scene.description)  # Mitsuba follows the reference too


def test_an_included_files_name_may_hold_parameters(tmp_path: Path) -> None:
    for name, value in (("d50", 1), ("d5000", 2), ("a", 3)):
        light = f'<emitter type="point" id="lamp"><spectrum name="intensity" value="{value}"/></emitter>'
        write(tmp_path, light, name=f"lights/{name}.xml")
    # The first value of a parameter counts, and the longest name; one may hold another.
    defaults = (("light", "d50"), ("light", "a"), ("light2", "${light}00"), ("folder", "lights"))
    stated = "".join(
        f'<default name="{name}" value="{value.replace("{light}", "light")}"/>' for name, value in defaults
    )
    path = write(tmp_path, stated, '<include filename="$folder/$light2.xml"/>', CAMERA)
    assert load_scene_file(path).scene.groups["lamp"].spectrum.values[0] == 2


def test_parameters_can_be_given_as_mitsuba_takes_them(tmp_path: Path) -> None:
    light = '<emitter type="point" id="lamp"><spectrum name="intensity" value="$power"/></emitter>'
    path = write(tmp_path, '<default name="power" value="1"/>', light, CAMERA, WALL)
    assert load_scene_file(path).scene.groups["lamp"].spectrum.values[0] == 1
    assert load_scene_file(path, define={"power": "7"}).scene.groups["lamp"].spectrum.values[0] == 7
    assert open_scene(str(path), define=["power=7"]).scene.groups["lamp"].spectrum.values[0] == 7
    refusal(load_scene_file, path, define={"other": "7"}, match="other")
    refusal(open_scene, str(path), define=["power"], match=r"define: 'power' is not allowed; write NAME=VALUE")
    refusal(open_scene, "flat_field", define=["power=7"], match="define")


def test_tables_over_400_to_700_nm_are_held_with_a_note_shorter_ones_refused(tmp_path: Path) -> None:
    def read(first: int, last: int, extend: str | None = None) -> SceneFile:
        table = f'<spectrum name="reflectance" value="{first}:0.2, {last}:0.6"/>'
        wall = f'<shape type="rectangle" id="wall"><bsdf type="diffuse">{table}</bsdf></shape>'
        return load_scene_file(write(tmp_path, wall, SUN, CAMERA), extend=extend)

    held = read(400, 700)
    assert held.notes == ("surfaces known over 400-700 nm go on at their end values beyond",)
    ends = render(held.scene, (2, 2), wavelength_nm=[385.0, 395.0, 705.0], width_nm=[10.0] * 3, spp=4).radiance[
        0, :, 0, 0
    ]
    np.testing.assert_allclose(ends / ends[0], [1.0, 1.0, 3.0], rtol=1e-5)
    assert read(380, 780).notes == ()
    match = r"wall/_arg_0/reflectance is known over 420-700 nm alone; .*--extend hold"
    refusal(check_range, read(420, 700).scene, 380.0, 780.0, match=match)
    check_range(read(420, 700, "hold").scene, 380.0, 780.0)
    refusal(read, 420, 700, "zero", match="extend: 'zero' is unknown")


def test_names_of_exporters_with_dots_and_blanks_are_kept_apart(tmp_path: Path) -> None:
    grey = '<bsdf type="diffuse" id="{0}" name="{0}"/>'
    wall = '<shape type="disk" id="wall 1"><bsdf type="diffuse" name="mat.1/2"/></shape>'
    path = write(tmp_path, CAMERA, SUN, grey.format("mat.001"), grey.format("mat_001"), wall, WALL.replace("/>", ">"))
    path.write_text(path.read_text().replace("</scene>", '<ref id="mat.001" name="mat 1"/></shape></scene>'))
    geometry = load_scene_file(path).scene.geometry
    assert {key: geometry[key]["id"] for key in ("mat_001", "mat_001_0", "wall_1", "wall")} == {
        "mat_001": "mat_001",  # Mitsuba takes a key for an id as well
        "mat_001_0": "mat.001",
        "wall_1": "wall 1",
        "wall": "wall",
    }
    assert geometry["wall"]["mat_1"] == {"type": "ref", "id": "mat.001"}
    assert set(geometry["wall_1"]) == {"type", "id", "mat_1_2"}
    mitsuba_module().load_dict(load_scene_file(path).scene.description)


def test_an_area_light_stated_beside_its_shape_is_put_on_it(tmp_path: Path) -> None:
    lamp = '<emitter type="area" id="lamp"><spectrum name="radiance" value="3"/></emitter>'
    path = write(tmp_path, CAMERA, '<shape type="rectangle" id="ceiling"><ref id="lamp"/></shape>', lamp)
    mi, opened = mitsuba_module(), load_scene_file(path)
    assert opened.scene.groups["lamp"].emitters == ("ceiling/_arg_0",)
    ours, stock = mi.load_dict(opened.scene.description).emitters(), mi.load_file(str(path)).emitters()
    assert len(ours) == len(stock) == 1


HIDDEN = '<integrator type="volpath"><boolean name="hide_emitters" value="{}"/></integrator>'


def test_what_the_engine_brings_itself_is_left_out_and_told(tmp_path: Path) -> None:
    second = CAMERA.replace('id="camera"', 'id="second"').replace('value="8"', 'value="80"')
    opened = load_scene_file(write(tmp_path, HIDDEN.format("false"), CAMERA, second, SUN))
    assert opened.size == (6, 8)
    assert set(opened.scene.geometry["sensor"]) == {"type", "id", "fov", "to_world"}
    assert {value["type"] for value in opened.scene.geometry.values() if isinstance(value, dict)} == {
        *("perspective", "directional")
    }
    notes = " ".join(opened.notes)
    assert all(word in notes for word in ("'volpath'", "paths of any length", "1 of 2 cameras"))


def test_a_property_that_changes_the_picture_is_followed_or_refused_by_name(tmp_path: Path) -> None:
    assert "volpath: hide_emitters: 'True' changes values" in told(tmp_path, HIDDEN.format("true"), CAMERA, SUN, WALL)
    unknown = '<integrator type="path"><integer name="max_dept" value="3"/></integrator>'
    assert "integrator property 'max_dept' is unknown" in told(tmp_path, unknown, CAMERA, SUN, WALL)
    assert "did you mean 'max_depth'?" in told(tmp_path, unknown, CAMERA, SUN, WALL)
    wide = CAMERA.replace("</film>", '<integer name="widht" value="3"/></film>')
    assert "film property 'widht' is unknown" in told(tmp_path, wide, SUN, WALL)
    sampled = CAMERA.replace(
        "</sensor>", '<sampler type="independent"><integer name="count" value="3"/></sampler></sensor>'
    )
    assert "sampler property 'count' is unknown" in told(tmp_path, sampled, SUN, WALL)


def test_a_cut_out_of_the_film_is_refused_and_the_whole_is_none(tmp_path: Path) -> None:
    for key, value, whole in (("crop_width", 2, 8), ("crop_height", 5, 6), ("crop_offset_x", 1, 0)):
        cut = f'<integer name="{key}" value="{{}}"/></film>'
        path = CAMERA.replace("</film>", cut.format(value))
        assert f"film {key}={value}: no part of a picture is rendered" in told(tmp_path, path, SUN, WALL)
        assert load_scene_file(write(tmp_path, CAMERA.replace("</film>", cut.format(whole)), SUN, WALL)).size == (6, 8)


PATH_OF_3 = '<integrator type="path"><integer name="max_depth" value="3"/></integrator>'


@loop(
    ("integrator", "depth"),
    [
        ("", 8),
        ('<integrator type="path"/>', 65536),
        ('<integrator type="path"><integer name="max_depth" value="-1"/></integrator>', 65536),
        ('<integrator type="path"><integer name="max_depth" value="17"/></integrator>', 17),
        ('<integrator type="path"><integer name="max_depth" value="1"/></integrator>', 1),
        ('<integrator type="direct"/>', 2),
        ('<integrator type="direct_projective"/>', 2),
        ('<integrator type="prb_projective"/>', 6),
        (f'<integrator type="aov">{PATH_OF_3}</integrator>', 3),
    ],
)
def test_paths_are_as_long_as_the_file_states(integrator: str, depth: int, tmp_path: Path) -> None:
    assert load_scene_file(write(tmp_path, integrator, CAMERA, SUN)).scene.max_depth == depth


def test_a_path_of_one_segment_shows_emission_alone(tmp_path: Path) -> None:
    """A lamp of 3 in front of a wall that it lights: 3 where it is seen, 0 elsewhere."""
    one = '<integrator type="path"><integer name="max_depth" value="1"/></integrator>'
    size = '<transform name="to_world"><scale value="0.2"/><translate z="0.5"/></transform>'
    lamp = f'<shape type="rectangle">{size}<emitter type="area" id="lamp"><spectrum name="radiance" value="3"/>'
    opened = load_scene_file(write(tmp_path, one, CAMERA, WALL, f"{lamp}</emitter></shape>"))
    values = render(opened.scene, (9, 9), wavelength_nm=[550.0], width_nm=[10.0], spp=128).relight().values[..., 0]
    np.testing.assert_allclose(values[[0, -1, 4, 4], [0, -1, 4, 0]], [0, 0, 3, 0], rtol=1e-6)
    assert "max_depth: 0 is outside 1 to" in told(tmp_path, one.replace('"1"', '"0"'), CAMERA, SUN, WALL)


@loop(("stated", "first"), [("", 5), ("2", 2), ("1000000000", 65536)])
def test_roulette_begins_where_the_file_states(stated: str, first: int, tmp_path: Path) -> None:
    value = f'<integer name="rr_depth" value="{stated}"/>' if stated else ""
    opened = load_scene_file(write(tmp_path, f'<integrator type="volpath">{value}</integrator>', CAMERA, SUN))
    assert opened.scene.rr_depth == first
    assert f"roulette from {first}" in opened.notes[0]


def test_a_scene_without_a_shape_is_refused_in_one_line(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="it has no shape, so nothing is lit; add one"):
        render(load_scene_file(write(tmp_path, CAMERA, SUN)).scene, (4, 4), spp=4)


def test_a_mask_by_a_colour_bitmap_is_its_stored_luminance_or_refused_plainly(tmp_path: Path) -> None:
    """A wall of reflectance 0.5 under an irradiance of 1 at normal incidence: L = opacity 0.5 / pi."""
    Image.new("RGB", (2, 2), (200, 120, 40)).save(tmp_path / "leaf.png")
    sun = SUN.replace("</emitter>", '<spectrum name="irradiance" value="1"/></emitter>')

    def masked(raw: str) -> Path:
        texture = f'<texture type="bitmap" name="opacity"><string name="filename" value="leaf.png"/>{raw}</texture>'
        wall = '<bsdf type="diffuse"><spectrum name="reflectance" value="0.5"/></bsdf>'
        return write(tmp_path, CAMERA, sun, WALL.replace("/>", f'><bsdf type="mask">{texture}{wall}</bsdf></shape>'))

    match = r"^scene: bitmap .leaf\.png. has colours where one number is asked"
    message = refusal(render, load_scene_file(masked("")).scene, (4, 4), spp=4, match=match)
    raw = '<boolean name="raw" value="true"/>'
    assert raw in message
    made = render(load_scene_file(masked(raw)).scene, (8, 8), wavelength_nm=[550.0], width_nm=10.0, spp=256)
    opacity = (0.2126 * 200 + 0.7152 * 120 + 0.0722 * 40) / 255
    # 16384 draws of a choice by opacity scatter by 0.8 %; five times that comes by chance once in a million.
    assert made.radiance.mean() == pytest.approx(opacity * 0.5 / np.pi, rel=0.04)


def test_a_cameras_film_and_sampler_may_stand_beside_it(tmp_path: Path) -> None:
    film = CAMERA[CAMERA.index("<film") : CAMERA.index("  <sampler")].strip()
    camera = CAMERA.replace(film, '<ref id="film"/>').replace('<sampler type="independent"/>', '<ref id="draws"/>')
    parts = film.replace("<film", '<film id="film"') + '<sampler type="ldsampler" id="draws"/>'
    opened = load_scene_file(write(tmp_path, parts, camera, SUN))
    assert opened.size == (6, 8)
    assert set(opened.scene.geometry["sensor"]) == {"type", "id", "fov", "to_world"}


@loop("kind", ["distant", "radiancemeter", "batch", "irradiancemeter"])
def test_the_first_camera_that_can_be_rendered_is_taken(kind: str, tmp_path: Path) -> None:
    other = CAMERA.replace("perspective", kind).replace('id="camera"', 'id="other"').replace('value="8"', 'value="80"')
    opened = load_scene_file(write(tmp_path, other, CAMERA.replace("perspective", "orthographic"), SUN))
    assert (opened.size, opened.scene.geometry["sensor"]["type"]) == ((6, 8), "orthographic")
    assert "1 of 2 cameras are left out: 'orthographic', the first that can be" in opened.notes[0]


def test_many_uses_of_one_part_are_kept_as_references(tmp_path: Path) -> None:
    # Written out, 40 levels of two references each would be 10^12 parts.
    doubling = "".join(
        f'<bsdf type="blendbsdf" id="b{i + 1}"><float name="weight" value="0.5"/>'
        f'<ref id="b{i}" name="x"/><ref id="b{i}" name="y"/></bsdf>'
        for i in range(40)
    )
    start = time.perf_counter()
    opened = load_scene_file(write(tmp_path, CAMERA, SUN, '<bsdf type="diffuse" id="b0"/>', doubling))
    assert time.perf_counter() - start < 5
    assert opened.scene.geometry["b40"]["x"] == {"type": "ref", "id": "b39"}


# --- what is refused, with one line


MEDIUM = '<shape type="sphere"><medium type="homogeneous" name="interior"/></shape>'
CLOTH = (
    '<bsdf type="diffuse" id="cloth"><texture type="volume" name="reflectance">'
    '<volume type="gridvolume" name="volume"><string name="filename" value="{}"/></volume></texture></bsdf>'
)
REFUSED = {
    "no light": ([CAMERA, WALL], ["it has no light", "add one"]),
    "no camera": ([SUN], ["camera 'none'", "perspective, thinlens, orthographic"]),
    "part of the camera's key": (
        [CAMERA, SUN, '<shape type="sphere" id="sensor"/>'],
        ["part 'sensor' is not the camera"],
    ),
    "meter as camera": (['<sensor type="irradiancemeter"/>', SUN], ["camera 'irradiancemeter'"]),
    "no camera that can be rendered": (
        [*(CAMERA.replace("perspective", kind).replace("camera", kind) for kind in ("distant", "radiancemeter")), SUN],
        ["camera 'distant', 'radiancemeter'", "perspective, thinlens, orthographic"],
    ),
    "medium": (
        [CAMERA, SUN, MEDIUM],
        ["(line 7", "medium 'interior' of type 'homogeneous' is refused", "plastic or diffuse surface"],
    ),
    "phase function": ([CAMERA, SUN, '<phase type="hg" id="fog"/>'], ["'fog' of type 'hg'", "media aren't simulated"]),
    "polariser": (
        [CAMERA, SUN, '<bsdf type="twosided" id="film"><bsdf type="polarizer" name="inner"/></bsdf>'],
        ["bsdf 'inner' of type 'polarizer'", "polarisation isn't simulated", "nearest: a mask of opacity 0.5"],
    ),
    "polarising plastic": ([CAMERA, SUN, '<bsdf type="pplastic"/>'], ["bsdf type 'pplastic'", "roughplastic"]),
    "projector": (
        [CAMERA, '<emitter type="projector" id="beamer"/>'],
        ["emitter 'beamer' of type 'projector'", "can't be relit", "spot with a texture"],
    ),
    "timed sky": ([CAMERA, '<emitter type="timed_sunsky"/>'], ["'timed_sunsky'", "can't be relit", "nearest: sunsky"]),
    "volumetric primitives": ([CAMERA, SUN, '<shape type="ellipsoids"/>'], ["shape type 'ellipsoids'", "ply"]),
    "unknown plug-in": ([CAMERA, SUN, '<bsdf type="difuse"/>'], ["'difuse'", "did you mean 'diffuse'?"]),
    "memory reader": ([CAMERA, SUN, '<shape type="blender"/>'], ["'blender' is refused", "as ply"]),
    "missing mesh": (
        [CAMERA, SUN, '\n<shape type="obj"><string name="filename" value="no/teapot.obj"/></shape>'],
        ["scene.xml (line 8", "'no/teapot.obj' is missing", "put it there"],
    ),
    "folder as mesh": ([CAMERA, SUN, '<shape type="obj"><string name="filename" value="."/></shape>'], ["a folder"]),
    "missing include": ([CAMERA, SUN, '<include filename="no.xml"/>'], ["'no.xml' is missing"]),
    "unknown element": (["\n\n<spher/>"], ["scene.xml (line 3, col 2)", "<spher>"]),
    "bad number": ([CAMERA.replace('value="20"', 'value="wide"'), SUN], ["(line 3", '"wide"']),
    "undefined parameter": (
        [CAMERA.replace('value="8"', 'value="$side"'), SUN],
        ["undefined parameter: $side", "give it, as -D name=value"],
    ),
    "unknown reference": (
        [CAMERA, SUN, '<bsdf type="diffuse" id="red"/><shape type="sphere"><ref id="rad"/></shape>'],
        ["(line 7", "ref: 'rad' is unknown", "did you mean 'red'?"],
    ),
    "reference to a light": (
        [CAMERA, SUN, '<shape type="sphere"><ref id="sun"/></shape>'],
        ["'sun' points into a light"],
    ),
    "area light without a shape": ([CAMERA, '<emitter type="area" id="lamp"/>'], ["area light 'lamp' is on 0 shapes"]),
    "area light on two shapes": (
        [CAMERA, '<emitter type="area" id="lamp"/>', '<shape type="disk"><ref id="lamp"/></shape>' * 2],
        ["area light 'lamp' is on 2 shapes"],
    ),
    "escaped parameter": ([CAMERA, SUN, r'<default name="a" value="\$b"/>'], ["(line 7", "escaped $"]),
    "undefined parameter in a name": ([CAMERA, SUN, '<include filename="$a.xml"/>'], ["'$a.xml'", "undefined"]),
    "circle": (
        [
            CAMERA,
            SUN,
            '<bsdf type="twosided" id="a"><ref id="b"/></bsdf><bsdf type="twosided" id="b"><ref id="a"/></bsdf>',
        ],
        ["circle"],
    ),
    "long chain": (
        [
            *(CAMERA, SUN, '<bsdf type="diffuse" id="b0"/>'),
            *(f'<bsdf type="twosided" id="b{i + 1}"><ref id="b{i}"/></bsdf>' for i in range(LONGEST_CHAIN)),
        ],
        [f"over {LONGEST_CHAIN} deep"],
    ),
    "two planes": (
        [CAMERA, SUN, *(f'<shape type="disk" id="d{i}"><sensor type="irradiancemeter"/></shape>' for i in (1, 2))],
        ["d1, d2"],
    ),
    "camera in a shape": ([CAMERA, SUN, f'<shape type="disk">{CAMERA.replace("camera", "c2")}</shape>'], ["sensor"]),
    "another plug-in by a property": (
        [CAMERA, SUN, '<shape type="disk"><string name="type" value="evil"/></shape>'],
        ["property name 'type'"],
    ),
    "roulette from the camera": (
        ['<integrator type="path"><integer name="rr_depth" value="0"/></integrator>', CAMERA, SUN],
        ["rr_depth: 0 is outside 1 to"],
    ),
    "missing volume": ([CAMERA, SUN, CLOTH.format("no.vol")], ["'no.vol' is missing"]),
    "volume outside": ([CAMERA, SUN, CLOTH.format("../no.vol")], ["lies outside"]),
    "film of no pixels": ([CAMERA.replace('value="8"', 'value="0"'), SUN], ["film width", "give pixels"]),
}


@loop(("parts", "words"), REFUSED.values())
def test_what_cannot_be_rendered_is_refused_with_place_and_fix(
    parts: list[str], words: list[str], tmp_path: Path
) -> None:
    refusal(load_scene_file, write(tmp_path, *parts), words=words)


NUMBERS = {  # by the name in the message, and how it is written; of the second kind -1 is a number like any other
    "radius": '<shape type="sphere"><float name="radius" value="{}"/></shape>',
    "alpha": '<bsdf type="roughplastic"><float name="alpha" value="{}"/></bsdf>',
    "intensity": '<emitter type="point"><rgb name="intensity" value="1,{},1"/></emitter>',
    "irradiance": '<emitter type="directional"><spectrum name="irradiance" value="400:1,700:{}"/></emitter>',
    "reflectance": '<bsdf type="diffuse"><spectrum name="reflectance" value="{}"/></bsdf>',
    "values": '<texture type="irregular"><string name="wavelengths" value="400,700"/>'
    '<string name="values" value="0.1, {}"/></texture>',
}
SIGNED = {
    "center": '<shape type="sphere"><point name="center" x="0" y="{}" z="0"/></shape>',
    "to_world": '<shape type="sphere"><transform name="to_world"><translate x="{}"/></transform></shape>',
    "scale": '<bsdf type="bumpmap"><float name="scale" value="{}"/><texture type="checkerboard"/></bsdf>',
}


@loop(("name", "part"), [*NUMBERS.items(), *SIGNED.items()])
def test_numbers_that_are_none_or_below_0_are_refused_by_name(name: str, part: str, tmp_path: Path) -> None:
    wrong = ("nan", "inf") if name in SIGNED else ("nan", "inf", "-1")
    for number in wrong:
        words = f": {name}: {number} is not allowed; allowed: finite numbers"
        assert words in told(tmp_path, CAMERA, SUN, part.format(number))
    load_scene_file(write(tmp_path, CAMERA, SUN, part.format("-1" if name in SIGNED else "0.5")))


def test_missing_and_malformed_files_are_named_with_the_line(tmp_path: Path) -> None:
    assert "is missing or no file" in refusal(load_scene_file, tmp_path / "none.xml")
    assert "is missing or no file" in refusal(load_scene_file, tmp_path)
    path = tmp_path / "s.xml"
    for text, words in {
        '<scene version="3.0.0">\n<shape type="sphere">\n</scene>': "(line 3, col 3): not well-formed XML, mismatched",
        "": "no element found",
        "<scene/>": "missing version attribute",
        '<bsdf version="3.0.0" type="diffuse"/>': "its root is 'diffuse'",
    }.items():
        path.write_text(text)
        assert words in refusal(load_scene_file, path)
    path.write_text("<scene version='3.0.0'/>", encoding="utf-16")
    assert "byte 0 is no UTF-8" in refusal(load_scene_file, path)


# --- what is hostile


@pytest.mark.usefixtures("nothing_is_loaded")
def test_native_code_of_a_scenes_own_is_refused_before_it_is_loaded(tmp_path: Path) -> None:
    stock = Path(mitsuba_module().__file__).parent / "plugins" / "sphere.so"
    (tmp_path / "plugins").mkdir()
    shutil.copy(stock, tmp_path / "plugins" / "ball.so")  # native code that does load, as the next test shows
    before = repr(mitsuba_module().file_resolver())
    ball = CAMERA, SUN, '<shape type="ball"/>'
    write(tmp_path, '<path value="."/>', name="in.xml")
    for place in ("", '<path value="."/>', f'<path value="{tmp_path}"/>', '<include filename="in.xml"/>'):
        assert "shape type: 'ball' is unknown" in (words := told(tmp_path, place, *ball))
        assert "--trust-scene" in words
    assert repr(mitsuba_module().file_resolver()) == before
    assert str(tmp_path) not in loaded_libraries()


def test_a_trusted_scene_may_load_native_code_and_files_from_anywhere(tmp_path: Path) -> None:
    stock = Path(mitsuba_module().__file__).parent / "plugins" / "sphere.so"
    (tmp_path / "mine" / "plugins").mkdir(parents=True)
    shutil.copy(stock, tmp_path / "mine" / "plugins" / "ball.so")
    (tmp_path / "quad.obj").write_text(QUAD)
    mesh = f'<shape type="obj" id="quad"><string name="filename" value="{tmp_path}/quad.obj"/></shape>'
    path = write(tmp_path, '<path value="../mine"/>', CAMERA, SUN, mesh, '<shape type="ball"/>', name="a/scene.xml")
    scene = load_scene_file(path, trust=True).scene
    assert scene.geometry["quad"]["filename"] == str((tmp_path / "quad.obj").resolve())
    mitsuba_module().load_dict(scene.description)
    assert str(tmp_path / "mine") in loaded_libraries()


@loop("trust", [False, True])
def test_files_of_a_scene_are_looked_for_in_the_folders_of_its_paths(trust: bool, tmp_path: Path) -> None:
    """Mesh, bitmap, spectrum, include: each in a folder beside the scene; the last <path> goes first."""
    for name, height in (("models", 1), ("later", 2), ("a", 9)):
        (tmp_path / name).mkdir()
        (tmp_path / name / "quad.obj").write_text(QUAD.replace(" 0\n", f" {height}\n"))
    Image.new("RGB", (2, 2), (255, 0, 0)).save(tmp_path / "models" / "p.png")
    (tmp_path / "later" / "r.spd").write_text("380 0.25\n780 0.75\n")
    write(tmp_path / "models", SUN, name="lights/sun.xml")
    cloth = '<texture name="reflectance" type="bitmap"><string name="filename" value="p.png"/></texture>'
    parts = (
        '<default name="place" value="../later"/><path value="../models"/><path value="$place"/>',
        '<include filename="lights/sun.xml"/>',
        CAMERA,
        '<bsdf type="diffuse" id="grey"><spectrum name="reflectance" filename="r.spd"/></bsdf>',
        f'<bsdf type="diffuse" id="red">{cloth}</bsdf>',
        '<shape type="obj" id="quad"><string name="filename" value="quad.obj"/><ref id="red"/></shape>',
    )
    scene = load_scene_file(write(tmp_path / "a", *parts), trust=trust).scene
    assert Path(scene.geometry["quad"]["filename"]).resolve() == tmp_path.resolve() / "later" / "quad.obj"
    assert Path(scene.geometry["red"]["reflectance"]["filename"]).resolve() == tmp_path.resolve() / "models" / "p.png"
    assert scene.geometry["grey"]["reflectance"]["values"] == "0.25,0.75"
    mi = mitsuba_module()
    ours, stock = mi.load_dict(scene.description), mi.load_file(str(tmp_path / "a" / "scene.xml"))
    assert ours.shapes()[0].bbox().min.z == stock.shapes()[0].bbox().min.z == 2
    absent = '<path value="../none"/>'
    assert "<path> folder '../none' is missing" in told(tmp_path / "a", absent, CAMERA, SUN, trust=trust)


def test_a_path_lets_files_of_its_folder_in_and_no_others(tmp_path: Path) -> None:
    for name in ("common", "secret"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "quad.obj").write_text(QUAD)
    (tmp_path / "common" / "link.obj").symlink_to(tmp_path / "secret" / "quad.obj")
    (tmp_path / "a").mkdir()
    mesh = '<shape type="obj" id="quad"><string name="filename" value="{}"/></shape>'
    common = '<path value="../common"/>', CAMERA, SUN
    for name in ("quad.obj", "../common/quad.obj"):
        scene = load_scene_file(write(tmp_path / "a", *common, mesh.format(name))).scene
        assert Path(scene.geometry["quad"]["filename"]).resolve() == (tmp_path / "common" / "quad.obj").resolve()
    for name in ("link.obj", "../secret/quad.obj", str(tmp_path / "secret" / "quad.obj")):
        assert "lies outside the scene's folder and those of its <path>" in told(
            tmp_path / "a", *common, mesh.format(name)
        )


def test_a_stock_name_never_loads_a_file_beside_the_scene(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    # Mitsuba looks for plugins/NAME.so on its search path, in which the working directory comes first.
    monkeypatch.chdir(tmp_path)
    (tmp_path / "plugins").mkdir()
    for name in ("diffuse", "sphere", "principledthin"):
        (tmp_path / "plugins" / f"{name}.so").write_text("hostile")
    mi = mitsuba_module()
    mi.file_resolver().prepend(str(tmp_path))  # as where Mitsuba was imported in this folder
    opened = load_scene_file(write(tmp_path, CAMERA, SUN, '<shape type="sphere"><bsdf type="principledthin"/></shape>'))
    assert render(opened.scene, (4, 4), spp=4).radiance.any()
    with own_mitsuba_variant():
        found = Path(str(mi.file_resolver().resolve("plugins/principledthin.so")))
    assert found == Path(mi.__file__).parent / "plugins" / "principledthin.so"


@pytest.mark.usefixtures("nothing_is_loaded")
@loop(
    "part",
    [
        '<shape type="ply"><string name="filename" value="{0}"/></shape>',
        '<emitter type="envmap"><string name="filename" value="{0}"/></emitter>',
        '<bsdf type="diffuse"><spectrum name="reflectance" filename="{0}"/></bsdf>',
        '<include filename="{0}"/>',
    ],
)
def test_files_outside_the_scenes_folder_are_refused_unread(part: str, tmp_path: Path) -> None:
    secret = tmp_path / "secret.spd"
    secret.write_text("secret words")
    home = tmp_path / "home"
    home.mkdir()
    (home / "link.spd").symlink_to(secret)
    (home / "linked").symlink_to(tmp_path)
    for name in (str(secret), "../secret.spd", "link.spd", "linked/secret.spd", "../missing.spd", "/dev/zero"):
        words = told(home, CAMERA, SUN, part.format(name))
        assert f"file {name!r} lies outside the scene's folder" in words
        assert "--trust-scene" in words
        assert "secret words" not in words
        if "include" not in part and "spectrum" not in part:  # nor by way of a parameter
            hidden = f'<default name="a" value="{name}"/>' + part.format("$a")
            assert f"file {name!r} lies outside" in told(home, CAMERA, SUN, hidden)


@pytest.mark.usefixtures("nothing_is_loaded")
def test_bombs_are_refused_within_a_second(tmp_path: Path) -> None:
    def deep(count: int) -> str:
        return '<bsdf type="twosided">' * count + "</bsdf>" * count

    ten_lines = '<default name="a0" value="0123456789"/>' + "".join(
        f'<default name="a{i + 1}" value="{f"$a{i} " * 10}"/>' for i in range(10)
    )
    write(tmp_path, '<include filename="twice.xml"/><include filename="twice.xml"/>', name="once.xml")
    write(tmp_path, '<include filename="last.xml"/>' * 300, name="twice.xml")
    write(tmp_path, name="last.xml")
    bombs = {
        deep(MOST_NESTED): f"over {MOST_NESTED} deep",
        deep(100_000): f"over {MOST_NESTED} deep",  # which ends Mitsuba's own parser, and the process with it
        ten_lines: "$parameters grow past",
        '<include filename="scene.xml"/>': "deep",
        '<include filename="once.xml"/>': "200 files",
    }
    for text, words in bombs.items():
        start = time.perf_counter()
        assert words in told(tmp_path, text)
        assert time.perf_counter() - start < 1
    path = write(tmp_path, CAMERA, SUN)
    path.write_text('<!DOCTYPE s [<!ENTITY a "evil">]>' + path.read_text().replace("hdrfilm", "&a;"))
    assert "a DOCTYPE is not allowed" in refusal(load_scene_file, path)


# A value of each listed property, and plug-ins of each kind, of which one at least knows it: read from Mitsuba's
# sources at https://github.com/mitsuba-renderer/mitsuba3, and asked of the installed one.
VALUES: dict[str, Any] = {
    "width": 4, "height": 4, "crop_width": 2, "crop_height": 2, "crop_offset_x": 0, "crop_offset_y": 0,
    "file_format": "openexr", "pixel_format": "rgb", "component_format": "float32", "sample_border": False,
    "compensate": False, "banner": False, "sample_count": 16, "seed": 1, "jitter": True, "strength": 2, "radius": 2.0,
    "stddev": 0.5, "lobes": 3, "B": 0.3, "C": 0.3,
}  # fmt: skip
PLUGINS = {
    "film": ("hdrfilm", "specfilm"),
    "sampler": ("independent", "stratified", "multijitter", "orthogonal", "ldsampler"),
    "rfilter": ("box", "tent", "gaussian", "mitchell", "catmullrom", "lanczos"),
}


@pytest.mark.parametrize("kind", PLUGINS)
def test_every_listed_property_of_a_part_that_is_left_out_is_one_of_mitsubas(kind: str) -> None:
    mi, table = mitsuba_module(), formats()[f"Mitsuba {kind} property"]

    def known(plugin: str, **own: Any) -> bool:
        try:
            mi.load_dict({"type": plugin, **own})
        except Exception:  # of any kind
            return False
        return True

    assert not any(known(plugin, no_such_property=1) for plugin in PLUGINS[kind])
    for name in (*table["applied"], *table["refused"], *table["without_effect"]):
        assert any(known(plugin, **{name: VALUES[name]}) for plugin in PLUGINS[kind]), name
