"""A user's own scene as Mitsuba XML, checked before anything in it is instantiated."""

import os
import re
from collections import Counter
from collections.abc import Mapping
from dataclasses import replace
from math import isfinite
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from render.geometry import to_world
from render.loader import mitsuba_module, mitsuba_words, own_mitsuba_variant
from render.scene import Node, spectrum_node, uniform_node
from render.scene_range import known_range
from render.spectrum import VISIBLE_NM, Spectrum
from render.user_scene.allowed_plugins import require_allowed
from render.user_scene.mesh_files import check_mesh_file
from render.user_scene.scene_parts import SceneFile, assemble
from render.user_scene.scene_paths import find_file, screen, search_path
from rodcone.errors import InputError, require_name

# Numbers that may be negative: angles, offsets in a picture, the depth of bumps, and -1 for paths without a limit.
# Points and directions aren't listed, because they are vectors.
_SIGNED = {
    "latitude",
    "longitude",
    "max_depth",
    "principal_point_offset_x",
    "principal_point_offset_y",
    "scale_tilt",
    "timezone",
}
_SIGNED_OF = {("bumpmap", "scale")}
HELD_NM = 400.0, 700.0  # range that a table must cover so that its ends are continued without being asked for
_LISTS = {"wavelengths", "values"}  # texts that hold the numbers of regular and irregular spectra
_NUMBER = re.compile(r"[-+]?(?:[\d.]+(?:[eE][-+]?\d+)?|nan|inf)", re.IGNORECASE)
_RESERVED = re.compile(r"[./\s]")  # Mitsuba's and our own separators in paths of a scene's dict


@own_mitsuba_variant()
def load_scene_file(
    path: str | Path, *, trust: bool = False, extend: str | None = None, define: Mapping[str, str] | None = None
) -> SceneFile:
    """Read a Mitsuba XML scene.

    A Mitsuba scene can load native code. It is therefore first read without Mitsuba, then by Mitsuba's parser, which
    instantiates nothing. Every plug-in has to be one of Mitsuba's own. Every file has to lie in the scene's folder, or
    in one that it names by ``<path>``, from which files are read but no plug-in is loaded. Mitsuba converts RGB colours
    to spectra. Films, samplers and integrators are left out, because the engine has its own; only the film's size
    counts.

    Parameters
    ----------
    path : path
    trust : bool
        Whether the scene may name its own plug-ins, whose native code then runs, and files anywhere.
    extend : "hold", optional
        As in `Scene`: surfaces keep their end values outside their tables. If all tables cover at least 400 to 700 nm,
        they do so in any case, with a note.
    define : mapping of str to str, optional
        Values of the file's ``$parameters``, as Mitsuba's ``-D name=value``.

    Returns
    -------
    SceneFile
        Scene, size of its film, and what was left out.

    Raises
    ------
    InputError
        For a missing or malformed file (with its line), a refused plug-in or file, a scene without light or camera.
    """
    file = Path(os.path.realpath(path))
    if not file.is_file():
        raise InputError(f"scene file: {str(path)!r} is missing or no file; give the path of a Mitsuba .xml scene")
    folders = screen(file, trust, define or {})
    mi = mitsuba_module()
    state = _parse(mi, file, trust, define or {})
    # A trusted scene's <path> folders are on Mitsuba's search path by now.
    bases = [Path(str(place)) for place in mi.file_resolver()] if trust else folders
    opened = assemble(mi, file.stem, _from_xml(mi, state, bases, None if trust else folders), extend)
    return opened if extend else _with_held_ends(opened)


def _with_held_ends(opened: SceneFile) -> SceneFile:
    """Continue tables that cover 400 to 700 nm at their end values; beyond lies less than 0.1 % of luminance."""
    known = known_range(opened.scene)
    if known is None or known[0] > HELD_NM[0] or known[1] < HELD_NM[1]:
        return opened
    if known[0] <= VISIBLE_NM[0] and known[1] >= VISIBLE_NM[1]:
        return opened
    note = f"surfaces known over {known[0]:g}-{known[1]:g} nm go on at their end values beyond"
    return replace(opened, scene=replace(opened.scene, extend="hold"), notes=(*opened.notes, note))


def _parse(mi: ModuleType, file: Path, trust: bool, define: Mapping[str, str]) -> Any:
    """Parse a file, which loads no plug-in, and return the parser's state.

    The scene's folder is on Mitsuba's search path only during this call, unless the scene is trusted.
    """
    resolver = search_path(mi)
    config = mi.parser.ParserConfig(mi.variant())
    mi.set_file_resolver(search_path(mi, file.parent))
    try:
        state = mi.parser.parse_file(config, str(file), **define)
        mi.parser.transform_upgrade(config, state)
    except RuntimeError as error:
        words = mitsuba_words(error)
        fix = "give it, as -D name=value" if "undefined parameter" in words else "correct the file"
        raise InputError(f"{words}; {fix}") from None
    except UnicodeDecodeError:  # from a message that cuts a character in half, or a file of spectra
        raise InputError(f"{file}: Mitsuba can't read it, nor say why in UTF-8; correct the file") from None
    finally:
        if not trust:
            mi.set_file_resolver(resolver)
    return state


