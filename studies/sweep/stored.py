"""Files named by the digest of their content: how a sweep keeps arrays and pictures, and notices damage on reading.

Against accidents, not intent: bit rot, files cut short, runs that were killed.
"""

from functools import lru_cache
from pathlib import Path

from rodcone.digests import digest_bytes, digest_file
from rodcone.errors import InputError, one_line
from rodcone.files import inside, replacing


def keep(folder: Path, content: bytes | memoryview, ending: str) -> str:
    """Write a file under the digest of its content, whole or not at all; returns its name below the folder."""
    name = digest_bytes(content)
    place = folder / name[:2] / f"{name}{ending}"
    place.parent.mkdir(parents=True, exist_ok=True)
    with replacing(place) as (part,):
        part.write_bytes(content)
    return f"{name[:2]}/{name}{ending}"


def is_whole(path: Path) -> bool:
    """Whether a file is there and holds what it is named after; its content is read once a process."""
    try:
        status = path.stat()
        return _holds_its_name(path, status.st_mtime_ns, status.st_size)
    except OSError:
        return False


@lru_cache(maxsize=4096)
def _holds_its_name(path: Path, changed_ns: int, size: int) -> bool:
    return digest_file(path) == path.stem


def read_whole(folder: Path, name: str) -> bytes:
    """Content of a kept file.

    Raises
    ------
    InputError
        Where it lies outside the folder, can't be read, or isn't what was written.
    """
    path = inside(folder, name)
    try:
        content = path.read_bytes()
    except OSError as error:
        raise InputError(
            f"{path}: can't be read ({one_line(error)}); run rodcone sweep again, which makes it"
        ) from error
    if digest_bytes(content) != path.stem:
        raise InputError(f"{path}: it isn't what was written (damaged); run rodcone sweep again, which makes it")
    return content
