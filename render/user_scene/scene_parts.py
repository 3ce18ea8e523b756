"""Conversion of a checked scene's dict to a `Scene`: camera, reference plane, and light groups with their spectra."""

from collections.abc import Mapping
from dataclasses import dataclass
from types import ModuleType
from typing import Any

import numpy as np

from render.loader import mitsuba_words
from render.scene import EMISSION_PARAMETER, Keys, LightGroup, Node, Scene, table_of, walk
from render.spectrum import Spectrum, flat
from render.user_scene.allowed_plugins import ALLOWED, CAMERAS, METER, SPECTRA, kind_of
from rodcone.display import brief
from rodcone.errors import InputError, in_place, require_name, require_whole
from rodcone.file_keys import require_known
from rodcone.jit import dr
from rodcone.types import Floats

FILM_SIZE = 576, 768  # height and width of Mitsuba's film if a scene states none
DEEPEST = 1 << 16  # longest path of integrators without a limit; Russian roulette ends paths long before
LONGEST_CHAIN = 100  # most nested and referenced parts in a chain, which Mitsuba follows by recursion
_UNSEEN_BY_METER = ("directional", "point", "spot")  # lights without size, which no ray of Mitsuba's meter can meet
# Integrators with a max_depth, and its default; -1 means no limit.
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
        Sentences about parts of the file that are left out or replaced.
    """

    scene: Scene
    size: tuple[int, int]
    notes: tuple[str, ...]

    __repr__ = brief


def assemble(mi: ModuleType, name: str, description: Node, extend: str | None = None) -> SceneFile:
    """Build the scene: its first camera, light groups by id, a shape with an ``irradiancemeter`` as reference plane.

    A light's group is named by its own id, or else its shape's, up to a colon: ``lamp:left`` and ``lamp:right`` are
    dimmed together. A group is `coloured` if a spectrum in it varies over position or direction, or if its lights have
    different spectra.

    Parameters
    ----------
    mi : module
        Mitsuba, with its variant set.
    name : str
    description : dict
        Plain nested dict, whose plug-ins and files have been checked.
    extend : str, optional
        As in `Scene`.

    Raises
    ------
    InputError
        For a scene without camera or light, a broken reference, or a light that can't be relit.
    """
    kinds = {key: _kind(mi, child) for key, child in description.items()}
    _check_left_out(mi, name, description)
    integrators = [description[key] for key, kind in kinds.items() if kind == "integrator"]
    depth, rr_depth = _depths(name, integrators)
    notes = []
    for integrator in integrators:
        limit = "of any length" if depth == DEEPEST else f"up to {depth} segments"
        engine = f"the engine brings its own, with paths {limit}, roulette from {rr_depth}"
        notes.append(f"integrator {integrator['type']!r}: {engine}")
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
    scene = Scene(
        name=name,
        geometry=geometry,
        groups=groups,
        reference_plane=planes[0] if planes else None,
        extend=extend,
        max_depth=depth,
        rr_depth=rr_depth,
    )
    return SceneFile(scene, size, tuple(notes))


def _depths(name: str, integrators: list[Node]) -> tuple[int, int]:
    """Return the longest path and the depth at which Russian roulette begins, by the first path integrator.

    That integrator may stand by itself or within another one.
    """
    nodes = [node for integrator in integrators for _, node in walk({"": integrator}) if node["type"] in _PATHS]
    if not nodes:
        direct = any(node["type"] in ("direct", "direct_projective") for node in integrators)
        return 2 if direct else Scene.max_depth, Scene.rr_depth
    depth = nodes[0].get("max_depth", _PATHS[nodes[0]["type"]])
    rr_depth = nodes[0].get("rr_depth", Scene.rr_depth)
    require_whole(f"scene {name}: rr_depth", rr_depth, 1, 1 << 31, "roulette begins after the first surface")
    if depth >= 0:
        require_whole(f"scene {name}: max_depth", depth, 1, 1 << 31, "1 is emission alone, -1 without a limit")
    return DEEPEST if depth < 0 else min(int(depth), DEEPEST), min(int(rr_depth), DEEPEST)


def _check_left_out(mi: ModuleType, name: str, description: Node) -> None:
    """Raise `InputError` if a part that this engine replaces has a property that would change the picture."""
    for _, node in walk(description):
        kind = _kind(mi, node).replace("reconstructionfilter", "rfilter")
        if kind in _LEFT_OUT:
            own = {
                key: value for key, value in node.items() if key not in ("type", "id") and not isinstance(value, dict)
            }
            with in_place(f"scene {name}: {node['type']}"):
                require_known(f"Mitsuba {kind} property", own)


def _kind(mi: ModuleType, part: object) -> str:
    return kind_of(mi, type_of(part)) if type_of(part) not in ("", "ref") else ""


def _camera(mi: ModuleType, name: str, description: Node, notes: list[str]) -> tuple[Node, tuple[int, int]]:
    """Return the first camera that this engine renders, without its film and sampler, and the size of its film."""
    sensors = [part for part in description.values() if _kind(mi, part) == "sensor"]
    # A film or sampler may stand in the scene itself, and the camera refers to it.
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
    whole = {"crop_offset_x": 0, "crop_offset_y": 0, "crop_height": size[0], "crop_width": size[1]}
    if cut := [f"{key}={film[key]}" for key, uncut in whole.items() if film.get(key, uncut) != uncut]:
        raise InputError(
            f"scene {name}: film {', '.join(cut)}: no part of a picture is rendered; allowed: the whole; "
            "remove crop_*, and cut the picture afterwards"
        )
    return lens, (int(size[0]), int(size[1]))


def _check_references(name: str, geometry: Node) -> dict[str, Node]:
    """Raise `InputError` for a reference that can't be followed; return all parts by id and by dotted path."""
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
    """Return the length of the longest chain of parts and references under a node; visit each node once."""
    if id(node) not in heights and level <= LONGEST_CHAIN:
        children = (parts[part["id"]] if type_of(part) == "ref" else part for part in node.values() if type_of(part))
        heights[id(node)] = max((1 + _height(name, child, parts, heights, level + 1) for child in children), default=0)
    if level + heights.get(id(node), 0) > LONGEST_CHAIN:
        raise InputError(f"scene {name}: references go in a circle or over {LONGEST_CHAIN} deep; shorten them")
    return heights[id(node)]


