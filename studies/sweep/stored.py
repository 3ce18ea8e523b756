"""Files named by the digest of their content, in which a sweep keeps arrays and pictures; a reader notices damage.

The digest reveals accidents, such as bit rot, files cut short and runs that were killed. It is no protection against
intent.
"""

import json
import platform
from collections.abc import Mapping
from functools import lru_cache
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rodcone.digests import digest, digest_bytes, digest_file
from rodcone.errors import InputError, read_errors
from rodcone.files import inside, write_files


def keep(folder: Path, content: bytes | memoryview, ending: str) -> str:
    """Write a file under the digest of its content, whole or not at all; return its name below the folder."""
    name = digest_bytes(content)
    place = folder / name[:2] / f"{name}{ending}"
    place.parent.mkdir(parents=True, exist_ok=True)
    write_files({place: content})
    return f"{name[:2]}/{name}{ending}"


def keep_array(folder: Path, array: NDArray[Any]) -> str:
    """Write an array as ``.npy`` by `keep`."""
    file = BytesIO()
    np.save(file, array)
    return keep(folder, file.getbuffer(), ".npy")


def read_array(path: Path) -> NDArray[np.floating]:
    """Map a kept array into memory.

    Raises
    ------
    InputError
        If this machine can't read the file, or its content isn't what was written.
    """
    if not is_whole(path):
        raise InputError(
            f"{path}: can't be read on {platform.node()}, or isn't what was written; allowed: a folder that all "
            "workers see under the same path; give one with --out, or run the sweep again where the file is damaged"
        )
    return np.asarray(np.load(path, mmap_mode="r", allow_pickle=False))


def keep_facts(folder: Path, key: str, facts: Mapping[str, Any]) -> None:
    """Write facts under a key as JSON with their digest, whole or not at all."""
    write_files({folder / f"{key}.json": json.dumps({"facts": facts, "digest": digest(facts)})})


def read_facts(folder: Path, key: str) -> dict[str, Any] | None:
    """Return the facts that `keep_facts` stored; None where they are missing or damaged."""
    try:
        stored = json.loads((folder / f"{key}.json").read_text("utf-8"))
    except (OSError, ValueError):
        return None
    if not isinstance(stored, dict) or digest(stored.get("facts")) != stored.get("digest"):
        return None
    return dict(stored["facts"])


def is_whole(path: Path) -> bool:
    """Return whether a file exists and has the content that it is named after; its content is read once per process."""
    try:
        status = path.stat()
        return _holds_its_name(path, status.st_mtime_ns, status.st_size)
    except OSError:
        return False


@lru_cache(maxsize=4096)
def _holds_its_name(path: Path, changed_ns: int, size: int) -> bool:
    return digest_file(path) == path.stem


def read_whole(folder: Path, name: str) -> bytes:
    """Return the content of a kept file.

    Raises
    ------
    InputError
        Where it lies outside the folder, can't be read, or isn't what was written.
    """
    path = inside(folder, name)
    with read_errors(f"{path}: can't be read", "run rodcone sweep again, which makes it", OSError):
        content = path.read_bytes()
    if digest_bytes(content) != path.stem:
        raise InputError(f"{path}: it isn't what was written (damaged); run rodcone sweep again, which makes it")
    return content
