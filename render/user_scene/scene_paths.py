"""Checks of a scene's XML before Mitsuba reads it, and of the files that it names.

Mitsuba's parser acts while it reads: ``<include>`` and ``<spectrum filename>`` open files, ``$parameters`` multiply
text, and deep nesting crashes the process. Therefore expat, which only reads, goes first. ``<path>`` adds a folder in
which files are looked for, and from which plug-ins would be loaded. These folders are on Mitsuba's search path only
while it parses, which loads no plug-in. Before anything is instantiated they are removed, and files are named by their
absolute paths.
"""

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from importlib.util import find_spec
from pathlib import Path
from types import ModuleType
from typing import Any, NoReturn
from xml.parsers import expat

from rodcone.errors import InputError

# These limits are far above any scene that a person or an exporter writes, and far below what crashes the process:
# Mitsuba 3.9 crashes at 100 000 nested elements.
MOST_NESTED = 64
MOST_FILES = 200
MOST_BYTES = 64 << 20
MOST_SUBSTITUTED = 10_000_000  # characters that $parameters may add
TRUST = "if you trust the scene, trust=True or --trust-scene"


def find_file(name: str, bases: Sequence[Path], folders: Sequence[Path] | None) -> Path:
    """Find a file that a scene names; return its path without resolving links.

    Files that this file names are then looked for beside the link.

    Parameters
    ----------
    name : str
    bases : sequence of Path
        Folders in which a relative name is looked for, in this order.
    folders : sequence of Path or None
        Folders in one of which the file has to lie after links are resolved; None allows any folder.

    Raises
    ------
    InputError
        For a file outside the folders, a missing file, or one that isn't a plain file.
    """
    if not name or "\0" in name:
        raise InputError(f"file {name!r} is not allowed; name a file in the scene's folder")
    candidates = [str(base / name) for base in bases]
    chosen = next(filter(os.path.exists, candidates), candidates[0])
    real = Path(os.path.realpath(chosen))
    if folders is not None and not any(real.is_relative_to(os.path.realpath(folder)) for folder in folders):
        raise InputError(
            f"file {name!r} lies outside the scene's folder and those of its <path>; move it there, or, {TRUST}"
        )
    if not os.path.exists(chosen):
        places = ", ".join(map(str, bases))
        raise InputError(f"file {name!r} is missing in {places}; put it there or correct the name")
    if not os.path.isfile(chosen):
        raise InputError(f"file {name!r} is a folder or a device; allowed: a plain file; correct the name")
    return Path(chosen)


def search_path(mi: ModuleType, *folders: Path) -> Any:
    """Make Mitsuba's search path: given folders, Mitsuba's own, and the one of scikit-image, whose pictures scenes use.

    The working directory, which Mitsuba puts first, is left out: a ``plugins/diffuse.so`` in it would be loaded.
    """
    resolver = mi.FileResolver()
    resolver.clear()
    package = find_spec("skimage")
    assert package
    assert package.origin
    assert mi.__file__
    for folder in (*folders, Path(mi.__file__).parent, Path(package.origin).parents[1]):
        resolver.append(str(folder))
    return resolver


@dataclass
class _Spent:
    """Running totals over the scene file and all its includes."""

    files: int = 0
    bytes: int = 0
    substituted: int = 0
    parameters: dict[str, str] = field(default_factory=dict)


def screen(path: Path, trust: bool, define: Mapping[str, str]) -> list[Path]:
    """Read a scene file and its includes, and raise `InputError` for anything that Mitsuba's parser mustn't see.

    Returns
    -------
    list of Path
        Folders in which the scene's files are looked for: those of its ``<path>`` elements, the last one first, then
        its own.

    Parameters
    ----------
    path : Path
        Scene file, absolute.
    trust : bool
        Whether files may lie anywhere, instead of only in those folders.
    define : mapping of str to str
        Values of $parameters, which take precedence over those of <default>.
    """
    folders = [path.parent]
    _screen(path, folders, None if trust else folders, 0, _Spent(parameters=dict(define)))
    return folders


