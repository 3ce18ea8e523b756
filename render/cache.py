"""Renders on disk, under the hash of all that determines them.

How far they were taken isn't in it, nor are the lights' spectra and powers: transport doesn't depend on them.
"""

import hashlib
import json
import os
import re
import tempfile
from dataclasses import asdict
from math import inf
from pathlib import Path
from typing import Any, BinaryIO, get_args

import numpy as np
from numpy.typing import NDArray

from render.error_estimates import SharedPaths, relative_error
from render.loader import Film, integrator_name, variant
from render.scene import Node, Scene
from render.stored_arrays import Form, read_arrays
from render.transport import Stop, Transport, emission

ENGINE_VERSION = 3  # raise it with any change that moves a rendered value: older entries are then not used
_DIGEST_BYTES = hashlib.sha256().digest_size
_ARRAYS = ("radiance", "half_difference", "variance", "irradiance", "emitter_visible")
_VALUES = ("spp", "passes", "stopped_by", "seconds", "integrator", "variant")
_CHUNK_BYTES = 1 << 22
_NOT_IN_NAMES = re.compile(r"[^\w.-]+")  # separators of folders above all: entries stay in theirs


def load_transport(folder: Path, scene: Scene, film: Film, seed: int) -> Transport | None:
    """Stored transport, or None where there is none that is whole: a SHA-256 digest ends the file.

    The digest tells damage, not intent: shapes, types and values have to be such as scene and film ask for.
    """
    try:
        path = _path(folder, scene, film, seed)
        with path.open("rb") as file:
            size = path.stat().st_size - _DIGEST_BYTES
            digest = _digest(file, size)
            if size < 0 or file.read() != digest:
                return None
            file.seek(0)
            arrays, values = _entry(file, scene, film)
    except (OSError, ValueError, RecursionError):
        return None
    correlation = arrays.pop("correlation", None)
    shared = None if correlation is None else SharedPaths(tuple(values["shared"]), correlation)
    lights = emission(scene.groups, film.wavelength_nm, film.width_nm)
    return Transport(
        **{name: arrays.get(name) for name in _ARRAYS},  # type: ignore[arg-type]
        **{name: values[name] for name in _VALUES},
        groups=dict(scene.groups),
        wavelength_nm=film.wavelength_nm,
        width_nm=film.width_nm,
        relative_mc_error=relative_error(lights, arrays["radiance"], arrays["variance"], shared=shared),
        shared=shared,
    )


def _entry(file: BinaryIO, scene: Scene, film: Film) -> tuple[dict[str, NDArray[Any]], dict[str, Any]]:
    """Arrays and values of a file; `ValueError` where they can't be a render of this scene on this film."""
    groups, bands = len(scene.groups), film.wavelength_nm.size
    forms: dict[str, Form] = dict.fromkeys(_ARRAYS[:3], ("<f4", (groups, bands, *film.size)))
    forms["emitter_visible"] = ("?", film.size)
    if scene.reference_plane:
        forms["irradiance"] = ("<f8", (groups, bands))
    try:
        arrays, text = read_arrays(file, forms, "values")
    except ValueError:  # two groups along the same paths
        arrays, text = read_arrays(file, forms | {"correlation": ("<f4", (bands, *film.size))}, "values")
    extremes = [(array.min(), array.max()) for array in arrays.values()]  # NaN carries through
    with np.errstate(invalid="ignore"):  # a NaN that signals does so when it is converted
        finite = np.isfinite(np.array(extremes, dtype=np.float64))
    if not np.all(finite):
        raise ValueError("it holds numbers that are not finite")
    values = json.loads(text)
    if not isinstance(values, dict) or values.keys() != {*_VALUES, "shared"}:
        raise ValueError("it holds other values")
    whole = all(type(values[name]) is int and 0 < values[name] < 1 << 31 for name in ("spp", "passes"))
    timed = type(values["seconds"]) is float and 0 <= values["seconds"] < inf
    made = (values["integrator"], values["variant"]) == (integrator_name(), variant())
    pairs = [None] if "correlation" not in arrays else [[i, j] for i in range(groups) for j in range(groups) if i != j]
    if not (whole and timed and made and values["stopped_by"] in get_args(Stop) and values["shared"] in pairs):
        raise ValueError("a value is out of its range")
    return arrays, values


def save_transport(folder: Path, scene: Scene, film: Film, seed: int, transport: Transport) -> None:
    """Store a transport; readers see the whole file or none."""
    folder.mkdir(parents=True, exist_ok=True)
    given = {name: getattr(transport, name) for name in _ARRAYS}
    arrays: dict[str, Any] = {name: np.ascontiguousarray(array) for name, array in given.items() if array is not None}
    values = {name: getattr(transport, name) for name in _VALUES}
    values["shared"] = transport.shared.groups if transport.shared else None
    if transport.shared:
        arrays["correlation"] = np.ascontiguousarray(transport.shared.correlation)
    handle, temporary = tempfile.mkstemp(dir=folder, suffix=".part")
    try:
        with os.fdopen(handle, "w+b") as file:
            np.savez(file, values=np.array(json.dumps(values)), **arrays)
            size = file.seek(0, os.SEEK_END)
            file.seek(0)
            digest = _digest(file, size)
            file.seek(0, os.SEEK_END)
            file.write(digest)
        Path(temporary).replace(_path(folder, scene, film, seed))
    finally:
        Path(temporary).unlink(missing_ok=True)


def _digest(file: BinaryIO, size: int) -> bytes:
    """SHA-256 of the next `size` bytes, read in pieces."""
    digest = hashlib.sha256()
    while size > 0 and (piece := file.read(min(size, _CHUNK_BYTES))):
        digest.update(piece)
        size -= len(piece)
    return digest.digest()


def _path(folder: Path, scene: Scene, film: Film, seed: int) -> Path:
    key = {
        "engine": [ENGINE_VERSION, integrator_name(), variant()],
        "scene": [scene.name, scene.geometry, scene.reference_plane, _file_digests(scene.geometry)],
        "groups": [[name, group.emitters, group.own_colour] for name, group in scene.groups.items()],
        "film": asdict(film),
        "seed": seed,
    }
    text = json.dumps(key, sort_keys=True, default=lambda value: np.asarray(value).tolist())
    name = _NOT_IN_NAMES.sub("_", scene.name)
    return folder / f"{name}-{hashlib.sha256(text.encode()).hexdigest()[:20]}.npz"


def _file_digests(node: Node) -> list[str]:
    """Content of the files (meshes, bitmaps) that a scene's dict names, in its order."""
    digests = []
    for key, value in node.items():
        if isinstance(value, dict):
            digests += _file_digests(value)
        elif key == "filename" and Path(str(value)).is_file():
            digests.append(hashlib.sha256(Path(str(value)).read_bytes()).hexdigest())
    return digests
