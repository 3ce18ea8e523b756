"""Finished renders on disk, under the hash of everything that determines them."""

import hashlib
import json
import os
import tempfile
from collections.abc import Mapping
from dataclasses import asdict
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np

from render.loader import Film, integrator_name, variant
from render.scene import Scene
from render.transport import Transport

ENGINE_VERSION = 1  # raise it with any change that moves a rendered value: older entries are then not used
_DIGEST_BYTES = hashlib.sha256().digest_size
_ARRAYS = ("radiance", "half_difference", "variance", "irradiance", "emitter_visible")
_VALUES = ("spp", "passes", "stopped_by", "seconds", "integrator", "variant")


def load_transport(folder: Path, scene: Scene, film: Film, settings: Mapping[str, Any]) -> Transport | None:
    """Stored transport, or None where there is none that is whole: a SHA-256 digest ends the file."""
    try:
        content = _path(folder, scene, film, settings).read_bytes()
    except OSError:
        return None
    archive, digest = content[:-_DIGEST_BYTES], content[-_DIGEST_BYTES:]
    if hashlib.sha256(archive).digest() != digest:
        return None
    with np.load(BytesIO(archive), allow_pickle=False) as entry:
        arrays: dict[str, Any] = {name: entry.get(name) for name in _ARRAYS}
        values = json.loads(str(entry["values"]))
    return Transport(
        **arrays,
        **{name: values[name] for name in _VALUES},
        groups=dict(scene.groups),
        wavelength_nm=film.wavelength_nm,
        width_nm=film.width_nm,
    )


def save_transport(folder: Path, scene: Scene, film: Film, settings: Mapping[str, Any], transport: Transport) -> None:
    """Store a transport; readers see the whole file or none."""
    folder.mkdir(parents=True, exist_ok=True)
    arrays = {name: getattr(transport, name) for name in _ARRAYS if getattr(transport, name) is not None}
    values = json.dumps({name: getattr(transport, name) for name in _VALUES})
    handle, temporary = tempfile.mkstemp(dir=folder, suffix=".part")
    try:
        with os.fdopen(handle, "wb") as file:
            archive = BytesIO()
            np.savez(archive, values=np.array(values), **arrays)
            file.write(archive.getbuffer())
            file.write(hashlib.sha256(archive.getbuffer()).digest())
        Path(temporary).replace(_path(folder, scene, film, settings))
    finally:
        Path(temporary).unlink(missing_ok=True)


def _path(folder: Path, scene: Scene, film: Film, settings: Mapping[str, Any]) -> Path:
    key = {
        "engine": [ENGINE_VERSION, integrator_name(), variant()],
        "scene": [scene.name, scene.description, scene.reference_plane],
        "groups": [[name, group.emitters] for name, group in scene.groups.items()],
        "film": asdict(film),
        "settings": dict(settings),
    }
    text = json.dumps(key, sort_keys=True, default=lambda value: np.asarray(value).tolist())
    return folder / f"{scene.name}-{hashlib.sha256(text.encode()).hexdigest()[:20]}.npz"
