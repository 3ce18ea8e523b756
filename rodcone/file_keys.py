"""Keys in other programs' files that change what is read: file_keys.toml says which are applied, and which refused."""

import tomllib
from collections.abc import Mapping
from difflib import get_close_matches
from functools import cache
from pathlib import Path
from typing import Any

from rodcone.errors import InputError

_LIKE = 0.85  # similarity from which on an unknown key counts as a misspelt known one


@cache
def formats() -> Mapping[str, Mapping[str, Any]]:
    """Read the table: known keys by format, with the treatment of each."""
    return tomllib.loads(Path(__file__).with_suffix(".toml").read_text("utf-8"))


def require_known(kind: str, keys: Mapping[str, Any]) -> None:
    """Raise `InputError` for a key that changes values and can't be applied, or that looks like a misspelt known one.

    Parameters
    ----------
    kind : str
        A format of the table, such as ``ENVI header``.
    keys : mapping of str to object
        The file's keys and their values: texts for ENVI, any objects for other formats.
    """
    table = formats()[kind]
    applied, refused = table["applied"], table["refused"]
    for name, nothing in refused.items():
        if name in keys and not _changes_nothing(keys[name], nothing):
            shown = " ".join(str(keys[name]).split())[:40]
            raise InputError(f"{name}: {shown!r} changes values or their places and can't be applied; save without it")
    known = (*applied, *refused, *table["without_effect"])
    for name in keys:
        if name in known:
            continue
        if table.get("only_these"):
            like = get_close_matches(name, known, n=1)
            words = f"did you mean {like[0]!r}? Correct it, or take it out" if like else "take it out"
            raise InputError(f"{kind} {name!r} is unknown; allowed: {', '.join(sorted(known))}; {words}")
        if near := _almost(name, (*applied, *refused)):
            raise InputError(f"{kind} {name!r} is unknown; did you mean {near!r}? Correct it, or take it out")


def _almost(name: str, known: tuple[str, ...]) -> str:
    """Return the known key of the same struct with almost the same spelling; empty if there is none."""
    struct, _, field = name.rpartition("/")
    fields = {key.rpartition("/")[2]: key for key in known if key.rpartition("/")[0] == struct}
    return next((fields[near] for near in get_close_matches(field, fields, n=1, cutoff=_LIKE)), "")


def _changes_nothing(value: object, nothing: str) -> bool:
    """Return whether a value, or each one of a list, is empty or equals `nothing`, which has no effect."""
    if isinstance(value, bool):
        return str(value).lower() == nothing
    parts = str(value).strip("{}[]() \n").replace(" ", "").split(",")
    return all(part in ("", nothing) or _as_number(part) == _as_number(nothing) for part in parts)


def _as_number(text: str) -> float | str:
    try:
        return float(text)
    except ValueError:
        return text
