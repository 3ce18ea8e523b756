"""JSON Schema of files that are read into dataclasses, so that editors complete keys and mark what isn't allowed."""

import re
from collections.abc import Mapping
from dataclasses import MISSING, fields, is_dataclass
from inspect import cleandoc
from types import UnionType
from typing import Annotated, Any, get_args, get_origin, get_type_hints

DIALECT = "https://json-schema.org/draft/2020-12/schema"
_PLAIN = {str: "string", bool: "boolean", int: "integer", float: "number"}
_ITEM = re.compile(r"^(\w[\w, ]*?) : [^\n]+\n((?:    [^\n]*\n?|\n)*)", re.MULTILINE)


def schema_of(kind: type, known: Mapping[Any, Mapping[str, Any]], *, single: bool = False) -> dict[str, Any]:
    """Return the schema of a table with the fields of a dataclass; other keys are refused.

    Parameters
    ----------
    kind : dataclass
        Its annotations give the types and ranges of values, its docstring's ``Attributes`` their descriptions.
    known : mapping
        Schemas for types that a file writes in another form than the dataclass holds. A key is such a type, or
        ``(dataclass, field)`` for a single field; an empty schema leaves the field out.
    single : bool
        Whether a file may write a single value in place of a list with one value.
    """
    texts = _descriptions(kind)
    properties = {}
    required = []
    hints = get_type_hints(kind, include_extras=True)
    for each in fields(kind):
        own = known.get((kind, each.name), _of(hints[each.name], known, single))
        if (kind, each.name) in known and not own:
            continue
        text = {"description": texts[each.name]} if each.name in texts else {}
        properties[each.name] = {**own, **text}
        if each.default is MISSING and each.default_factory is MISSING:
            required.append(each.name)
    table: dict[str, Any] = {"type": "object", "additionalProperties": False, "properties": properties}
    return table | ({"required": required} if required else {})


def _of(kind: object, known: Mapping[Any, Mapping[str, Any]], single: bool) -> dict[str, Any]:
    """Return the schema of a value of a type."""
    if kind in known:
        return dict(known[kind])
    parts = get_args(kind)
    if get_origin(kind) is Annotated:
        low, high, *_ = parts[1]
        return _of(parts[0], known, single) | {"minimum": low, "maximum": high}
    if isinstance(kind, UnionType):
        choices = [_of(part, known, single) for part in parts if part is not type(None)]
        return choices[0] if len(choices) == 1 else {"anyOf": choices}
    if get_origin(kind) is tuple:
        return _list_of(parts, known, single)
    if is_dataclass(kind) and isinstance(kind, type):
        return schema_of(kind, known, single=single)
    return {"type": _PLAIN[kind]} if kind in _PLAIN else {}


def _list_of(parts: tuple[Any, ...], known: Mapping[Any, Mapping[str, Any]], single: bool) -> dict[str, Any]:
    """Return the schema of a list that is read into a tuple with the types `parts`; an Ellipsis allows any length."""
    items = [_of(part, known, single) for part in parts if part is not Ellipsis]
    if parts[-1] is not Ellipsis:
        return {"type": "array", "prefixItems": items, "minItems": len(items), "maxItems": len(items)}
    several = {"type": "array", "items": items[0]}
    return {"anyOf": [items[0], several]} if single else several


def _descriptions(kind: type) -> dict[str, str]:
    """Return what a dataclass's docstring says of each field, in one line."""
    _, _, section = cleandoc(kind.__doc__ or "").partition("Attributes\n----------\n")
    said = {}
    for names, text in _ITEM.findall(section.partition("\n\n")[0] + "\n"):
        for name in names.split(", "):
            said[name] = " ".join(text.split())
    return {name: text for name, text in said.items() if text}
