"""Scenes as plain data: what their dicts hold, what Mitsuba makes of them, what is refused."""

import copy
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from command_line import in_new_python
from loop import loop
from refusal import refusal

from render.engine import render
from render.geometry import look_at, rotate, scale, to_world, translate
from render.integrator.matte import STEPS, TableReader
from render.loader import Film, load_groups, mitsuba_module, variant, with_textures
from render.scene import LightGroup, Scene, spectrum_node, uniform_node
from render.spectrum import Spectrum, flat
from render.user_scene.scene_paths import search_path
from rodcone.errors import InputError
from rodcone.jit import Matrix4, dr
from scenes.catalogue import load, scene_names

CAMERA = {"type": "perspective", "fov": 40.0, "to_world": to_world(look_at((0, 0, 4), (0, 0, 0)))}
GEOMETRY = {
    "type": "scene",
    "sensor": CAMERA,
    "ball": {"type": "sphere", "radius": 0.5},
    "lamp": {"type": "sphere", "center": [0.0, 3.0, 0.0], "emitter": {"type": "area"}},
    "sky": {"type": "constant"},
}
SKY, LAMP = LightGroup(("sky",), flat(2.0), 3.0), LightGroup(("lamp/emitter",), flat(5.0))
BOTH = {"sky": SKY, "lamp": LAMP}


def scene(groups=None, **nodes):
    return Scene("test", GEOMETRY | nodes, BOTH if groups is None else groups)


def complaint(*args, **nodes):
    text = refusal(scene, *args, **nodes)
    assert text.startswith("scene test: ")
    return text


def kinds(node):
    if isinstance(node, dict):
        return {str} | {type(key) for key in node} | set().union(*map(kinds, node.values()))
    if isinstance(node, list):
        return {list}.union(*map(kinds, node))
    return {type(node)}


@loop("name", scene_names())
def test_a_description_holds_plain_values_alone(name):
    assert kinds(load(name).description) <= {str, int, float, bool, list, Matrix4}


@pytest.mark.sample(1)
@pytest.mark.parametrize("name", scene_names())
def test_mitsuba_loads_a_description_in_the_scalar_and_the_active_variant(name):
    mi, description = mitsuba_module(), load(name).description
    resolver = mi.file_resolver()
    mi.set_file_resolver(search_path(mi))  # as the loader does
    try:
        for kind in ("scalar_spectral", variant()):
            mi.set_variant(kind)
            loaded = mi.load_dict(with_textures(copy.copy(description)))
            assert len(loaded.sensors()) == 1
            assert loaded.emitters()
    finally:
        mi.set_file_resolver(resolver)
        mi.set_variant(variant())


def test_a_description_has_every_light_at_its_spectrum_times_power():
    description = scene().description
    assert description["sky"]["radiance"]["values"] == "6.0,6.0"
    assert description["lamp"]["emitter"]["radiance"]["values"] == "5.0,5.0"


@loop(
    ("kind", "parameter"),
    [("point", "intensity"), ("spot", "intensity"), ("directional", "irradiance"), ("constant", "radiance")],
)
def test_each_kind_of_light_gets_its_spectrum_where_mitsuba_reads_it(kind, parameter):
    lights = {"sky": {"type": kind}, "lamp": {"type": "sphere"}}
    description = scene({"sky": SKY}, **lights).description
    assert set(description["sky"]) == {"type", parameter}
    assert len(mitsuba_module().load_dict(description).emitters()) == 1


def test_a_light_of_its_own_colour_keeps_it_and_goes_out_with_its_group():
    sky = {"type": "sunsky", "turbidity": 3.0}
    own = LightGroup(("sky",), flat(), 2.0, coloured=True)
    tinted = Scene("test", GEOMETRY | {"sky": sky}, {"sky": own, "lamp": LAMP})
    assert tinted.lit({"sky": uniform_node(7.0)})["sky"] == sky
    assert tinted.description["sky"] == sky
    assert "sky" not in tinted.lit({"lamp": uniform_node(1.0)})


SUN = {"sky": {"type": "timed_sunsky"}}
DEEP = {"type": "shapegroup", "inner": {"type": "sphere", "glow": {"type": "area"}}}


