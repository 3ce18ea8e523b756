"""Renders on disk, keyed by a hash of all that determines them.

The number of samples isn't in the key, nor are the lights' spectra and powers: transport doesn't depend on them.
"""

import hashlib
import json
import re
import shutil
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import fields
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np

from render.combine import emission
from render.denoised.denoise import Denoised
from render.error_estimates import Halves, SharedPaths, relative_error
from render.geometry import horizontal_view_deg
from render.level import Irradiance, SceneMeans
from render.loader import INTEGRATOR, Film, variant
from render.scene import Node, Scene, walk
from render.transport import Transport
from rodcone.digests import digest_file, digest_inputs
from rodcone.files import replacing
from rodcone.jit import compiler_version

ENGINE_VERSION = 11  # raise it when a value or an array's name changes, so that older entries are no longer used
_DIGEST_BYTES = hashlib.sha256().digest_size
_ARRAYS = ("variance", "counts")
_MEANS = tuple(field.name for field in fields(SceneMeans))
_VALUES = ("stopped_by", "seconds", "integrator", "variant")
_NOT_IN_NAMES = re.compile(r"[^\w.-]+")  # above all path separators: entries stay in their folder


def read_transport(folder: Path, scene: Scene, film: Film, seed: int, *, denoised: bool = False) -> Transport | None:
    """Read a stored transport; return None where there is no intact file.

    Renders with `denoised` light have files of their own. A file begins with its SHA-256 digest, which reveals
    accidental damage. It is no protection against someone who writes to the folder on purpose.
    """
    arrays = read_arrays(_path(folder, scene, film, seed, _kind(denoised)))
    if arrays is None:
        return None
    values = json.loads(str(arrays["values"]))
    lights = emission(scene.groups, film.wavelength_nm, film.width_nm)
    shared = SharedPaths(tuple(values["shared"]), arrays["correlation"]) if values["shared"] else None
    return Transport(
        **{name: arrays[name] for name in _ARRAYS},
        **{name: values[name] for name in _VALUES},
        light=_halves(arrays, "light"),
        coverage=_halves(arrays, "coverage"),
        seen=tuple(_halves(arrays, f"seen_{index}") for index in range(len(scene.groups))),
        scene_means=SceneMeans(**{name: arrays[f"mean_{name}"] for name in _MEANS}),
        groups=dict(scene.groups),
        wavelength_nm=film.wavelength_nm,
        width_nm=film.width_nm,
        relative_mc_error=relative_error(lights, arrays["light_mean"], arrays["variance"], shared),
        shared=shared,
        denoised=_denoised(arrays, values) if denoised else None,
        horizontal_view_deg=horizontal_view_deg(scene.geometry["sensor"], film.size) or None,
    )


def save_transport(folder: Path, scene: Scene, film: Film, seed: int, transport: Transport) -> None:
    """Store a transport; readers see the whole file or none."""
    shared = transport.shared
    arrays: dict[str, Any] = {name: np.ascontiguousarray(getattr(transport, name)) for name in _ARRAYS}
    halves = {"light": transport.light, "coverage": transport.coverage}
    halves |= {f"seen_{index}": of_group for index, of_group in enumerate(transport.seen)}
    arrays |= {f"mean_{name}": x for name, x in vars(transport.scene_means).items()}
    arrays |= {"correlation": shared.correlation} if shared else {}
    values = {name: getattr(transport, name) for name in _VALUES} | {"shared": shared.groups if shared else None}
    if denoised := transport.denoised:
        arrays |= {"denoised": denoised.radiance}
        halves |= {"indirect": denoised.indirect, "folds": denoised.folds}
        values |= {"fold_points": denoised.fold_points}
    arrays |= {f"{name}_{part}": x for name, both in halves.items() for part, x in vars(both).items()}
    path = _path(folder, scene, film, seed, _kind(transport.denoised is not None))
    write_arrays(path, arrays | {"values": np.array(json.dumps(values))})


