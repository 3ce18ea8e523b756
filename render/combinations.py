"""Pairs of features that Mitsuba 3.9 renders correctly one by one but wrongly together; they are refused.

Each row of the table in docs/render.md was tried against stock Mitsuba and against a copy of the shape without the
second feature (`tests/render/test_combinations.py`): an instance's picture has to be that of a copy in its place.
"""

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from render.scene import Node, Scene, emitter_paths, walk
from rodcone.errors import InputError
from rodcone.types import Floats

# Largest difference of two transforms that counts as rounding of a file's numbers: a tenth of what Mitsuba's single
# precision resolves over a picture of 10 000 pixels.
_SLACK = 1e-5
_MESHES = ("obj", "ply", "serialized")
# Shapes on which Mitsuba turns a map of normals or heights the wrong way when they are mirrored, as it does on meshes
# with normals.
_MAPS_TURN = {"normalmap": ("rectangle", "disk", "cube", "cylinder"), "bumpmap": ("rectangle", "cube")}


@dataclass(frozen=True)
class _Instance:
    """An instance of a shape group: its name, the group's name and parts, and its transform's upper 3x4."""

    name: str
    group_name: str
    group: Node
    matrix: Floats


def check_combinations(scene: Scene) -> None:
    """Raise `InputError` for a pair of features that Mitsuba renders wrongly together, with the shape's name."""
    for what, reason, fix in _wrong_pairs(scene.geometry):
        raise InputError(f"scene {scene.name}: {what}: Mitsuba 3.9 {reason}; allowed: {fix}")


def _wrong_pairs(geometry: Node) -> Iterator[tuple[str, str, str]]:
    """Yield for each wrong pair: the shape and its features, what Mitsuba does wrong, and what to use instead."""
    parts = _parts_by_name(geometry)
    yield from _lamps_in_groups(parts)
    for instance in _instances(geometry, parts):
        yield from _wrong_in_an_instance(instance, parts)
    for path, shape in walk(geometry):
        yield from _wrong_by_its_transform("/".join(path), shape, parts)


def _lamps_in_groups(parts: Mapping[str, Node]) -> Iterator[tuple[str, str, str]]:
    for name, group in parts.items():
        for path in emitter_paths(group) if group["type"] == "shapegroup" else ():
            holder = path.partition("/")[0]
            shape = f"shape {group[holder].get('id', holder)!r} of shapegroup {name!r}"
            yield f"{shape} emits inside a shapegroup", "can't instance lights", "a lamp outside of the group"


def _wrong_in_an_instance(instance: _Instance, parts: Mapping[str, Node]) -> Iterator[tuple[str, str, str]]:
    moved = not np.allclose(instance.matrix, np.eye(4)[:3], rtol=0, atol=_SLACK)
    for key, shape in instance.group.items():
        if not isinstance(shape, dict):
            continue
        name = shape.get("id", key)
        where = f"in shapegroup {instance.group_name!r}, which instance {instance.name!r}"
        surfaces = list(_with_referred(shape, parts))
        colours = [str(part.get("name")) for part in surfaces if part["type"] == "mesh_attribute"]
        if moved and (vertex := [colour for colour in colours if colour.startswith("vertex_")]):
            yield (
                f"shape {name!r} {where} moves, has colours per vertex ({vertex[0]})",
                "interpolates them at the wrong place of an instance",
                "face_* colours, or a copy of the mesh in the instance's place",
            )
        if _mirrors(instance.matrix) and any(part["type"] == "normalmap" for part in surfaces):
            yield (
                f"shape {name!r} {where} mirrors, has a normalmap",
                "turns one axis of the normals the wrong way round in a mirrored instance",
                "a bumpmap, or a shape of its own, turned instead of mirrored, in the instance's place",
            )


