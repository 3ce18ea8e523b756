"""Every kind of surface, slide and camera that goes along, in small XML scenes, against Mitsuba's own `path`.

Two walls of one paint under two lamps, four segments deep, in two groups of four bands. Welch's t-test of the picture's
mean in each band, over renders of different seeds on both sides. All comparisons of this file together fail by chance
with probability `FALSE_ALARM` at most (Bonferroni); seeds are fixed. A bias of `CAUGHT` would be noticed nine times out
of ten.
"""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from scipy.stats import norm
from scipy.stats import t as student
from stock_mitsuba import picture_of_file, spectral_film, write_bitmap

from render.engine import render
from render.loader import Film, load_groups, mitsuba_module
from render.user_scene.scene_file import load_scene_file

FALSE_ALARM, CAUGHT = 1e-4, 0.04
BANDS_NM, WIDTH_NM, DEPTH = np.linspace(400.0, 750.0, 8), 40.0, 4
DRAWS, SPP = 8, 576

PICTURE = '<string name="filename" value="p.png"/>'
GREY = '<texture name="{}" type="bitmap"><string name="filename" value="g.png"/></texture>'
BITMAP = f'<texture name="reflectance" type="bitmap">{PICTURE}</texture>'
COLOUR = '<rgb name="{}" value="0.6 0.3 0.1"/>'
RGB = COLOUR.format("reflectance")
POINTS = '<spectrum name="{}" value="370:0.2, 500:0.7, 790:0.3"/>'
CHECKS = '<texture name="reflectance" type="checkerboard">{}{}</texture>'
EVEN = '<spectrum name="{}" value="370:{}, 790:{}"/>'


RED_CLOTH = f'<bsdf type="diffuse">{RGB}</bsdf>'
ROUGH = '<float name="alpha" value="0.4"/>'


def paint(kind: str, parts: str) -> str:
    return f'<bsdf type="{kind}" id="paint">{parts}</bsdf>'


def plugin(kind: str, parts: str) -> str:
    return f'<spectrum name="reflectance" type="{kind}">{parts}</spectrum>'


REFLECTANCES = {
    "rgb": RGB,
    "srgb": plugin("srgb", COLOUR.format("color")),
    "uniform": '<spectrum name="reflectance" value="0.6"/>',
    "float": '<float name="reflectance" value="0.6"/>',
    "rawconstant": '<texture name="reflectance" type="rawconstant"><float name="value" value="0.6"/></texture>',
    "regular": plugin(
        "regular",
        '<float name="wavelength_min" value="370"/><float name="wavelength_max" value="790"/>'
        '<string name="values" value="0.2, 0.8, 0.4"/>',
    ),
    "irregular": plugin(
        "irregular", '<string name="wavelengths" value="370, 500, 790"/><string name="values" value="0.2, 0.7, 0.3"/>'
    ),
    "points": POINTS.format("reflectance"),
    "file": '<spectrum name="reflectance" filename="r.spd"/>',
    "d65": plugin("d65", '<float name="scale" value="0.5"/>'),
    "tinted d65": plugin("d65", COLOUR.format("color")),
    "blackbody": plugin("blackbody", '<float name="temperature" value="1200"/>'),
    "bitmap": BITMAP,
    "mesh attribute": '<texture name="reflectance" type="mesh_attribute"><string name="name" value="vertex_color"/>'
    "</texture>",
    "reference": '<ref id="cloth" name="reflectance"/>',
    "checkerboard": CHECKS.format(COLOUR.format("color0"), POINTS.format("color1")),
    "checkerboard of tables": CHECKS.format(EVEN.format("color0", 0.7, 0.1), EVEN.format("color1", 0.2, 0.7)),
}
IN_ROWS = (
    "regular",
    "irregular",
    "points",
    "file",
    "checkerboard of tables",
)  # read from the engine's own table of reflectances

