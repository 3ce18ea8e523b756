"""Files that appear whole or not at all, and reading with a bound."""

import errno
import os
import re
import shutil
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from math import isfinite
from pathlib import Path
from typing import Any

from rodcone.errors import InputError

_FULL_BYTES = 1 << 16  # a disk that refused a write counts as full if it has less free space than this
_HALF_WRITTEN = re.compile(r"\.rodcone-[0-9a-f]{16}(\.\w+)?")


@contextmanager
def replacing(*paths: Path) -> Iterator[tuple[Path, ...]]:
    """Yield a temporary path beside each path; rename them at the end, in this order. On failure rename none.

    Raises
    ------
    OSError
        Where a folder is missing, can't be written or is full; it names the path.
    """
    places = tuple(_place_beside(path) for path in paths)
    try:
        yield places
        for place, path in zip(places, paths, strict=True):
            os.replace(place, path)
    except OSError as error:
        raise _named(error, dict(zip(map(str, places), paths, strict=True))) from error
    finally:
        for place in places:
            place.unlink(missing_ok=True)


def _named(error: OSError, paths: Mapping[str, Path]) -> OSError:
    """Return an error with the path that the caller named and the cause; if a disk is full, libraries omit both."""
    path = paths.get(str(error.filename)) or (next(iter(paths.values())) if error.filename is None else None)
    if path is None:
        return error
    full = shutil.disk_usage(path.parent).free < _FULL_BYTES
    number = errno.ENOSPC if full else error.errno or errno.EIO
    return OSError(number, os.strerror(number) if full or error.errno else str(error), str(path))


def write_files(files: Mapping[Path, str | bytes | memoryview]) -> None:
    """Write files by `replacing`; texts are written as UTF-8, and their line ends aren't changed."""
    with replacing(*files) as places:
        for place, content in zip(places, files.values(), strict=True):
            place.write_bytes(content.encode("utf-8") if isinstance(content, str) else content)


def is_half_written(path: Path) -> bool:
    """Return whether a path is a file that `replacing` began to write and a killed program left behind."""
    return bool(_HALF_WRITTEN.fullmatch(path.name)) and path.is_file() and not path.is_symlink()


def read_bounded(path: Path, most_bytes: int) -> bytes:
    """Read a file of at most `most_bytes` bytes.

    Raises
    ------
    ValueError
        For a folder, for a pipe or a device, which may never end, and for a larger file.
    OSError
        Where there is no file, or it can't be read.
    """
    if path.exists() and not path.is_file():
        raise ValueError("it is a folder or a device; allowed: a file")
    with path.open("rb") as file:
        content = file.read(most_bytes + 1)
    if len(content) > most_bytes:
        raise ValueError(f"it is over {most_bytes} bytes")
    return content


def require_ending(path: Path, *endings: str, what: str = "out") -> None:
    """Raise `InputError` where a file's name has another ending, in capitals or not."""
    if path.suffix.lower() not in endings:
        raise InputError(f"{what}: {str(path)!r} has another ending; allowed: {', '.join(endings)}; rename it")


def check_place(path: Path) -> None:
    """Make the folder of a file to be written later, and raise `OSError` where it can't be written there."""
    path.parent.mkdir(parents=True, exist_ok=True)
    if path.is_dir():
        raise OSError(errno.EISDIR, os.strerror(errno.EISDIR), str(path))
    _place_beside(path)


def inside(folder: Path, name: str) -> Path:
    """Return the path of a file that another file names, which has to lie below a folder.

    Raises
    ------
    InputError
        For an absolute name, one that leads out by ``..`` or by a link, or one that no file can have.
    """
    path = folder / name
    if not name or "\0" in name or not Path(os.path.realpath(path)).is_relative_to(os.path.realpath(folder)):
        raise InputError(f"{name!r} does not lie in {folder}; allowed: names below it; correct it")
    return path


def _place_beside(path: Path) -> Path:
    """Return a new path beside a path, in a folder that can be written to.

    It has the path's ending, because writers choose a format by it.
    """
    place = path.with_name(f".rodcone-{os.urandom(8).hex()}{path.suffix}")
    try:
        place.open("xb").close()
        place.unlink()
    except OSError as error:  # it names the temporary file, which the user did not ask for
        raise OSError(error.errno, error.strerror, str(path)) from error
    return place


def finite(value: object) -> Any:
    """Return a value as a JSON file holds it: None in place of every NaN and infinity, lists in place of tuples."""
    if isinstance(value, float):
        return value if isfinite(value) else None
    if isinstance(value, Mapping):
        return {name: finite(item) for name, item in value.items()}
    return [finite(item) for item in value] if isinstance(value, (list, tuple)) else value
