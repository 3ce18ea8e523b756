"""A user's own scene as a Python dict, checked before anything in it is instantiated."""

import os
import re
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from numbers import Integral, Real
from pathlib import Path
from typing import Any

import numpy as np

from render.geometry import to_world
from render.loader import mitsuba_module
from render.scene import Node, spectrum_node, uniform_node
from render.spectrum import Spectrum
from render.user_scene.allowed_plugins import require_allowed
from render.user_scene.scene_parts import SceneFile, assemble
from render.user_scene.scene_paths import MOST_NESTED, find_file, search_path
from rodcone.errors import InputError
from rodcone.jit import Matrix4

RESERVED = re.compile(r"[./\s]")  # Mitsuba's and our own separators in paths of a scene's dict


def scene_from_dict(
    description: Mapping[str, Any], name: str, *, folder: str | Path = ".", trust: bool = False
) -> SceneFile:
    """Check a dict as `mitsuba.load_dict` takes it, and group its lights.

    Parameters
    ----------
    description : mapping
        Plain values, lists of three numbers, 4x4 transforms (Mitsuba's, Dr.Jit's or NumPy's), nested dicts.
    name : str
    folder : path
        Files are looked for in it, and have to lie inside.
    trust : bool
        As in `load_scene_file`.

    Raises
    ------
    InputError
        As `load_scene_file`; also for a live Mitsuba object, which couldn't be checked, cached or relit.
    """
    mi = mitsuba_module()
    if not trust:
        mi.set_file_resolver(search_path(mi))
    base = Path(os.path.realpath(folder))
    plain = _from_dict(_Rules(base, None if trust else base, trust), description, f"scene {name}")
    return assemble(mi, name, plain)


def inline_spectrum(wavelength_nm: Any, values: Any) -> Node:
    """Mitsuba's inline spectrum, as the plug-in that Mitsuba itself makes of it."""
    if len(values) == 1 and not len(wavelength_nm):
        return uniform_node(float(values[0]))
    return spectrum_node(Spectrum(np.array(wavelength_nm), np.array(values)))


@dataclass(frozen=True)
class _Rules:
    """Where files are looked for, the folder in which they have to lie (None: anywhere), and whether to trust."""

    searched: Path
    folder: Path | None
    trust: bool


def _from_dict(rules: _Rules, description: Mapping[str, Any], where: str, depth: int = 0) -> Node:
    """Copy a dict into plain values, checking its plug-ins and files."""
    if depth > MOST_NESTED:
        raise InputError(f"{where}: dicts are nested over {MOST_NESTED} deep; flatten the scene")
    kind = description.get("type", "scene" if depth == 0 else None)
    if not isinstance(kind, str):
        raise InputError(f"{where}: type {kind!r} is not allowed; name a Mitsuba plug-in")
    try:
        if kind == "spectrum":
            return _dict_spectrum(rules, description)
        if kind == "rgb":
            return {"type": "rgb", "value": np.broadcast_to(np.array(description["value"], np.float64), 3).tolist()}
        if kind != "ref" and not rules.trust:
            require_allowed(kind)
        result: Node = {"type": kind}
        for key, value in description.items():
            if not isinstance(key, str) or RESERVED.search(key):
                raise InputError(f"key {key!r} is not allowed; give a name without '.', '/' and blanks")
            if key == "filename":
                result[key] = str(find_file(str(value), [rules.searched], rules.folder))
            elif key == "id" and not isinstance(value, str):
                raise InputError(f"id {value!r} is not allowed; give a text")
            elif key != "type" and not isinstance(value, Mapping):
                result[key] = _plain(key, value)
    except InputError as error:
        raise InputError(f"{where}: {error}") from None
    except (KeyError, TypeError, ValueError) as error:
        raise InputError(f"{where}: {kind} without a readable value ({error!r}); give numbers") from None
    nested = {key: value for key, value in description.items() if isinstance(value, Mapping)}
    return result | {key: _from_dict(rules, value, f"{where}/{key}", depth + 1) for key, value in nested.items()}


def _dict_spectrum(rules: _Rules, description: Mapping[str, Any]) -> Node:
    if "filename" in description:
        table = np.loadtxt(find_file(str(description["filename"]), [rules.searched], rules.folder), ndmin=2)
    elif isinstance(description["value"], Real):
        return uniform_node(float(description["value"]))
    else:
        table = np.array(description["value"], dtype=np.float64).reshape(-1, 2)
    return inline_spectrum(table[:, 0], table[:, 1])


def _plain(key: str, value: Any) -> Any:
    """Number, text, list of numbers or transform, as Python or Dr.Jit holds it in every variant."""
    if isinstance(value, bool | str | Matrix4):
        return value
    if isinstance(value, Real):
        return int(value) if isinstance(value, Integral) else float(value)
    with suppress(TypeError, ValueError, RuntimeError):
        numbers = np.array(getattr(value, "matrix", value), dtype=np.float64)
        if numbers.shape == (4, 4):
            return to_world(numbers)
        if numbers.shape == (3,):
            return numbers.tolist()
    raise InputError(
        f"{key!r} is of type {type(value).__name__}; allowed: numbers, texts, lists of three numbers, 4x4 transforms, "
        "dicts; write meshes, pictures and other Mitsuba objects to files"
    )
