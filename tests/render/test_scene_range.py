"""Bands beyond what a scene's surfaces and lights are known over: refused, held or told; closed forms beside them."""

import warnings
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from loop import loop
from PIL import Image
from refusal import refusal

from render.engine import render
from render.geometry import look_at, to_world
from render.scene import LightGroup, Node, Scene, spectrum_node, uniform_node
from render.scene_range import check_range, warn_of_coloured_lights, warn_of_dark_ends
from render.spectrum import DEFAULT_WAVELENGTH_NM, Spectrum, flat
from scenes.catalogue import load
from scenes.catalogue import scene_names as scenes

SHORT = Spectrum(np.array([400.0, 550.0, 700.0]), np.array([0.2, 0.8, 0.4]))
EVEN, UNEVEN = spectrum_node(SHORT), spectrum_node(Spectrum(np.array([400.0, 500.0, 700.0]), SHORT.values))
WALL_NM = np.array([385.0, 475.0, 625.0, 775.0])  # of bands 10 nm wide: outside, inside twice, outside


def wall(bsdf: Node, light: Spectrum | None = None, **parts: Any) -> Scene:
    """Quad that fills the picture under a sun at normal incidence of 1 W m^-2 nm^-1, or another light."""
    geometry = {
        "type": "scene",
        "sensor": {"type": "perspective", "fov": 20.0, "to_world": to_world(look_at((0, 0, 4), (0, 0, 0)))},
        "wall": {"type": "rectangle", "bsdf": bsdf},
        "sun": {"type": "directional", "direction": [0.0, 0.0, -1.0]},
        **parts,
    }
    return Scene("wall", geometry, {"sun": LightGroup(("sun",), light or flat())})


def matte(reflectance: Any) -> Node:
    return {"type": "twosided", "bsdf": {"type": "diffuse", "reflectance": reflectance}}


def radiance(scene: Scene) -> np.ndarray:
    """Mean over the picture in the four bands."""
    made = render(scene, (4, 4), wavelength_nm=WALL_NM, width_nm=10.0, spp=16, max_depth=2)
    return np.asarray(made.relight().values.mean(axis=(0, 1), dtype=np.float64))


# --- surfaces


CHECKS = {"type": "checkerboard", "color0": uniform_node(0.5), "color1": UNEVEN}
FILTER = {"type": "thindielectric", "specular_transmittance": EVEN}
D65 = {"type": "d65"}
ENDING = {
    "even table": (matte(EVEN), "wall/bsdf/bsdf/reflectance", 400, 700),
    "uneven table": (matte(UNEVEN), "wall/bsdf/bsdf/reflectance", 400, 700),
    "blanks between": (
        matte({"type": "irregular", "wavelengths": "390 700", "values": "0.1 0.2"}),
        "wall/bsdf/bsdf/reflectance",
        *(390, 700),
    ),
    "part of a texture": (matte(CHECKS), "wall/bsdf/bsdf/reflectance/color1", 400, 700),
    "transmittance": (FILTER, "wall/bsdf/specular_transmittance", 400, 700),
    "reference": (matte({"type": "ref", "id": "paint"}), "wall/bsdf/bsdf/reflectance", 400, 700),
    "metal by name": ({"type": "roughconductor", "material": "Li"}, "wall/bsdf", 306.123, 751.394),
    "index of a metal": ({"type": "conductor", "eta": EVEN, "k": uniform_node(1.0)}, "wall/bsdf/eta", 400, 700),
}


@loop(("bsdf", "path", "low", "high"), ENDING.values())
def test_bands_beyond_a_surfaces_data_are_refused_and_it_is_named(
    bsdf: Node, path: str, low: float, high: float
) -> None:
    scene = wall(bsdf, paint=EVEN)
    check_range(scene, np.ceil(low), np.floor(high))
    for ends in ((low - 0.5, high - 1.0), (low + 1.0, high + 0.5), (380.0, 780.0)):
        assert refusal(check_range, scene, *ends) == (
            f"scene wall: bands reach {ends[0]:g}-{ends[1]:g} nm, and {path} is known over {low:g}-{high:g} nm alone; "
            "give bands within, or hold its end values beyond: extend='hold' or --extend hold"
        )
    check_range(replace(scene, extend="hold"), 100.0, 20_000.0)


