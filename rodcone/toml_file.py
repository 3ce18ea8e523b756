"""TOML with limits on size, nesting and whole numbers, which Python's parser lacks, and its tables as dataclasses.

The tables are read strictly: an unknown key or a value of another kind is an error that names the key.
"""

import re
import tomllib
from collections.abc import Callable
from dataclasses import fields
from functools import partial
from pathlib import Path
from types import UnionType
from typing import Any, TypeVar, get_args, get_origin

from cattrs import (
    AttributeValidationNote,
    BaseValidationError,
    ClassValidationError,
    Converter,
    ForbiddenExtraKeysError,
    IterableValidationNote,
)

from rodcone.errors import InputError, unknown
from rodcone.files import read_bounded

MOST_BYTES = 1 << 18  # cameras and studies take some 2 kB
# Over 32 parts of a key: the parser's time grows with the square of their number, to 13 s for a file of 40 kB.
_LONG_KEY = re.compile(r"""(?:\.[ \t]*(?:[\w-]+|"[^"\n]*"|'[^'\n]*')[ \t]*){32}""")
Kind = TypeVar("Kind")
_WORDS = {bool: "true or false", str: "a text in quotes", int: "a whole number", float: "a number"}
_TYPES = {bool: (bool,), str: (str,), int: (int,), float: (int, float)}  # what TOML gives for each


def read_toml(path: Path) -> dict[str, Any]:
    """Return the content of a TOML file.

    Raises
    ------
    ValueError
        For a file that is no TOML in UTF-8, is over 256 KiB, nested deeper than Python's parser goes, has a key of over
        32 parts, or holds a whole number of more than 64 bits.
    OSError
        Where there is no file, or it can't be read.
    """
    return parse_toml(read_bounded(path, MOST_BYTES).decode())


def parse_toml(text: str) -> dict[str, Any]:
    """Return the content of a text in TOML; raise `ValueError` as `read_toml` does."""
    if _LONG_KEY.search(text):
        raise ValueError("it is nested too deep")
    try:
        content = tomllib.loads(text)
        _check_numbers(content)
    except RecursionError:
        raise ValueError("it is nested too deep") from None
    return content


def _check_numbers(value: object) -> None:
    if isinstance(value, dict | list):
        for item in value.values() if isinstance(value, dict) else value:
            _check_numbers(item)
    elif isinstance(value, int) and not -(1 << 63) <= value < 1 << 63:  # TOML 1.0, "Integer"
        raise ValueError("it holds a whole number of more than 64 bits")


def strict_converter() -> Converter:
    """Return a converter that accepts a whole number as a number, and converts nothing else.

    Without it a text that reads as a number would become one, and true would become 1.
    """
    converter = Converter(forbid_extra_keys=True)
    for kind in _WORDS:
        converter.register_structure_hook(kind, _one_of(kind))
    converter.register_structure_hook_factory(is_tuple, partial(_tuple_of, converter))
    converter.register_structure_hook_factory(_is_plain_union, lambda kind: _one_of(*get_args(kind)))
    return converter


def structured(content: object, kind: type[Kind], converter: Converter, fix: str) -> Kind:
    """Return the dataclass that a table's keys describe.

    Parameters
    ----------
    content : dict
        Table, as `read_toml` returns it.
    fix : str
        Where to look for what is allowed, such as ``see rodcone new study``.

    Raises
    ------
    InputError
        For the first fault, named by its keys; for an unknown key with the one that was likely meant.
    """
    try:
        return converter.structure(content, kind)
    except ClassValidationError as error:
        raise InputError(_first_fault(error, fix)) from error


def is_tuple(kind: object) -> bool:
    """Return whether a type is a tuple of others."""
    origin: object = get_origin(kind)
    return origin is tuple


def _is_plain_union(kind: object) -> bool:
    return get_origin(kind) is UnionType and set(get_args(kind)) <= {*_WORDS, type(None)}


def _one_of(*kinds: type) -> Callable[[Any, Any], Any]:
    """Return a hook that accepts a value of one of these kinds, and converts it to the first kind that fits."""
    plain = [kind for kind in kinds if kind in _WORDS]

    def take(value: object, _: object) -> Any:
        if value is None and len(plain) < len(kinds):
            return None
        for kind in plain:
            if isinstance(value, bool) == (kind is bool) and isinstance(value, _TYPES[kind]):
                return kind(value)
        raise InputError(f"{value!r} is not {' or '.join(_WORDS[kind] for kind in plain)}")

    return take


def _tuple_of(converter: Converter, kind: object) -> Callable[[Any, Any], Any]:
    """Return a hook that turns a list into a tuple: each value by its own type, as many values as the type states."""
    items = get_args(kind)

    def take(value: object, _: object) -> Any:
        if not isinstance(value, list):
            raise InputError(f"{value!r} is not a list; write it in brackets")
        kinds = items[:1] * len(value) if items[-1] is Ellipsis else items
        if len(kinds) != len(value):
            raise InputError(f"{value!r} has {len(value)} values; allowed: {len(kinds)}")
        return tuple(converter.structure(part, item) for part, item in zip(value, kinds, strict=True))

    return take


def _first_fault(error: BaseValidationError, fix: str) -> str:
    fault = min(error.exceptions, key=lambda exception: not isinstance(exception, ForbiddenExtraKeysError))
    if isinstance(fault, ForbiddenExtraKeysError):
        return str(unknown("key", sorted(fault.extra_fields)[0], [field.name for field in fields(fault.cl)]))
    if isinstance(fault, KeyError):
        return f"{fault.args[0]} is missing; add it, or {fix}"
    if isinstance(fault, BaseValidationError):
        words = _first_fault(fault, fix)
    elif isinstance(fault, InputError):
        words = str(fault)
    else:
        words = f"the value is not a table; allowed: a table of keys; {fix}"
    kinds = AttributeValidationNote, IterableValidationNote
    where = [_place(note) for note in getattr(fault, "__notes__", []) if isinstance(note, kinds)]
    return f"{where[0]}{'' if words.startswith('key: ') else ':'} {words}" if where else words


def _place(note: AttributeValidationNote | IterableValidationNote) -> str:
    return note.name if isinstance(note, AttributeValidationNote) else str(note.index)