@loop(
    ("groups", "nodes", "words"),
    [
        (
            {"sky": SKY, "lamp": LightGroup(("lamp/emiter",), flat())},
            {},
            "emitter: 'lamp/emiter' is unknown; allowed: lamp/emitter, sky; did you mean 'lamp/emitter'?",
        ),
        ({"sky": SKY}, {}, "emitter 'lamp/emitter' is in 0 light groups; put it in one"),
        ({"a": LightGroup(("sky", "sky", "lamp/emitter"), flat())}, {}, "emitter 'sky' is in 2 light groups"),
        (BOTH | {"more": LightGroup(("sky",), flat())}, {}, "emitter 'sky' is in 2 light groups; put it in one"),
        (BOTH, {"shelf": DEEP}, "emitter 'shelf/inner/glow' is in 0 light groups"),
        (BOTH, SUN, "emitter 'sky' of type 'timed_sunsky' can't be relit; allowed: area, constant, point"),
        (BOTH, {"sky": {"type": "projector"}}, "emitter 'sky' of type 'projector' can't be relit"),
        (
            BOTH,
            {"sky": {"type": "envmap"}},
            "'sky' of type 'envmap' has colours of its own; allowed: a light group with",
        ),
        (
            BOTH,
            {"sky": {"type": "sunsky"}},
            "'sky' of type 'sunsky' has colours of its own; allowed: a light group with",
        ),
    ],
)
def test_lights_that_are_not_in_one_group_of_their_kind_are_refused(groups, nodes, words):
    assert words in complaint(groups, **nodes)


def test_a_reference_plane_that_is_not_there_is_refused_and_the_nearest_named():
    with pytest.raises(InputError, match=r"reference_plane: 'bal' is unknown; .*did you mean 'ball'\?$"):
        Scene("test", GEOMETRY, BOTH, reference_plane="bal")


def test_lit_removes_the_groups_that_are_not_named():
    lit = scene().lit({"lamp": uniform_node(1.0)})
    assert "sky" not in lit
    assert lit["lamp"]["emitter"] == {"type": "area", "radiance": uniform_node(1.0)}
    assert "emitter" not in scene().lit({"sky": uniform_node(1.0)})["lamp"]
    black = {"type": "diffuse", "reflectance": uniform_node(0.0)}
    assert scene().lit({})["lamp"] == {"type": "sphere", "center": [0.0, 3.0, 0.0], "black": black}


def test_several_lights_of_one_shape_keep_their_own_groups():
    shelf = {"type": "scene", "a": {"type": "point"}, "b": {"type": "point"}}
    groups = BOTH | {"a": LightGroup(("shelf/a",), flat(1.0)), "b": LightGroup(("shelf/b",), flat(2.0))}
    description = scene(groups, shelf=shelf).description
    values = [description["shelf"][key]["intensity"]["values"] for key in ("a", "b")]
    assert values == ["1.0,1.0", "2.0,2.0"]


@loop("nm", [[400.0, 500.0, 600.0], [400.0, 410.0, 600.0], [380.0, 380.5, 780.0]])
def test_a_spectrum_node_is_the_same_function_in_mitsuba(nm):
    spectrum = Spectrum(np.array(nm), np.array([0.2, 0.9, 0.4]))
    mi, at = mitsuba_module(), np.linspace(nm[0] + 1e-3, nm[-1] - 1e-3, 24)
    texture = mi.load_dict(spectrum_node(spectrum))
    si = mi.SurfaceInteraction3f()
    for four in at.reshape(-1, 4):
        si.wavelengths = mi.Spectrum(*four.tolist())
        seen = np.ravel(np.array(texture.eval(si)))
        assert seen == pytest.approx(np.interp(four, spectrum.wavelength_nm, spectrum.values), rel=1e-4)


def test_a_spectrum_node_keeps_every_digit():
    spectrum = Spectrum(np.array([400.0, 410.0]), np.array([1 / 3, 1e-300]))
    assert spectrum_node(spectrum)["values"] == f"{1 / 3!r},1e-300"


# Loading: what light groups share, that sharing changes no bit, and that a kernel compiles once for all passes.


NM = np.arange(420.0, 700.0, 40.0)


def street() -> Scene:
    return replace(load("night_street"), reference_plane=None)


def test_groups_hold_the_same_shapes_and_surfaces() -> None:
    """Four lamps' shapes apart, each in four scenes: everything else is there once."""
    film = Film((4, 4), NM, np.full(NM.size, 40.0), 8)
    scenes = [loaded.mi_scene for loaded in load_groups(street(), film)]
    shapes = [set(map(id, scene.shapes())) for scene in scenes]
    assert len(set.intersection(*shapes)) == len(shapes[0]) - 4
    surfaces = [{id(shape.bsdf()) for shape in scene.shapes()} for scene in scenes]
    assert all(own == surfaces[0] for own in surfaces)