PAINTS = {name: f'<bsdf type="diffuse" id="paint">{node}</bsdf>' for name, node in REFLECTANCES.items()} | {
    "two-sided rgb": f'<bsdf type="twosided" id="paint"><bsdf type="diffuse">{RGB}</bsdf></bsdf>',
    "textured rough plastic": '<bsdf type="roughplastic" id="paint">'
    f'<texture name="diffuse_reflectance" type="bitmap">{PICTURE}</texture></bsdf>',
    "blend": f'<bsdf type="blendbsdf" id="paint"><float name="weight" value="0.4"/><bsdf type="diffuse">{RGB}</bsdf>'
    f'<bsdf type="diffuse">{BITMAP}</bsdf></bsdf>',
}
SURFACES = {
    "volume": paint(
        "diffuse",
        '<texture name="reflectance" type="volume"><volume name="volume" type="gridvolume">'
        '<string name="filename" value="v.vol"/></volume></texture>',
    ),
    "indices of a metal as rgb": paint(
        "roughconductor",
        '<rgb name="eta" value="0.2 0.9 1.2"/><rgb name="k" value="3.5 2.5 2"/><float name="alpha" value="0.4"/>',
    ),
    "tinted metal": paint("roughconductor", COLOUR.format("specular_reflectance") + ROUGH),
    "plastic": paint("plastic", COLOUR.format("diffuse_reflectance") + '<boolean name="nonlinear" value="true"/>'),
    "rough glass": paint("roughdielectric", COLOUR.format("specular_reflectance") + ROUGH),
    "principled": paint("principled", COLOUR.format("base_color") + '<float name="metallic" value="0.3"/>'),
    "principled of a picture": paint(
        "principled", f'<texture name="base_color" type="bitmap">{PICTURE}</texture><float name="sheen" value="0.5"/>'
    ),
    "thin principled": paint("principledthin", POINTS.format("base_color") + '<float name="diff_trans" value="0.6"/>'),
    "mask": paint("mask", GREY.format("opacity") + RED_CLOTH),
    "bumps": paint("bumpmap", GREY.format("arbitrary") + RED_CLOTH),
    "normals": paint(
        "normalmap",
        f'<texture name="normalmap" type="bitmap">{PICTURE}<boolean name="raw" value="true"/></texture>{RED_CLOTH}',
    ),
    "measured": paint("measured", '<string name="filename" value="m.bsdf"/>'),
    "two sides": paint("twosided", RED_CLOTH + '<bsdf type="plastic"/>'),
}
# The second lamp as the first: one light group of one spectrum. Another: a coloured group, without rows.
LAMPS = {"one spectrum": (3, 3), "coloured": (3, 1)}

LOOK = '<transform name="to_world"><lookat origin="0, 1.2, 3" target="0, -0.3, 0" up="0, 1, 0"/></transform>'
PERSPECTIVE = f'<sensor type="perspective"><float name="fov" value="40"/>{LOOK}FILM</sensor>'
CAMERAS = {
    "focal length": f'<sensor type="perspective"><string name="focal_length" value="35mm"/>{LOOK}FILM</sensor>',
    "thin lens": f'<sensor type="thinlens"><float name="fov" value="40"/>{LOOK}FILM'
    '<float name="aperture_radius" value="0.2"/><float name="focus_distance" value="3"/></sensor>',
    "orthographic": f'<sensor type="orthographic">{LOOK}FILM</sensor>',
}
SPOT = (
    '<emitter type="spot" id="lamp:0"><float name="cutoff_angle" value="40"/>{}{}<transform name="to_world">'
    '<lookat origin="0.5, 0.5, 3" target="0, -0.3, 0" up="0, 1, 0"/></transform></emitter>'
)
SLIDE = f'<texture name="texture" type="bitmap">{PICTURE}</texture>'
RED = '<spectrum name="intensity" value="370:0, 600:0, 610:{0}, 790:{0}"/>'
LIGHTS = {
    "slide": SPOT.format(SLIDE, '<spectrum name="intensity" value="3"/>'),
    "slide in coloured light": SPOT.format(SLIDE, COLOUR.format("intensity")),
    # A group of its own colours, dark in the first four bands.
    "red lamps": "".join(SPOT.replace(":0", f":{index}").format("", RED.format(index + 1)) for index in range(2)),
}
SCENES = {camera: (CAMERAS[camera], "") for camera in CAMERAS} | {
    light: (PERSPECTIVE, LIGHTS[light]) for light in LIGHTS
}
ROULETTE = 1, 2, 1 << 30
COMPARISONS = (len(PAINTS) * len(LAMPS) + len(SURFACES) + len(SCENES) + len(ROULETTE)) * BANDS_NM.size


