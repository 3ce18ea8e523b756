"""From a checked scene's dict to a `Scene`: its camera, its reference plane, its light groups."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from render.scene import Keys, Node, Scene, walk
from render.user_scene.allowed_plugins import ALLOWED, CAMERAS, METER, kind_of
from render.user_scene.scene_lights import attach_area_lights, light_groups, type_of
from rodcone.brief import brief
from rodcone.errors import InputError, require_name, require_whole

FILM_SIZE = 576, 768  # height and width of Mitsuba's films where a scene states none
DEEPEST = 1 << 16  # paths of integrators without a limit; Russian roulette ends them long before
LONGEST_CHAIN = 100  # of nested and referenced parts: Mitsuba follows them by recursion
_UNSEEN_BY_METER = ("directional", "point", "spot")  # it sends rays out, which meet none of these: it would read 0
# Integrators with a max_depth, and the longest path of those that state none; -1 is without a limit.
_PATHS = {
    **dict.fromkeys(("path", "volpath", "volpathmis", "ptracer"), -1),
    **dict.fromkeys(("prb", "prb_basic", "prb_projective", "prbvolpath"), 6),
}
_LEFT_OUT = ("film", "sampler", "rfilter", "reconstructionfilter", "integrator")


@dataclass(frozen=True)
class SceneFile:
    """A user's scene.

    Attributes
    ----------
    scene : Scene
    size : (int, int)
        Height and width of the camera's film in pixels.
    notes : tuple of str
        What was read and left out, in words.
    """

    scene: Scene
    size: tuple[int, int]
    notes: tuple[str, ...]

    __repr__ = brief


def assemble(mi: Any, name: str, description: Node, extend: str | None = None) -> SceneFile:
    """Build the scene: its first camera, light groups by id, a shape with an ``irradiancemeter`` as reference plane.

    Lights belong to a group by their own id, or else their shape's, up to a colon: ``lamp:left`` and ``lamp:right``
    are dimmed together. One spectrum that differs over place or direction, or several in a group, make it `coloured`.

    Parameters
    ----------
    mi : module
        Mitsuba, with its variant set.
    name : str
    description : dict
        Plain nested dict, its plug-ins and files already checked.
    extend : str, optional
        As of `Scene`.

    Raises
    ------
    InputError
        For a scene without camera or light, a broken reference, or a light that can't be relit.
    """
    kinds = {key: _kind(mi, child) for key, child in description.items()}
    integrators = [description[key] for key, kind in kinds.items() if kind == "integrator"]
    (depth, rr_depth), notes = _depths(name, integrators), []
    for integrator in integrators:
        limit = "of any length" if depth == DEEPEST else f"up to {depth} segments"
        engine = f"the engine brings its own, with paths {limit}, roulette from {rr_depth}"
        lamps = "; lights are seen, hide_emitters is left out" if integrator.get("hide_emitters") else ""
        notes.append(f"integrator {integrator['type']!r}: {engine}{lamps}")
    camera, size = _camera(mi, name, description, notes)
    geometry: Node = {"type": "scene", "sensor": camera}
    planes = []
    for key, child in description.items():
        if kinds[key] in ("sensor", *_LEFT_OUT) or key in ("type", "id"):
            continue
        if key in geometry:
            raise InputError(f"scene {name}: part {key!r} is not the camera; give it another id")
        geometry[key] = child
        if kinds[key] == "shape" and (meters := [k for k, part in child.items() if type_of(part) == METER]):
            planes.append(key)
            geometry[key] = {k: part for k, part in child.items() if k not in meters}
    if len(planes) > 1:
        raise InputError(f"scene {name}: irradiance meters on {', '.join(planes)}; allowed: one; remove the others")
    unseen = sorted({node["type"] for _, node in walk(geometry) if node["type"] in _UNSEEN_BY_METER})
    if planes and unseen:
        notes.append(f"the irradiance meter is left out: its rays can't meet lights without size ({', '.join(unseen)})")
        planes = []
    attach_area_lights(name, geometry)
    groups = light_groups(mi, name, geometry, _check_references(name, geometry))
    if not groups:
        raise InputError(f"scene {name}: it has no light; allowed: one emitter or more; add one")
    plane = planes[0] if planes else None
    scene = Scene(
        name=name,
        geometry=geometry,
        groups=groups,
        reference_plane=plane,
        extend=extend,
        max_depth=depth,
        rr_depth=rr_depth,
    )
    return SceneFile(scene, size, tuple(notes))


def _depths(name: str, integrators: list[Node]) -> tuple[int, int]:
    """Longest path and first depth of Russian roulette, of the first integrator that has paths, alone or in another."""
    nodes = [node for integrator in integrators for _, node in walk({"": integrator}) if node["type"] in _PATHS]
    if not nodes:
        direct = any(node["type"] in ("direct", "direct_projective") for node in integrators)
        return 2 if direct else Scene.max_depth, Scene.rr_depth
    depth, rr_depth = nodes[0].get("max_depth", _PATHS[nodes[0]["type"]]), nodes[0].get("rr_depth", Scene.rr_depth)
    require_whole(f"scene {name}: rr_depth", rr_depth, 1, 1 << 31, "roulette begins after the first surface")
    return DEEPEST if depth < 0 else max(2, int(depth)), min(int(rr_depth), DEEPEST)


def _kind(mi: Any, part: Any) -> str:
    return kind_of(mi, type_of(part)) if type_of(part) not in ("", "ref") else ""


def _camera(mi: Any, name: str, description: Node, notes: list[str]) -> tuple[Node, tuple[int, int]]:
    """First camera that can be rendered, without film and sampler, and its film's size."""
    sensors = [part for part in description.values() if _kind(mi, part) == "sensor"]
    # A film or sampler may stand in the scene itself, and be referred to.
    named = {part.get("id", key): part for key, part in description.items() if _kind(mi, part) in _LEFT_OUT}
    camera = next((sensor for sensor in sensors if sensor["type"] in CAMERAS), None)
    if camera is None:
        types = ", ".join(repr(sensor["type"]) for sensor in sensors) or "'none'"
        raise InputError(f"scene {name}: camera {types}; allowed: {', '.join(CAMERAS)}; add a sensor")
    if len(sensors) > 1:
        rendered = f"{camera['type']!r}, the first that can be, is rendered"
        notes.append(f"{len(sensors) - 1} of {len(sensors)} cameras are left out: {rendered}")
    parts = {key: named.get(part["id"], part) if type_of(part) == "ref" else part for key, part in camera.items()}
    lens = {key: part for key, part in parts.items() if _kind(mi, part) not in _LEFT_OUT}
    film: Node = next((part for part in parts.values() if _kind(mi, part) == "film"), {})
    size = film.get("height", FILM_SIZE[0]), film.get("width", FILM_SIZE[1])
    for side, pixels in zip(("height", "width"), size, strict=True):
        require_whole(f"scene {name}: film {side}", pixels, 1, 1 << 15, "give pixels")
    if any(key.startswith("crop") for key in film):
        notes.append("the film's crop is left out: the whole picture is rendered")
    return lens, (int(size[0]), int(size[1]))


