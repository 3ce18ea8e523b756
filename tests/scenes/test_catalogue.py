"""The scenes that the project ships: by name, with options, and lit as their builders promise."""

import numpy as np
import pytest
from loop import loop
from refusal import refusal

from render.engine import render
from render.scene import Scene, walk
from render.surfaces import see_surfaces
from rodcone.digests import digest, digest_inputs
from scenes.catalogue import DRAWN, load, scene_names
from scenes.levels import DEMO_LEVELS
from scenes.materials import metal
from scenes.reflectances import color_checker_reflectances

BANDS_NM = np.arange(405.0, 780.0, 50.0)


LIT_BY_NAME = (
    *("color_checker", "contrast_patches", "cornell_box", "dead_leaves", "flat_field", "metamers", "oecf"),
    *("siemens_star", "slanted_edge", "still_life"),
)


def test_names_are_the_scenes_in_order():
    others = ("diorama", "furnace", "generated", "lit_and_shadowed", "night_street", "still_life_outdoor", "walker")
    assert scene_names() == tuple(sorted((*LIT_BY_NAME, *others)))


def nodes(node):
    """All nodes of a scene's dict, the scene itself first."""
    yield node
    for value in node.values():
        if isinstance(value, dict):
            yield from nodes(value)


@loop("name", scene_names())
def test_every_scene_keeps_compiling_quick_by_one_grid_and_few_kinds_of_material(name):
    spectra = [node for node in nodes(load(name).geometry) if node.get("type") in ("regular", "irregular", "uniform")]
    grids = {
        (node["type"], node["wavelength_min"], node["wavelength_max"], node["values"].count(",")) for node in spectra
    }
    far = name == "color_checker"  # for studies of the near infrared
    assert grids == {("regular", 380.0, 1100.0, 144) if far else ("regular", 380.0, 780.0, 80)}
    kinds = {node["type"] for node in nodes(load(name).geometry)}
    plugins = {"twosided", "diffuse", "roughplastic", "roughconductor", "dielectric", "checkerboard"}
    plugins |= {"blendbsdf", "bitmap"}
    shapes = {"rectangle", "cube", "sphere", "cylinder", "disk"}
    assert kinds <= plugins | shapes | {"scene", "perspective", "hdrfilm", "regular", "area", "constant"}


@loop("name", scene_names())
def test_every_scene_loads_under_its_own_name_with_a_light_and_a_reference_plane(name):
    scene = load(name)
    assert isinstance(scene, Scene)
    assert scene.name == name
    assert scene.groups
    assert all(group.power > 0 for group in scene.groups.values())
    assert scene.reference_plane in scene.geometry
    assert scene.geometry["sensor"]["type"] == "perspective"


@loop("name", LIT_BY_NAME)
def test_every_scene_of_one_light_takes_it_by_name(name):
    (warm,), (cold,) = load(name, light="A").groups.values(), load(name, light="D65").groups.values()
    red, blue = (warm.spectrum.band_average(nm, 20.0) / cold.spectrum.band_average(nm, 20.0) for nm in (650.0, 450.0))
    assert red > 1.3 * blue
    assert warm.power == cold.power


@loop("family", DRAWN)
def test_a_drawn_scene_is_its_seed_s_and_no_other(family):
    assert digest(load(f"{family}-1f3a")) == digest(load(family, seed=0x1F3A))
    assert load(f"{family}-1f3a").name == f"{family}-1f3a"
    assert digest(load(f"{family}-1f3a").geometry) != digest(load(f"{family}-1f3b").geometry)
    hashed = "c0ffee" * 6 + "abcd"  # as long as a commit's hash
    assert load(f"{family}-{hashed}").name == f"{family}-{hashed}"
    assert f"'{family}-c0ffeeh'" in refusal(load, f"{family}-c0ffeeh")
    assert refusal(load, family, seed=-1).startswith("seed: -1 is outside 0 to")


def test_a_generated_scene_is_the_one_that_the_benchmark_froze():
    assert digest_inputs(load("generated-1f3a").geometry) == "0c75ef3c3496cec384c6af89eea862af"


@loop(("name", "nearest"), [("still_live", "still_life"), ("flatfield", "flat_field")])
def test_an_unknown_scene_is_refused_and_the_nearest_named(name, nearest):
    text = refusal(load, name)
    assert text.startswith(f"scene: {name!r} is unknown; allowed: {', '.join(scene_names())}")
    assert text.endswith(f"did you mean {nearest!r}?")


def test_an_unknown_option_is_refused_and_the_nearest_named():
    text = refusal(load, "flat_field", reflectence=0.3)
    assert text.startswith("scene flat_field: option: 'reflectence' is unknown; allowed: light, reflectance")
    assert text.endswith("did you mean 'reflectance'?")


def test_an_unknown_light_is_refused():
    assert refusal(load, "still_life", light="D66").startswith("illuminant: 'D66' is unknown")


@loop("value", [-0.1, 1.01, np.nan, np.inf])
@loop(("name", "option"), [("flat_field", "reflectance"), ("color_checker", "surround")])
def test_a_reflectance_outside_zero_to_one_is_refused_with_its_value(name, option, value):
    assert refusal(load, name, **{option: value}).startswith(f"{option}: {value!r} is outside 0 to 1")