@contextmanager
def kept_beside(out: Path) -> Iterator[Path]:
    """Give a folder that keeps a render until the file made from it is written, so that a failure doesn't lose it.

    The folder lies beside the file and is removed once the file is there. If there is an error, its note says that the
    same command continues from the kept render. If the render itself is refused, there is no folder.
    """
    folder = _folder_beside(out)
    try:
        yield folder
    except BaseException as error:
        note_kept(error, out)
        raise
    shutil.rmtree(folder, ignore_errors=True)


def note_kept(error: BaseException, out: Path) -> None:
    """Add a note to an error that says where a file's render is kept, if it is (`kept_beside`)."""
    if out.name and (folder := _folder_beside(out)).is_dir():
        error.add_note(f"the render is kept in {folder}, from which the same command goes on")


def _folder_beside(out: Path) -> Path:
    return out.with_name(f".{out.name}.render")


def _kind(denoised: bool) -> str:
    return f"denoised {metadata.version('mitsuba-oidn')}" if denoised else "render"


def _denoised(arrays: Mapping[str, Any], values: Mapping[str, Any]) -> Denoised:
    indirect, folds = _halves(arrays, "indirect"), _halves(arrays, "folds")
    return Denoised(arrays["denoised"], indirect, folds, fold_points=values["fold_points"])


def _halves(arrays: Mapping[str, Any], name: str) -> Halves:
    return Halves(arrays[f"{name}_mean"], arrays[f"{name}_difference"])


def load_irradiance(folder: Path, scene: Scene, film: Film, seed: int) -> Irradiance | None:
    """Read the stored irradiance of the reference plane; return None where there is no intact file."""
    arrays = read_arrays(_path(folder, scene, film, seed, "meter"))
    return None if arrays is None else Irradiance(**arrays)


def save_irradiance(folder: Path, scene: Scene, film: Film, seed: int, irradiance: Irradiance) -> None:
    """Store an irradiance beside the renders."""
    write_arrays(_path(folder, scene, film, seed, "meter"), vars(irradiance))


def read_arrays(path: Path) -> dict[str, Any] | None:
    """Read the arrays of a file; return None if it is missing or damaged."""
    try:
        with path.open("rb") as file:
            stated = file.read(_DIGEST_BYTES)
            if hashlib.file_digest(file, "sha256").digest() != stated:
                return None
            file.seek(_DIGEST_BYTES)
            with np.load(file) as entry:
                return dict(entry)
    except OSError:
        return None


def write_arrays(path: Path, arrays: Mapping[str, Any], *, packed: bool = False) -> None:
    """Write arrays after their digest, compressed if `packed`; readers see the whole file or none."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with replacing(path) as (place,), place.open("w+b") as file:
        file.write(bytes(_DIGEST_BYTES))
        (np.savez_compressed if packed else np.savez)(file, **arrays)
        file.seek(_DIGEST_BYTES)
        content = hashlib.file_digest(file, "sha256").digest()
        file.seek(0)
        file.write(content)


def _path(folder: Path, scene: Scene, film: Film, seed: int, kind: str = "render") -> Path:
    libraries = map(metadata.version, ("mitsuba", "drjit"))
    engine = [ENGINE_VERSION, kind, INTEGRATOR, variant(), compiler_version(), *libraries]
    key = digest_inputs([*engine, *scene_terms(scene, film), seed])
    return folder / f"{_NOT_IN_NAMES.sub('_', scene.name)}-{key}.npz"


def scene_terms(scene: Scene, film: Film) -> list[Any]:
    """List all that decides a scene's light transport on a film, except the engine; lamps' spectra and powers don't."""
    groups = [[name, group.emitters, group.coloured] for name, group in scene.groups.items()]
    return [scene.name, scene.geometry, scene.reference_plane, file_digests(scene.geometry), groups, film]


def file_digests(geometry: Node) -> list[str]:
    """Digest the content of the files (meshes, bitmaps) that a scene's dict names, in its order."""
    files = [str(part["filename"]) for _, part in walk(geometry) if "filename" in part]
    return [digest_file(file) for file in files if Path(file).is_file()]