def _check_references(name: str, geometry: Node) -> dict[str, Node]:
    """Parts by id and by dotted path, as Mitsuba names them; raises for references that can't be followed."""
    parts: dict[str, Node] = {}
    in_emitters: set[int] = set()
    emitter: Keys | None = None
    for path, node in walk(geometry):
        if node["type"] in ALLOWED["sensor"] and path != ("sensor",):
            raise InputError(f"scene {name}: {'/'.join(path)} is a sensor inside another part; place it in the scene")
        if node["type"] == "ref":
            continue
        parts[".".join(path)] = node
        parts[node.get("id", ".".join(path))] = node
        if emitter is None or path[: len(emitter)] != emitter:
            emitter = path if node["type"] in ALLOWED["emitter"] else None
        if emitter is not None:
            in_emitters.add(id(node))
    for path, node in walk(geometry):
        if node["type"] == "ref":
            require_name(f"scene {name}: {'/'.join(path)}: ref", node.get("id"), parts)
            if id(parts[node["id"]]) in in_emitters:
                raise InputError(f"scene {name}: ref {node['id']!r} points into a light; define it outside of it")
    _height(name, geometry, parts, {}, 0)
    return parts


def _height(name: str, node: Node, parts: Mapping[str, Node], heights: dict[int, int], level: int) -> int:
    """Longest chain of parts and references under a node, each node visited once."""
    if id(node) not in heights and level <= LONGEST_CHAIN:
        children = (parts[part["id"]] if type_of(part) == "ref" else part for part in node.values() if type_of(part))
        heights[id(node)] = max((1 + _height(name, child, parts, heights, level + 1) for child in children), default=0)
    if level + heights.get(id(node), 0) > LONGEST_CHAIN:
        raise InputError(f"scene {name}: references go in a circle or over {LONGEST_CHAIN} deep; shorten them")
    return heights[id(node)]