@pytest.mark.thorough
@pytest.mark.parametrize("group", ["moon", "led"])
def test_a_group_is_the_same_picture_as_a_scene_of_it_alone(group: str) -> None:
    """To the bit for the first group, whose seed is the same; shapes, surfaces and rows of the table are its own."""
    whole = street()
    whole = replace(whole, groups={group: whole.groups[group], **whole.groups})
    others = [path for name, lights in whole.groups.items() if name != group for path in lights.emitters]
    geometry = {
        key: {name: part for name, part in node.items() if f"{key}/{name}" not in others} if key != "type" else node
        for key, node in whole.geometry.items()
    }
    alone = replace(whole, geometry=geometry, groups={group: whole.groups[group]})
    options = {"wavelength_nm": NM, "width_nm": 40.0, "spp": 8, "seed": 3}
    one, all_four = render(alone, (12, 16), **options), render(whole, (12, 16), **options)
    assert np.ptp(one.radiance) > 0
    assert np.array_equal(one.radiance[0], all_four.radiance[0])


def test_tables_anywhere_in_memory_are_read_by_one_kernel() -> None:
    """An array on a multiple of 64 bytes, used where it lies, would be read by other code."""
    mi, memory = mitsuba_module(), np.arange(4096, dtype=np.float32)
    start = -memory.ctypes.data % 64 // 4
    kernels = set()
    for first in (start, start + 1, start + 4):
        table = memory[first : first + 2 * STEPS * 8].reshape(2, STEPS, 8)
        reader = TableReader(mi, table)
        row, step = dr.opaque(mi.UInt32, 1), dr.opaque(mi.UInt32, 3)
        with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
            dr.kernel_history()
            read = reader.read(row + dr.zeros(mi.UInt32, 16), step, mi.Bool(True))
            dr.eval(read)
            kernels |= {kernel["hash"] for kernel in dr.kernel_history() if "hash" in kernel}
        assert np.array_equal(np.array(read[1])[:, 0], table[1, 3, 4:])
    assert len(kernels) == 1


GUEST = """
import numpy as np
import rodcone
import mitsuba as mi
mi.set_variant("scalar_rgb")
before = repr(mi.file_resolver())
scene = mi.load_dict(mi.cornell_box())
picture = np.array(mi.render(scene, spp=1, seed=3))
first = rodcone.render(rodcone.load("cornell_box"), (4, 4), spp=4)
assert np.allclose(np.array(mi.render(scene, spp=1, seed=3)), picture, rtol=1e-4)  # threads add in any order
again = rodcone.render(rodcone.load("cornell_box"), (4, 4), spp=4)
again.relight(illuminance_lux=5.0)  # traces the meter, late
print(mi.variant(), repr(mi.file_resolver()) == before, np.array_equal(first.radiance, again.radiance))
"""


@pytest.mark.thorough
def test_a_users_own_variant_search_path_and_scene_are_as_they_were(tmp_path: Path) -> None:
    assert in_new_python(GUEST, folder=tmp_path) == "scalar_rgb True True"


# Transforms: closed forms, and Mitsuba's own transforms as the independent reference.


POINT = np.array([0.3, -1.2, 2.5, 1.0])


def mitsubas():
    mitsuba_module()
    import mitsuba.scalar_rgb as mi

    return mi.ScalarTransform4f


def test_to_world_applies_the_last_transform_first():
    matrix = np.array(to_world(translate(1, 0, 0), scale(2, 2, 2)))
    assert matrix @ [1, 1, 1, 1] == pytest.approx([3, 2, 2, 1])
    assert np.array(to_world(translate(1, 2, 3))) == pytest.approx(translate(1, 2, 3))


def test_to_world_gives_the_type_that_every_variant_loads():
    assert isinstance(to_world(np.eye(4)), Matrix4)


def test_transforms_equal_mitsubas():
    theirs = mitsubas()
    pairs = [
        (translate(1, -2, 0.5), theirs().translate([1, -2, 0.5])),
        (scale(1, 2, 3), theirs().scale([1, 2, 3])),
        (rotate((0.4, 2, -6), 71.0), theirs().rotate((np.array([0.2, 1, -3]) / np.sqrt(10.04)).tolist(), 71.0)),
        (look_at((1, 2, 3), (-0.5, 0.1, 0.2)), theirs().look_at([1, 2, 3], [-0.5, 0.1, 0.2], [0, 1, 0])),
        (
            look_at((1, 2, 3), (0, 9, 0), up=(0, 0, 1)),
            theirs().look_at(origin=[1, 2, 3], target=[0, 9, 0], up=[0, 0, 1]),
        ),
    ]
    for ours, transform in pairs:
        assert ours @ POINT == pytest.approx(np.array(transform.matrix) @ POINT, rel=1e-5, abs=1e-5)  # theirs: float32
