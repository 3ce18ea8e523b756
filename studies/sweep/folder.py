"""The folder of a sweep: that it is one, that a sweep is at work in it, and what a killed one left half written."""

import fcntl
import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from rodcone.errors import InputError
from rodcone.files import is_half_written
from studies.sweep.database import FILE
from studies.sweep.prepare import FRAMES, PICTURES, PILOTS, RENDERS

MARKER = ".rodcone-sweep"  # locked by each sweep at work: the lock ends with its process, however that ends


@contextmanager
def at_work(out: Path) -> Iterator[None]:
    """Make a folder that of sweeps, and hold its lock; where no other does, remove what killed ones left half written.

    A new or an empty folder is marked; hidden files don't count.

    Raises
    ------
    InputError
        For a folder that holds other files and no sweep.
    OSError
        Where it can't be written.
    """
    out.mkdir(parents=True, exist_ok=True)
    if not any((out / name).is_file() for name in (MARKER, FILE)):
        others = sorted(path.name for path in out.iterdir() if not path.name.startswith("."))
        if others:
            raise InputError(
                f"out: {out} holds other files, such as {others[0]!r}; allowed: a new or an empty folder, or that of "
                f"a sweep; write --out {out / 'sweep'}"
            )
    (out / MARKER).touch()
    with (out / MARKER).open("rb") as marker:
        with suppress(OSError):  # another sweep is at work, or this file system has no locks
            fcntl.flock(marker, fcntl.LOCK_EX | fcntl.LOCK_NB)
            _remove_half_written(out)
        with suppress(OSError):
            fcntl.flock(marker, fcntl.LOCK_SH)
        yield


def _remove_half_written(out: Path) -> None:
    for top in (out / name for name in (RENDERS, FRAMES, PICTURES, PILOTS)):
        # of a linked folder, which others may share, no lock of this one tells who is at work in it
        for folder, _, files in os.walk(top) if not top.is_symlink() else ():
            for file in files:
                path = Path(folder) / file
                if is_half_written(path):
                    path.unlink(missing_ok=True)