def test_mitsubas_own_lights_as_reflectance_are_known_over_the_cie_range() -> None:
    """Outside 360-830 nm Mitsuba gives 0, and there is no table whose ends could be held."""
    check_range(wall(matte(D65)), 360.0, 830.0)
    refusal(check_range, wall(matte(D65)), 380.0, 831.0, match=r"known over 360-830 nm alone; give bands within$")


@loop(
    "bsdf",
    [
        matte(uniform_node(0.5)),
        matte({"type": "rgb", "value": [0.6, 0.3, 0.1]}),
        matte({"type": "bitmap", "filename": "p.png"}),
        {"type": "roughconductor", "material": "none"},
        {"type": "diffuse"},
    ],
)
def test_what_mitsuba_knows_at_every_wavelength_is_never_refused(bsdf: Node) -> None:
    check_range(wall(bsdf), 300.0, 1100.0)


def test_a_table_that_only_a_light_refers_to_is_no_surface() -> None:
    lit = wall(matte(uniform_node(0.5)), tint=EVEN)
    panel = {"type": "rectangle", "emitter": {"type": "area", "radiance": {"type": "ref", "id": "tint"}}}
    group = LightGroup(("panel/emitter",), flat(), coloured=True)
    groups = {**lit.groups, "panel": group}
    check_range(Scene("wall", lit.geometry | {"panel": panel}, groups), 380.0, 780.0)


@loop("reflectance", [EVEN, UNEVEN])
@loop("rows", [True, False])
def test_held_ends_go_on_in_the_picture(reflectance: Node, rows: bool) -> None:
    """Diffuse under collimated irradiance E at normal incidence: L = rho E / pi, rho averaged over each band."""
    scene = wall(matte(reflectance))
    if not rows:  # a coloured light is evaluated wavelength by wavelength
        sun = scene.geometry["sun"] | {"irradiance": uniform_node(1.0)}
        groups = {"sun": LightGroup(("sun",), flat(), coloured=True)}
        scene = Scene("wall", scene.geometry | {"sun": sun}, groups)
    inside = {id(EVEN): (0.5, 0.6), id(UNEVEN): (0.65, 0.55)}[id(reflectance)]
    found = radiance(replace(scene, extend="hold"))
    assert found * np.pi == pytest.approx([0.2, *inside, 0.4], rel=2e-3)  # wavelengths jittered within 10 nm


@loop(
    ("table", "words"),
    [
        ({"type": "irregular", "wavelengths": "400, blue", "values": "1, 2"}, "'blue'"),
        ({"type": "irregular", "wavelengths": "400, 300", "values": "1, 2"}, "strictly increasing"),
        ({"type": "regular", "wavelength_min": "far", "wavelength_max": 700.0, "values": "1, 2"}, "'far'"),
        ({"type": "regular", "wavelength_min": 400.0, "wavelength_max": 700.0, "values": "1"}, "two or more"),
    ],
)
def test_a_table_that_is_none_is_refused_in_one_line(table: Node, words: str) -> None:
    assert "give numbers, separated by commas" in refusal(check_range, wall(matte(table)), 400.0, 700.0, match=words)


# --- lights


def told(lights: Scene | Spectrum, low: float, high: float) -> list[str]:
    """Warnings about a spectrum, or about a scene's coloured lights, for one band."""
    band = np.array([(low + high) / 2]), np.array([high - low])
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        if isinstance(lights, Scene):
            warn_of_coloured_lights(lights, *band)
        else:
            warn_of_dark_ends("lamp", lights, *band)
    assert all(warning.category is UserWarning for warning in caught)
    return [str(warning.message) for warning in caught]