def wall(place: str) -> str:
    """Quad of 4 m with texture coordinates and a colour at each corner."""
    return (
        f'<shape type="ply"><string name="filename" value="q.ply"/><ref id="paint"/>'
        f'<transform name="to_world"><scale value="2"/>{place}</transform></shape>'
    )


def lamp(index: int, value: float) -> str:
    return (
        f'<emitter type="point" id="lamp:{index}"><point name="position" x="{1.6 * index - 0.8}" y="1" z="1.5"/>'
        f'<spectrum name="intensity" value="{value}"/></emitter>'
    )


# Stock Mitsuba drops the light of a path that meets nothing but masks and then leaves a scene without environment.
BLACK_ROOM = (
    '<shape type="sphere"><float name="radius" value="20"/><boolean name="flip_normals" value="true"/>'
    '<bsdf type="diffuse"><spectrum name="reflectance" value="0"/></bsdf></shape>'
)
FILM = spectral_film((6, 8), BANDS_NM, WIDTH_NM)


def write_scene(folder: Path, paint: str, lights: str, camera: str = PERSPECTIVE) -> Path:
    pixels = write_bitmap(folder / "p.png")
    Image.fromarray(pixels[:, :, 0]).save(folder / "g.png")
    grid = np.random.default_rng(6).uniform(0.2, 0.8, (4, 4, 4, 3)).astype("<f4")
    head = b"VOL\x03" + np.array([1, 4, 4, 4, 3], "<i4").tobytes() + np.array([0, 0, 0, 1, 1, 1], "<f4").tobytes()
    (folder / "v.vol").write_bytes(head + grid.tobytes())
    write_measured(folder / "m.bsdf")
    (folder / "r.spd").write_text("370 0.2\n500 0.7\n790 0.3\n")
    (folder / "q.ply").write_text(
        "ply\nformat ascii 1.0\nelement vertex 4\n"
        + "".join(f"property float {name}\n" for name in "xyzstrgb")
        + "element face 2\nproperty list uchar int vertex_indices\nend_header\n"
        "-1 -1 0 0 0 .8 .2 .1\n1 -1 0 1 0 .2 .7 .3\n1 1 0 1 1 .2 .2 .6\n-1 1 0 0 1 .5 .5 .5\n3 0 1 2\n3 0 2 3\n"
    )
    path = folder / "scene.xml"
    path.write_text(
        f'<scene version="3.0.0"><integrator type="path"><integer name="max_depth" value="{DEPTH}"/></integrator>'
        f"{camera.replace('FILM', FILM)}"
        f'<texture type="bitmap" id="cloth">{PICTURE}</texture>{paint}'
        f'{wall("")}{wall("""<rotate x="1" angle="-90"/><translate y="-1"/>""")}'
        f"{lights}{BLACK_ROOM}</scene>"
    )
    return path


def write_measured(path: Path) -> None:
    """Made-up measured surface in the tensor file of Dupuy and Jakob (2018): even in angle of the half vector."""
    fields = {name: np.ones((1, 4, 8, 8), np.float32) for name in ("vndf", "luminance")}
    fields |= {name: np.ones((8, 8), np.float32) for name in ("ndf", "sigma")}
    fields |= {"theta_i": np.linspace(0, 1.5, 4, dtype=np.float32), "phi_i": np.zeros(1, np.float32)}
    fields |= {"wavelengths": np.linspace(360, 830, 6, dtype=np.float32)}
    fields |= {"spectra": np.random.default_rng(7).uniform(0.1, 0.5, (1, 4, 6, 8, 8)).astype(np.float32)}
    fields |= {"jacobian": np.ones(1, np.uint8), "description": "made up"}
    mitsuba_module().tensor_io.write(str(path), **fields)