# MI_CIE_MIN to MI_CIE_MAX, outside of which Mitsuba's own spectra (rgb, d65, blackbody) are zero, and one point more:
# 472 wavelengths can be evaluated four at a time.
_GRID_NM: Floats = np.arange(360.0, 832.0)


def type_of(part: Any) -> str:
    """Return the plug-in that a value in a scene's dict names; an empty text for a plain value."""
    return str(part["type"]) if isinstance(part, dict) else ""


def attach_area_lights(name: str, geometry: Node) -> None:
    """Move each area light that stands in the scene itself into the shape that refers to it, as Mitsuba does.

    Raises
    ------
    InputError
        For a light to which no shape refers, or several.
    """
    for key in [key for key, part in geometry.items() if type_of(part) == "area"]:
        light: Node = {"id": key, **geometry.pop(key)}
        held = [
            (shape, key_in_shape)
            for shape in geometry.values()
            if isinstance(shape, dict)
            for key_in_shape, part in shape.items()
            if type_of(part) == "ref" and part.get("id") in (key, light["id"])
        ]
        if len(held) != 1:
            raise InputError(
                f"scene {name}: area light {key!r} is on {len(held)} shapes; allowed: one; give each its own"
            )
        shape, key_in_shape = held[0]
        shape[key_in_shape] = light


def light_groups(mi: ModuleType, name: str, geometry: Node, parts: Mapping[str, Node]) -> dict[str, LightGroup]:
    """Form the light groups of a scene by its lights' ids.

    Parameters
    ----------
    mi : module
        Mitsuba, with its variant set.
    name : str
    geometry : dict
        Scene, from which the spectra that relighting replaces are removed.
    parts : mapping of str to dict
        Parts to which references point.

    Raises
    ------
    InputError
        For a spectrum that Mitsuba refuses.
    """
    members: dict[str, list[tuple[Keys, Node]]] = {}
    for path, node in walk(geometry):
        if node["type"] in ALLOWED["emitter"]:
            light_id = str(node.get("id") or geometry[path[0]].get("id") or path[0])
            members.setdefault(light_id.split(":", maxsplit=1)[0] or light_id, []).append((path, node))
    groups = {}
    for group, lights in members.items():
        spectra = [_emission(mi, f"scene {name}: {'/'.join(path)}", node, parts) for path, node in lights]
        common = spectra[0] if all(_same(spectra[0], spectrum) for spectrum in spectra) else None
        if common is not None:
            for _, node in lights:
                node.pop(EMISSION_PARAMETER[node["type"]], None)
        emitters = tuple("/".join(path) for path, _ in lights)
        groups[group] = LightGroup(emitters, flat() if common is None else common, coloured=common is None)
    return groups


def _same(a: Spectrum | None, b: Spectrum | None) -> bool:
    if a is None or b is None:
        return False
    return np.array_equal(a.wavelength_nm, b.wavelength_nm) and np.array_equal(a.values, b.values)


def _emission(mi: ModuleType, where: str, emitter: Node, parts: Mapping[str, Node]) -> Spectrum | None:
    """Find an emitter's spectrum as Mitsuba evaluates it; return None if it varies over position or direction."""
    if emitter["type"] not in EMISSION_PARAMETER or "texture" in emitter:  # a spot's texture varies by direction
        return None
    value: Any = emitter.get(EMISSION_PARAMETER[emitter["type"]])
    while type_of(value) == "ref":
        value = parts[value["id"]]
    inner = [node["type"] for _, node in walk({"": value} if isinstance(value, dict) else {})]
    if any(kind not in (*SPECTRA, "rgb") for kind in inner):
        return None
    try:  # by an emitter of type `constant`, whose emission depends on wavelength alone
        probe = mi.load_dict({"type": "constant"} | ({} if value is None else {"radiance": value}))
    except RuntimeError as error:
        raise InputError(f"{where}: {mitsuba_words(error)}; correct its spectrum") from None
    return _stated(value) or Spectrum(_GRID_NM[:-1], np.maximum(_evaluate(mi, probe)[:-1], 0.0))


def _stated(value: Any) -> Spectrum | None:
    """Return a spectrum by the points that it states, because a line may lie between the points of any other grid."""
    if type_of(value) == "uniform" and set(value) - {"type", "id"} == {"value"}:
        return flat(float(value["value"]))
    return table_of(value) if isinstance(value, dict) else None


def _evaluate(mi: ModuleType, emitter: Any) -> Floats:
    """Evaluate an emitter at all wavelengths of `_GRID_NM`, four per element of one array."""
    fours = _GRID_NM.reshape(-1, 4)
    interaction = dr.zeros(mi.SurfaceInteraction3f, len(fours))
    interaction.wavelengths = mi.Spectrum(*(mi.Float(column) for column in fours.T))
    return np.array(emitter.eval(interaction), dtype=np.float64).T.ravel()
