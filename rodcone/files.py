"""Files that appear whole or not at all."""

import errno
import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from rodcone.errors import InputError


@contextmanager
def replacing(*paths: Path) -> Iterator[tuple[Path, ...]]:
    """Yield a temporary path beside each path; at the end they are renamed, in this order. On failure none is.

    Raises
    ------
    OSError
        Where the folder, which has to be the same for all, is missing or can't be written; it names the first path.
    """
    with _folder_beside(paths[0]) as parts:
        places = tuple(Path(parts) / path.name for path in paths)
        yield places
        for place, path in zip(places, paths, strict=True):
            os.replace(place, path)


def check_place(path: Path) -> None:
    """Make the folder of a file to be written later, and raise `OSError` where it can't be written there."""
    path.parent.mkdir(parents=True, exist_ok=True)
    if path.is_dir():
        raise OSError(errno.EISDIR, os.strerror(errno.EISDIR), str(path))
    with _folder_beside(path):
        pass


def inside(folder: Path, name: str) -> Path:
    """Path of a file that another file names, which has to lie below a folder.

    Raises
    ------
    InputError
        For an absolute name, one that leads out by ``..`` or by a link, or one that no file can have.
    """
    path = folder / name
    if not name or "\0" in name or not Path(os.path.realpath(path)).is_relative_to(os.path.realpath(folder)):
        raise InputError(f"{name!r} does not lie in {folder}; allowed: names below it; correct it")
    return path


def _folder_beside(path: Path) -> "tempfile.TemporaryDirectory[str]":
    try:
        return tempfile.TemporaryDirectory(dir=path.parent, prefix=".part-")
    except OSError as error:  # it names the temporary folder, which the user did not ask for
        raise OSError(error.errno, error.strerror, str(path)) from error
