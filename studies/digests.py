"""Hashes that name what determines a result: plain data by its values, files by their content, code by its sources."""

import hashlib
import json
import re
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from functools import cache
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np

from render.scene import Scene

_LENGTH = 32  # hexadecimal digits, 128 bits: two of a million cells meet with a chance of 1e-27
_FOLDERS = ("render", "scenes", "sensor", "isp")  # beside `studies`, all of them decide a picture
# Of this package what making a frame and running a cell import; the other modules only ask, store and show.
_DECIDING = ("cell_run", "frames")
_IMPORT = re.compile(r"^\s*from studies\.(\w+) import", re.MULTILINE)
_CODE = (".py", ".toml", ".csv")


def digest(value: Any) -> str:
    """Hash of plain data: numbers, texts, arrays, dataclasses, mappings and sequences of them."""
    return digest_bytes(json.dumps(_plain(value), sort_keys=True).encode())


def digest_bytes(*parts: bytes | memoryview) -> str:
    """Hash of bytes, one after the other."""
    made = hashlib.sha256()
    for part in parts:
        made.update(part)
    return made.hexdigest()[:_LENGTH]


def digest_file(path: str | Path) -> str:
    """Hash of a file's content."""
    with Path(path).open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()[:_LENGTH]


def digest_scene(scene: Scene) -> str:
    """Hash of a scene, the meshes and bitmaps that it names by their content."""
    return digest([scene, _contents(scene.geometry)])


@cache
def code_version() -> str:
    """Version of rodcone, and the hash of the sources that decide a picture."""
    here = Path(__file__).parent
    files = [path for name in _FOLDERS for path in (here.parent / name).rglob("*") if path.suffix in _CODE]
    files += [here / f"{name}.py" for name in deciding_modules()]
    contents = {path.relative_to(here.parent).as_posix(): digest_file(path) for path in files}
    return f"{metadata.version('rodcone')}+{digest(contents)[:12]}"


def deciding_modules() -> list[str]:
    """Modules of `studies` that decide a picture: `_DECIDING` and all that these import, in alphabetical order."""
    here, found, waiting = Path(__file__).parent, set[str](), list(_DECIDING)
    while waiting:
        name = waiting.pop()
        if name not in found:
            found.add(name)
            waiting += _IMPORT.findall((here / f"{name}.py").read_text("utf-8"))
    return sorted(found)


def _plain(value: Any) -> Any:
    if is_dataclass(value) and not isinstance(value, type):
        return {field.name: _plain(getattr(value, field.name)) for field in fields(value)}
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if value is None or isinstance(value, str | bool | int | float):
        return value
    return np.asarray(value).tolist()  # arrays, NumPy's scalars and Dr.Jit's matrices


def _contents(node: Mapping[str, Any]) -> list[str]:
    """Hashes of the files that a scene's dict names, in its order."""
    found = []
    for key, value in node.items():
        if isinstance(value, Mapping):
            found += _contents(value)
        elif key == "filename" and Path(str(value)).is_file():
            found.append(digest_file(str(value)))
    return found
