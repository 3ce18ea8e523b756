"""Copies of files that come with rodcone."""

from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType

from rodcone.errors import InputError
from rodcone.files import write_files
from studies.commands.console import require_new


def copy_example(source: Path, out: Path, ending: str, beside: Mapping[Path, Path] = MappingProxyType({})) -> None:
    """Copy a file to a new one, and print its path.

    `beside` maps further files, which belong to it, to their sources. If one of them exists already, it must have its
    source's content.
    """
    for target, other in beside.items():
        if target.exists() and target.read_bytes() != other.read_bytes():
            raise InputError(
                f"out: {str(target)!r} exists and differs from the example's; allowed: no such file, or the same; "
                "choose another folder"
            )
    require_new(out, ending)
    for target, other in beside.items():
        target.parent.mkdir(exist_ok=True)
        write_files({target: other.read_bytes()})
    write_files({out: source.read_bytes()})
    print(out)
