"""Hashes that name what determines a result: plain data by its values, files by their content."""

import hashlib
import json
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any

import numpy as np

_LENGTH = 32  # hexadecimal digits, 128 bits: two of a million cells collide with a chance of 1e-27


def digest(value: Any) -> str:
    """Hash of plain data: numbers, texts, arrays, dataclasses, mappings and sequences of them."""
    return digest_bytes(json.dumps(value, sort_keys=True, default=_plain).encode())


def digest_bytes(*parts: bytes | memoryview) -> str:
    """Hash of bytes, one after the other."""
    made = hashlib.sha256()
    for part in parts:
        made.update(part)
    return made.hexdigest()[:_LENGTH]


def digest_file(path: str | Path) -> str:
    """Hash of a file's content."""
    with Path(path).open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()[:_LENGTH]


def _plain(value: Any) -> Any:
    """What JSON holds in place of a value that it doesn't know."""
    if is_dataclass(value):
        return {field.name: getattr(value, field.name) for field in fields(value)}
    if isinstance(value, Mapping):
        return dict(value)
    return np.asarray(value).tolist()  # arrays, NumPy's scalars and Dr.Jit's matrices