def _from_xml(mi: ModuleType, state: Any, bases: list[Path], folders: list[Path] | None) -> Node:
    """Check every part of a parsed scene, then put them together as a nested dict."""
    nodes = list(state.nodes)
    index_of = state.id_to_index
    if nodes[0].props.plugin_name() != "scene":
        raise InputError(f"{state.files[0]}: its root is {nodes[0].props.plugin_name()!r}; allowed: <scene>")
    # Messages name a part without an id by the key under which its parent holds it.
    keys = {
        value.index(): key
        for node in nodes
        for key, value in node.props.items()
        if node.props.type(key).name == "ResolvedReference" and not key.startswith("_arg_")
    }
    parts = []
    for index, node in enumerate(nodes):
        try:
            name = node.props.id() or keys.get(index, "")
            tag = node.type.name.lower()
            require_allowed(node.props.plugin_name(), tag=tag, name=name, trust=folders is None)
            parts.append(_xml_part(node, nodes, index_of, bases, folders))
        except InputError as error:
            raise InputError(f"{mi.parser.file_location(state, node)}: {error}") from None
    numbers: Counter[str] = Counter()
    for part, node in zip(parts, nodes, strict=True):
        for key, value in node.props.items():
            if node.props.type(key).name == "ResolvedReference":
                child = parts[value.index()]
                tag = nodes[value.index()].type.name.lower()
                label = child.get("id", "" if key.startswith("_arg_") else key)
                part[_key(part, index_of, numbers, label if part is parts[0] else key, tag)] = child
    return parts[0]


def _xml_part(
    node: Any, nodes: list[Any], index_of: Mapping[str, int], bases: list[Path], folders: list[Path] | None
) -> Node:
    """Convert one node of a parsed scene, without its children, to a dict."""
    properties = node.props
    result: Node = {"type": properties.plugin_name()}
    if properties.id():
        result["id"] = properties.id()
    for name, value in properties.items():
        key = _RESERVED.sub("_", name)
        kind = properties.type(name).name
        if key in ("type", "id") or key in result:
            raise InputError(f"property name {name!r} is not allowed here; rename it")
        if kind == "Reference":
            require_name("ref", value.id(), index_of)
            target = nodes[index_of[value.id()]]  # an <alias> has no node of its own
            result[key] = {"type": "ref", "id": target.props.id()}
        elif kind == "String" and key == "filename":
            file = find_file(value, bases, folders)
            check_mesh_file(result["type"], file)
            result[key] = str(file)
        elif kind != "ResolvedReference":
            signed = key in _SIGNED or (properties.plugin_name(), key) in _SIGNED_OF
            result[key] = _xml_value(key, kind, value, signed=signed)
    return result


def _key(part: Node, ids: Mapping[str, int], numbers: Counter[str], label: str, tag: str) -> str:
    """Choose a key for a child of `part`: its label, or else its tag.

    Separators of paths become underscores. A number is appended if the key is taken.
    """
    stem = _RESERVED.sub("_", label) or tag
    name = stem if label else ""
    while not name or name in part or (name != label and name in ids):
        name = f"{stem}_{numbers[stem]}"
        numbers[stem] += 1
    return name


def _xml_value(key: str, kind: str, value: Any, *, signed: bool) -> Any:
    """Convert a property's value to the form that `mitsuba.load_dict` takes in every variant.

    Raises
    ------
    InputError
        For numbers that Mitsuba would accept, but render as black, NaN or nonsense.
    """
    numbers: list[Any] = []
    if kind in ("Float", "Integer"):
        numbers = [value]
    elif kind == "Spectrum":
        numbers = [*value.wavelengths, *value.values]
    elif kind in ("Color", "Vector"):
        numbers = value = [float(x) for x in value]
    elif kind == "Transform":
        value = np.array(value.matrix, dtype=np.float64)
        numbers = value.ravel().tolist()
    elif kind == "String" and key in _LISTS:
        numbers = _NUMBER.findall(value)  # Mitsuba itself refuses words that aren't numbers
    signed = signed or kind in ("Vector", "Transform")
    wrong = [x for x in map(float, numbers) if not isfinite(x) or (x < 0 and not signed)]
    if wrong:
        allowed = "finite numbers" if signed else "finite numbers of 0 or more"
        raise InputError(f"{key}: {wrong[0]:g} is not allowed; allowed: {allowed}; correct it")
    if kind == "Transform":
        return to_world(value)
    if kind == "Color":
        return {"type": "rgb", "value": value}
    if kind == "Spectrum":
        if len(value.values) == 1 and not len(value.wavelengths):
            return uniform_node(float(value.values[0]))
        return spectrum_node(Spectrum(np.array(value.wavelengths), np.array(value.values)))
    return value
