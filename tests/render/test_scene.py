"""Scenes as plain data: what their dicts hold, what Mitsuba makes of them, what is refused."""

import copy

import numpy as np
import pytest
from loop import loop
from refusal import refusal

from render.geometry import look_at, to_world
from render.loader import mitsuba_module, variant
from render.scene import LightGroup, Scene, spectrum_node, uniform_node
from render.spectrum import Spectrum, flat
from render.user_scene.scene_paths import search_path
from rodcone.errors import InputError
from rodcone.jit import Matrix4
from scenes.catalog import load, names

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


@loop("name", names())
def test_a_description_holds_plain_values_alone(name):
    assert kinds(load(name).description) <= {str, int, float, bool, list, Matrix4}


@pytest.mark.sample(1)
@pytest.mark.parametrize("name", names())
def test_mitsuba_loads_a_description_in_the_scalar_and_the_active_variant(name):
    mi, description = mitsuba_module(), load(name).description
    resolver = mi.file_resolver()
    mi.set_file_resolver(search_path(mi))  # as the loader does
    try:
        for kind in ("scalar_spectral", variant()):
            mi.set_variant(kind)
            loaded = mi.load_dict(copy.copy(description))
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
    assert scene().lit({})["lamp"] == {"type": "sphere", "center": [0.0, 3.0, 0.0]}


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