def _wrong_by_its_transform(name: str, shape: Node, parts: Mapping[str, Node]) -> Iterator[tuple[str, str, str]]:
    kind = shape.get("type")
    transform = _matrix(shape.get("to_world"))
    if kind in (*_MAPS_TURN["normalmap"], *_MESHES) and _mirrors(transform):
        maps = {part["type"] for part in _with_referred(shape, parts)} & _MAPS_TURN.keys()
        for turned in sorted(turned for turned in maps if _has_normals(shape, _MAPS_TURN[turned])):
            yield (
                f"shape {name!r} is mirrored by its to_world and has a {turned}",
                "turns what the map says the wrong way round on a mirrored shape",
                "the shape turned, and its picture mirrored, or the shape without the map",
            )
    if kind == "sphere" and _is_uneven(transform[:, :3]):
        yield (
            f"shape {name!r} is a sphere whose to_world stretches its axes differently",
            "makes another sphere of it, not an ellipsoid",
            "one scale for all axes, or the plain sphere in a shapegroup and the transform on its instance",
        )
    emits = any(isinstance(part, dict) and part.get("type") == "area" for part in shape.values())
    if kind == "cylinder" and emits and _is_uneven(transform[:, :2]):
        yield (
            f"shape {name!r} is a cylinder that emits, and its to_world stretches x and y differently",
            "takes another area for its light",
            "one scale for x and y, or a mesh",
        )


def _parts_by_name(geometry: Node) -> dict[str, Node]:
    """Return all parts that a reference can name, by key and by id."""
    named: dict[str, Node] = {}
    for path, part in walk(geometry):
        if part.get("type") != "ref":
            named.setdefault(path[-1], part)
            named[str(part.get("id", path[-1]))] = part
    return named


def _instances(geometry: Node, parts: Mapping[str, Node]) -> Iterator[_Instance]:
    """Yield all instances of shape groups; an instance contains its group or refers to it."""
    for path, node in walk(geometry):
        if node.get("type") != "instance":
            continue
        for key, child in node.items():
            if not isinstance(child, dict):
                continue
            name = str(child["id"] if child.get("type") == "ref" else child.get("id", key))
            group = parts.get(name, {})
            if group.get("type") == "shapegroup":
                yield _Instance("/".join(path), name, group, _matrix(node.get("to_world")))


def _with_referred(node: Node, parts: Mapping[str, Node]) -> Iterator[Node]:
    """Yield a node, all parts under it, and the parts that they refer to, each once."""
    pending = [node]
    met = set()
    while pending:
        part = pending.pop()
        if part.get("type") == "ref":
            part = parts.get(str(part.get("id")), {})
        if part and id(part) not in met:
            met.add(id(part))
            yield part
            pending += [child for child in part.values() if isinstance(child, dict)]


def _matrix(transform: object) -> Floats:
    """Return the upper 3x4 of a `to_world` in any of its forms; that of the identity if there is none."""
    if transform is None:
        return np.eye(4)[:3]
    return np.array(getattr(transform, "matrix", transform), np.float64).reshape(4, 4)[:3]


def _mirrors(transform: Floats) -> bool:
    return bool(np.linalg.det(transform[:, :3]) < 0)


def _has_normals(shape: Node, kinds: tuple[str, ...]) -> bool:
    """Return whether a shape is one of `kinds`, or a mesh whose file states vertex normals that the scene uses."""
    if shape["type"] not in _MESHES or "filename" not in shape:
        return shape["type"] in kinds
    if shape.get("face_normals"):
        return False
    content = Path(str(shape["filename"])).read_bytes() if Path(str(shape["filename"])).is_file() else b""
    if shape["type"] == "ply":
        return re.search(rb"^property\s+\w+\s+nx\s", content.partition(b"end_header")[0], re.MULTILINE) is not None
    return shape["type"] == "serialized" or re.search(rb"^vn\s", content, re.MULTILINE) is not None


def _is_uneven(axes: Floats) -> bool:
    """Return whether a transform stretches its axes differently or shears them (is no multiple of a rotation)."""
    gram = axes.T @ axes
    return not np.allclose(gram, gram[0, 0] * np.eye(len(gram)), rtol=0, atol=_SLACK * max(1e-30, gram[0, 0]))