def test_a_light_is_dark_outside_its_table_and_a_warning_tells() -> None:
    scene = wall(matte(uniform_node(0.5)), SHORT)
    with pytest.warns(
        UserWarning,
        match=r"^light group 'sun' is known over 400-700 nm, and bands reach 380-780 nm: outside its "
        "table it is taken as dark$",
    ):
        found = radiance(scene)
    assert found[[0, 3]].tolist() == [0.0, 0.0]
    assert found[1:3] * np.pi == pytest.approx([0.25, 0.3], rel=1e-6)
    assert told(SHORT, 400.0, 700.0) == []
    assert len(told(SHORT, 399.0, 700.0)) == len(told(SHORT, 400.0, 701.0)) == 1


def test_a_table_that_ends_at_zero_is_dark_beyond_by_itself() -> None:
    line = Spectrum(np.array([588.0, 589.0, 590.0]), np.array([0.0, 2.0, 0.0]))
    assert told(line, 380.0, 780.0) == []
    rising = Spectrum(np.array([400.0, 700.0]), np.array([0.0, 2.0]))
    assert told(rising, 380.0, 700.0) == []
    assert len(told(rising, 380.0, 780.0)) == 1


def test_a_light_of_its_own_colour_tells_of_the_tables_in_it(tmp_path: Path) -> None:
    Image.new("RGB", (2, 2), (200, 120, 40)).save(tmp_path / "p.png")
    bare = wall(matte(uniform_node(0.5))).geometry
    for radiance_of, beyond_nm, known in (
        (EVEN, 701.0, "400-700"),
        ({"type": "rgb", "value": [1.0, 2.0, 3.0]}, 831.0, "360-830"),
        ({"type": "checkerboard", "color0": uniform_node(1.0), "color1": UNEVEN}, 701.0, "400-700"),
        ({"type": "bitmap", "filename": str(tmp_path / "p.png")}, 1000.0, None),
    ):
        panel = {"type": "rectangle", "emitter": {"type": "area", "radiance": radiance_of}}
        geometry = {key: part for key, part in bare.items() if key != "sun"} | {"panel": panel}
        scene = Scene("wall", geometry, {"panel": LightGroup(("panel/emitter",), flat(), coloured=True)})
        assert told(scene, 400.0, 700.0) == []
        expected = f"scene wall: light 'panel/emitter' is known over {known} nm, and bands reach 400-{beyond_nm:g} nm"
        assert [text[: len(expected)] for text in told(scene, 400.0, beyond_nm)] == ([expected] if known else [])


def test_a_light_exchanged_after_the_render_tells_too() -> None:
    made = render(wall(matte(uniform_node(0.5))), (2, 2), wavelength_nm=WALL_NM, width_nm=10.0, spp=2, max_depth=2)
    made.relight({"sun": "D65"})
    with pytest.warns(UserWarning, match="light group 'sun' is known over 400-700 nm, and bands reach 380-780 nm"):
        made.relight({"sun": SHORT})


# --- what the project ships


@loop("name", scenes())
def test_every_scene_of_the_catalogue_covers_the_default_bands_exactly(name: str) -> None:
    """Its tables reach from 380 nm to 780 nm, or further; so do its lights, as far as they shine."""
    scene = load(name)
    ends = DEFAULT_WAVELENGTH_NM[0] - 5, DEFAULT_WAVELENGTH_NM[-1] + 5
    check_range(scene, *ends)
    assert told(scene, *ends) == []
    assert [text for group in scene.groups.values() for text in told(group.spectrum, *ends)] == []
    if name != "color_checker":
        refusal(check_range, scene, 380.0, 785.0, match="known over 380-780 nm alone")
        check_range(replace(scene, extend="hold"), 300.0, 1100.0)