@loop(
    ("name", "options", "start"),
    [
        ("slanted_edge", {"contrast": 0.5}, "contrast: 0.5 is outside 1 to 1e+06"),
        ("slanted_edge", {"angle_deg": 60.0}, "angle_deg: 60.0 is outside -45 to 45"),
        ("oecf", {"patches": 3}, "patches: 3 is outside 4 to 36"),
        ("oecf", {"contrast": 0.5}, "contrast: 0.5 is outside 1 to 1e+06"),
        ("dead_leaves", {"seed": -1}, "seed: -1 is outside 0 to"),
        ("siemens_star", {"spokes": 1}, "spokes: 1 is outside 2 to 720"),
        ("siemens_star", {"spokes": 7.5}, "spokes: 7.5 is not a whole number"),
        ("lit_and_shadowed", {"dark_cd_m2": -1.0}, "dark_cd_m2: -1.0 is outside 0 to 1e+09"),
        ("lit_and_shadowed", {"lit_cd_m2": np.nan}, "lit_cd_m2: nan is outside 0 to 1e+09"),
    ],
)
def test_an_option_out_of_range_is_refused_with_its_value(name, options, start):
    assert refusal(load, name, **options).startswith(start)


def test_the_chart_has_24_reflectances_that_rise_along_its_grey_row():
    patches = color_checker_reflectances()
    assert len({name for name, _ in patches}) == 24
    assert all(curve.values.min() >= 0 and curve.values.max() <= 1 for _, curve in patches)
    greys = np.array([curve.band_average(550.0, 100.0) for _, curve in patches[18:]])
    assert (np.diff(greys) < 0).all()
    assert greys == pytest.approx([0.90, 0.59, 0.36, 0.20, 0.09, 0.03], abs=0.03)  # densities 0.05 to 1.50


def test_demo_levels_rise_from_moonlight_to_daylight_and_name_their_sources():
    levels = [level.luminance_cd_m2 for level in DEMO_LEVELS]
    assert len(levels) == 7
    assert (np.diff(levels) > 0).all()
    assert levels[0] == 0.036
    assert levels[3] == 25.0
    assert levels[-1] == pytest.approx(1e5 * 0.18 / np.pi)
    assert all(level.source for level in DEMO_LEVELS)


@pytest.mark.slow
@pytest.mark.parametrize("name", scene_names())
def test_every_scene_renders_in_every_band_with_light_from_each_of_its_groups(name):
    made = render(load(name), (24, 24), wavelength_nm=BANDS_NM[::2], width_nm=50.0, spp=16)
    assert np.isfinite(made.radiance).all()
    assert made.radiance.min() >= 0
    assert (made.radiance.max(axis=(2, 3)) > 0).all()
    assert (made.irradiance > 0).any()
    assert made.relight().luminance().max() > 0


@loop(
    ("material", "nm", "reflectance"),
    [("Cu", 450.0, 0.55), ("Cu", 650.0, 0.93), ("Au", 450.0, 0.39), ("Au", 650.0, 0.96), ("Al", 550.0, 0.92)],
)  # at normal incidence: CRC Handbook of Chemistry and Physics, optical properties of selected elements
def test_a_metal_reflects_as_its_handbook_says(material, nm, reflectance):
    bsdf = metal(material, 0.2)["bsdf"]
    at = [float(bsdf[part]["values"].split(",")[round((nm - 380) / 5)]) for part in ("eta", "k")]
    index = complex(*at)
    assert abs((index - 1) / (index + 1)) ** 2 == pytest.approx(reflectance, abs=0.05)  # Fresnel; samples differ


# Streets, rooms and tables drawn from a number: two hundred of them, and the ground that a street stands on.


@pytest.mark.sample(1)
@pytest.mark.parametrize("count", [50, 200])
def test_dioramas_are_lit_and_differ(count):
    scenes = [load(f"diorama-{seed:x}") for seed in range(1, count + 1)]
    assert len({digest(scene.geometry) for scene in scenes}) == count
    kinds = [next(kind for kind in ("pole0", "ceiling", "table") if kind in scene.geometry) for scene in scenes]
    assert min(kinds.count(kind) for kind in set(kinds)) > count / 6
    assert len(set(kinds)) == 3
    lights = {name for scene in scenes for name in scene.groups}
    assert lights == {"sun", "sky", "window", "lamps0", "lamps1", "panes"}
    assert all(group.power > 0 for scene in scenes for group in scene.groups.values())


def test_a_diorama_names_its_pictures_alike_on_every_machine():
    parts = (node for seed in range(9) for _, node in walk(load("diorama", seed=seed).geometry))
    files = {node["filename"] for node in parts if "filename" in node}
    assert files
    assert all(name.startswith("skimage/data/") for name in files)


def test_the_ground_of_a_street_is_a_plane_that_faces_up():
    scene = next(x for x in (load("diorama", seed=seed) for seed in range(99)) if "pole0" in x.geometry)
    rows, columns = 48, 64
    seen = see_surfaces(scene, (rows, columns))
    to_world = np.array(scene.geometry["sensor"]["to_world"], dtype=float)
    row, column = np.nonzero(seen.object_id == seen.objects.index("ground") + 1)
    assert row.size > 100
    # Mitsuba's camera has x to the left and y up; the field of view is over the shorter side.
    half = np.tan(np.radians(scene.geometry["sensor"]["fov"] / 2)) / (rows / 2)
    across, up = (columns / 2 - column - 0.5) * half, (rows / 2 - row - 0.5) * half
    places = seen.depth_m[row, column] * np.stack([across, up, np.ones(row.size)])
    heights = (to_world @ np.vstack([places, np.ones(row.size)]))[1]
    np.testing.assert_allclose(heights, 0.0, atol=1e-4 * seen.depth_m.max())
    normals = seen.normal[row, column] * [-1, -1, 1] @ to_world[:3, :3].T
    np.testing.assert_allclose(normals, [[0.0, 1.0, 0.0]] * row.size, atol=1e-5)