def stock(path: Path) -> np.ndarray:
    """Means over the picture of Mitsuba's own renders of the file, (draw, band)."""
    made = [picture_of_file(path, 4 * SPP, seed=10_000 + k) for k in range(DRAWS)]
    return np.stack([picture.mean(axis=(0, 1)) for picture in made]) / WIDTH_NM


@pytest.mark.thorough
@pytest.mark.parametrize("lamps", LAMPS)
@pytest.mark.parametrize("paint", PAINTS)
def test_each_kind_of_reflectance_renders_as_in_stock_mitsuba(paint: str, lamps: str, tmp_path: Path) -> None:
    lights = "".join(lamp(index, value) for index, value in enumerate(LAMPS[lamps]))
    compare(write_scene(tmp_path, PAINTS[paint], lights), rows=lamps == "one spectrum" and paint in IN_ROWS)


@pytest.mark.thorough
@pytest.mark.parametrize("surface", SURFACES)
def test_each_kind_of_surface_renders_as_in_stock_mitsuba(surface: str, tmp_path: Path) -> None:
    lights = "".join(lamp(index, 3) for index in range(2))
    compare(write_scene(tmp_path, SURFACES[surface], lights), rows=False)


@pytest.mark.thorough
@pytest.mark.parametrize("scene", SCENES)
def test_each_kind_of_camera_and_slide_renders_as_in_stock_mitsuba(scene: str, tmp_path: Path) -> None:
    camera, lights = SCENES[scene]
    lights = lights or "".join(lamp(index, 3) for index in range(2))
    compare(write_scene(tmp_path, PAINTS["points"], lights, camera), rows=scene in CAMERAS)


@pytest.mark.thorough
@pytest.mark.parametrize("rr_depth", ROULETTE)
def test_roulette_from_the_depth_that_a_file_states_renders_as_in_stock_mitsuba(rr_depth: int, tmp_path: Path) -> None:
    path = write_scene(tmp_path, PAINTS["points"], "".join(lamp(index, 3) for index in range(2)))
    depth = f'<integer name="max_depth" value="{DEPTH}"/>'
    path.write_text(path.read_text().replace(depth, f'{depth}<integer name="rr_depth" value="{rr_depth}"/>'))
    compare(path, rows=True)


def compare(path: Path, rows: bool) -> None:
    """Welch's t-test of each band against stock Mitsuba."""
    opened = load_scene_file(path)
    film = Film(opened.size, BANDS_NM, np.full(BANDS_NM.size, WIDTH_NM), DEPTH)
    assert [bool(unit.curves) for unit in load_groups(opened.scene, film)] == [rows]
    made = [
        render(
            opened.scene, opened.size, wavelength_nm=BANDS_NM, width_nm=WIDTH_NM, max_depth=DEPTH, spp=SPP, seed=seed
        )
        for seed in range(DRAWS)
    ]
    drawn = [transport.relight().values.mean(axis=(0, 1), dtype=np.float64) for transport in made]
    ours, theirs = np.stack(drawn), stock(path)
    parts = [draws.var(axis=0, ddof=1) / len(draws) for draws in (ours, theirs)]
    error = np.sqrt(parts[0] + parts[1])
    freedom = (DRAWS - 1) * error**4 / np.maximum(parts[0] ** 2 + parts[1] ** 2, np.finfo(float).tiny)
    level = FALSE_ALARM / COMPARISONS / 2
    off = np.abs(ours.mean(axis=0) - theirs.mean(axis=0))
    assert np.all(off <= np.where(error > 0, student.isf(level, freedom) * error, 0))
    lit = theirs.mean(axis=0) > 0
    caught = ((student.isf(level, freedom) + norm.ppf(0.9)) * error)[lit] / theirs.mean(axis=0)[lit]
    assert np.median(caught) < CAUGHT
