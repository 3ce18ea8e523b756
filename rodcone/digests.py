"""Keys for the inputs of a result: hashes of plain data and of files, and, for caches in memory, bits of arrays."""

import hashlib
import json
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field, fields, is_dataclass
from pathlib import Path
from typing import Any, Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

T = TypeVar("T")
_BITS = 30  # bits of a float that are hashed; processors differ by a millionth of the last (single precision has 24)
_LENGTH = 32  # hexadecimal digits, 128 bits: two of a million cells collide with a chance of 1e-27


def digest(value: object) -> str:
    """Hash plain data: numbers, texts, arrays, dataclasses, mappings and sequences of them."""
    return digest_bytes(json.dumps(value, sort_keys=True, default=_plain).encode())


def digest_inputs(value: object) -> str:
    """Hash the inputs of a result as `digest` does, with floats rounded to 2^-30 of the largest in their array.

    NumPy and BLAS choose their loops by the processor, so the last bits of a resampled spectrum differ between
    processors. With rounding the same inputs have the same hash on all of them. Only a float that happens to lie on the
    edge between two roundings (one in a million of those that differ) causes a result to be computed again.
    """
    return digest(rounded(value))


def digest_bytes(*parts: bytes | memoryview) -> str:
    """Hash the parts' bytes, one after the other."""
    sha = hashlib.sha256()
    for part in parts:
        sha.update(part)
    return sha.hexdigest()[:_LENGTH]


def digest_file(path: str | Path) -> str:
    """Hash a file's content."""
    with Path(path).open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()[:_LENGTH]


def _plain(value: object) -> Any:
    """Return what JSON holds in place of a value that it doesn't know."""
    if is_dataclass(value):
        return {x.name: getattr(value, x.name) for x in fields(value)}
    if isinstance(value, Mapping):
        return dict(value)
    return np.asarray(value).tolist()  # arrays, NumPy's scalars and Dr.Jit's matrices


def rounded(value: object) -> Any:
    """Return plain data with its floats rounded as `digest_inputs` hashes them."""
    if isinstance(value, str) and "," in value:  # in a scene a spectrum is text: 0.25,0.5,...
        with suppress(ValueError):
            return rounded(np.array(value.split(","), dtype=np.float64))
    if value is None or isinstance(value, str | int):
        return value
    if is_dataclass(value) or isinstance(value, Mapping):
        return {name: rounded(part) for name, part in _plain(value).items()}
    if isinstance(value, list | tuple):
        return [rounded(part) for part in value]
    array = np.asarray(value)
    if array.dtype.kind != "f":
        return array.tolist()
    _, exponent = np.frexp(np.abs(array[np.isfinite(array)]).max(initial=0.0))
    return (np.ldexp(np.rint(np.ldexp(array, _BITS - exponent)), exponent - _BITS) + 0.0).tolist()  # + 0.0: no -0.0


@dataclass(frozen=True)
class ByBits(Generic[T]):
    """A value that equals another one if the arrays of which both are made have the same types and bits.

    Attributes
    ----------
    value : object
    bits : tuple of (str, bytes)
        Type and memory of each array.
    """

    value: T = field(compare=False)
    bits: tuple[tuple[str, bytes], ...]


def by_bits(value: T, *arrays: NDArray[Any]) -> ByBits[T]:
    """Wrap a value as the key of a cache, which compares it by the bits of these arrays."""
    return ByBits(value, tuple((array.dtype.str, array.tobytes()) for array in arrays))