def _screen(path: Path, bases: list[Path], allowed: list[Path] | None, level: int, spent: _Spent) -> None:
    parser = expat.ParserCreate("utf-8")
    depth = level

    def refuse(reason: object) -> NoReturn:
        raise InputError(
            f"{path} (line {parser.CurrentLineNumber}, col {parser.CurrentColumnNumber + 1}): {reason}"
        ) from None

    def start(tag: str, attributes: dict[str, str]) -> None:
        nonlocal depth
        depth += 1
        try:
            # As in Mitsuba, a file's own folder is searched only for files that it includes. Its other files are
            # searched for in `bases`, which hold the folder of the file that included it.
            places = [path.parent, *bases] if tag == "include" else bases
            named = _checked_element(tag, attributes, depth, places, allowed, spent)
            if tag == "path":  # the latest comes first
                named_folder = _named_folder(attributes.get("value", ""), [path.parent, *bases], spent)
                bases.insert(0, named_folder)
                if allowed is not None and named_folder not in allowed:
                    allowed.insert(0, named_folder)  # a <path> in an included file counts for all files
        except InputError as error:
            refuse(error)
        if named and tag == "include":
            _screen(named, [path.parent, *bases], allowed, depth, spent)

    def end(_: str) -> None:
        nonlocal depth
        depth -= 1

    parser.StartDoctypeDeclHandler = lambda *_: refuse("a DOCTYPE is not allowed; remove it")
    parser.StartElementHandler, parser.EndElementHandler = start, end
    try:
        parser.Parse(_content(path, spent), True)
    except expat.ExpatError as error:
        raise InputError(
            f"{path} (line {error.lineno}, col {error.offset + 1}): "
            f"not well-formed XML, {expat.ErrorString(error.code)}; correct the file"
        ) from None


def _content(path: Path, spent: _Spent) -> bytes:
    spent.files += 1
    spent.bytes += path.stat().st_size
    if spent.files > MOST_FILES or spent.bytes > MOST_BYTES:
        raise InputError(
            f"{path}: the scene's XML is over {MOST_BYTES >> 20} MiB or {MOST_FILES} files, each include counted; "
            "put meshes into .ply files, and let no file include itself"
        )
    content = path.read_bytes()
    try:
        content.decode("utf-8")  # in another encoding, expat and Mitsuba might read different elements
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: byte {error.start} is no UTF-8; allowed: XML in UTF-8; save it so") from None
    return content


def _checked_element(
    tag: str, attributes: dict[str, str], depth: int, bases: list[Path], allowed: list[Path] | None, spent: _Spent
) -> Path | None:
    """Check one element; return the file that Mitsuba's parser would open for it, or None."""
    if depth > MOST_NESTED:
        raise InputError(f"elements are nested over {MOST_NESTED} deep; flatten the scene")
    longest = max(map(len, spent.parameters.values()), default=0)
    # A parameter's value may contain earlier parameters, so that ten lines of <default> could fill the memory.
    spent.substituted += sum(value.count("$") for value in attributes.values()) * longest
    if spent.substituted > MOST_SUBSTITUTED:
        raise InputError(f"$parameters grow past {MOST_SUBSTITUTED} characters; write the values out")
    if tag == "default":
        given = {name: _substitute(value, spent.parameters) for name, value in attributes.items()}
        spent.parameters.setdefault(given.get("name", ""), given.get("value", ""))
    if tag not in ("include", "spectrum") or "filename" not in attributes:
        return None
    return find_file(_substitute(attributes["filename"], spent.parameters), bases, allowed)


def _named_folder(value: str, bases: list[Path], spent: _Spent) -> Path:
    """Return the folder that a ``<path>`` adds to the search path."""
    name = _substitute(value, spent.parameters)
    for base in bases:
        if (base / name).is_dir():
            return base / name
    raise InputError(f"<path> folder {name!r} is missing in {bases[0]}; put it there or correct the name")


def _substitute(text: str, parameters: Mapping[str, str]) -> str:
    """Replace ``$parameters`` by their values as Mitsuba does, longest names first."""
    if "\\$" in text:
        raise InputError(f"{text!r} holds an escaped $, which is not allowed here; name files without it")
    for name in sorted(parameters, key=len, reverse=True):
        text = text.replace(f"${name}", parameters[name])
    if "$" in text:
        raise InputError(f"{text!r} holds an undefined $parameter; state it by <default> before")
    return text
