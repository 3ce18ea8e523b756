"""Numbers, text and structs from MATLAB level 5 files (``save -v6`` and ``-v7``), every size checked before it is used.

SciPy's reader is not used, since a few changed bytes make it read outside its memory (version 1.17 ends the process
within some thousand random changes), and a scene may come from anywhere. The format: MathWorks, "MAT-File Format",
chapter "Level 5 MAT-File Format". Cells, objects and sparse arrays are passed over.
"""

import struct
import zlib
from collections.abc import Collection, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO, TypeAlias

import numpy as np
from numpy.typing import NDArray

from render.radiance_files.file_checks import MOST_BYTES, MOST_EXPANSION, SMALL_BYTES, require_file
from rodcone.errors import InputError

Value: TypeAlias = "NDArray[Any] | dict[str, Value] | str | None"

_HEADER_BYTES = 128
_MATRIX, _COMPRESSED = 14, 15
_STORED = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8"}
_STORED |= {16: "u1", 17: "u2"}  # UTF-8 and UTF-16
_NUMERIC = {6: "f8", 7: "f4", 8: "i1", 9: "u1", 10: "i2", 11: "u2", 12: "i4", 13: "u4", 14: "i8", 15: "u8"}
_LAST_FLOATING = 7
_STRUCT, _TEXT = 2, 4
_COMPLEX = 0x0800
_PEEK_BYTES = 512  # holds a variable's flags, dimensions and name
_MOST_DEPTH = 16  # of structs in structs
_FIELD_BYTES = 1 << 14  # that a field counts as, for the time that it takes: 4096 of them in a small file
_TEXT_BYTES = 64  # that a character takes on its way


class _DamagedError(ValueError):
    """What stands in the file contradicts itself."""


@dataclass
class _Memory:
    """What the file's values may take in all, and have taken."""

    most: int
    taken: int = 0

    def take(self, count: int) -> None:
        self.taken += count
        if self.taken > self.most:
            raise _DamagedError(f"its values claim over {self.most} bytes, more than a file of its size may hold")


def read_variables(path: Path, names: Collection[str]) -> dict[str, Value]:
    """Named variables of a file: arrays as (row, column, ...), structs as dicts, text as str.

    Parameters
    ----------
    path : Path
    names : collection of str
        What to read; the rest is passed over. What isn't there is missing from the result, and what is neither
        numbers, text nor a single struct is None.

    Raises
    ------
    InputError
        Where there is no file, none of level 5 (MATLAB's ``-v7.3`` and ``-v4`` are named), it is damaged, or what is
        wanted takes over 8 GiB, or over 64 MiB and 2000 times the file.
    """
    memory = _Memory(min(MOST_BYTES, max(SMALL_BYTES, MOST_EXPANSION * require_file(path))))
    with path.open("rb") as file:
        order = _byte_order(path, file.read(_HEADER_BYTES))
        try:
            wanted = _variables(file, order, names, memory)
            return {name: _value(content, order, memory) for name, content in wanted}
        except (ValueError, TypeError, OverflowError, zlib.error, struct.error) as error:  # such as chr of a fraction
            raise InputError(f"{path}: the .mat file is damaged: {error}; save it again") from error


def _byte_order(path: Path, header: bytes) -> str:
    """Little or big endian, as `struct` writes it."""
    if header.startswith((b"MATLAB 7.3", b"\x89HDF")):
        raise InputError(f"{path}: it is a -v7.3 (HDF5) file; allowed: level 5; in MATLAB save it with save -v7")
    order = {b"IM": "<", b"MI": ">"}.get(header[126:128])
    if order is None:
        raise InputError(f"{path}: it is no level 5 .mat file; allowed: MATLAB's -v6 or -v7; save it with save -v7")
    return order


def _variables(file: BinaryIO, order: str, names: Collection[str], memory: _Memory) -> Iterator[tuple[str, memoryview]]:
    """Name and content of each wanted variable."""
    while tag := file.read(8):
        kind, size = struct.unpack(f"{order}II", tag)
        body = file.read(min(size, MOST_BYTES))
        if len(body) < size:
            raise _DamagedError("it ends early")
        if kind == _COMPRESSED:
            if _name(memoryview(_inflated(body, _PEEK_BYTES))[8:], order) not in names:
                continue
            kind, size = struct.unpack(f"{order}II", _inflated(body, 8))
            body = _inflated(body, 8 + min(size, memory.most + 1))[8:]
            memory.take(len(body))
            if len(body) < size:
                raise _DamagedError("a variable ends early")
        if kind == _MATRIX and (name := _name(memoryview(body)[:_PEEK_BYTES], order)) in names:
            yield name, memoryview(body)


def _inflated(body: bytes, most: int) -> bytes:
    """At most that many bytes from a compressed variable."""
    return zlib.decompressobj().decompress(body, most)


def _element(view: memoryview, at: int, order: str) -> tuple[int, memoryview, int]:
    """Type and content of the element that begins at `at`, and where the next begins."""
    (first,) = struct.unpack_from(f"{order}I", view, at)
    if first >> 16:  # small form: size and type in one word, content in the next
        kind, size, start, after = first & 0xFFFF, first >> 16, at + 4, at + 8
        if size > 4:
            raise _DamagedError(f"a small element of {size} bytes")
    else:
        (size,) = struct.unpack_from(f"{order}I", view, at + 4)
        kind, start = first, at + 8
        after = start + size + (-size % 8)
    if start + size > len(view):
        raise _DamagedError("an element is longer than its file")
    return kind, view[start : start + size], after


def _numbers(view: memoryview, at: int, order: str) -> tuple[NDArray[Any], int]:
    """Numbers of a plain element, and where the next begins."""
    kind, content, after = _element(view, at, order)
    if kind not in _STORED:
        raise _DamagedError(f"type {kind} where numbers belong")
    dtype = np.dtype(order + _STORED[kind])
    if len(content) % dtype.itemsize:
        raise _DamagedError(f"{len(content)} bytes of {dtype} numbers")
    return np.frombuffer(content, dtype), after


def _head(view: memoryview, order: str) -> tuple[int, tuple[int, ...], str, int]:
    """Flags with the class in the low byte, dimensions, name, and where the content begins."""
    flags, at = _numbers(view, 0, order)
    dimensions, at = _numbers(view, at, order)
    name, at = _numbers(view, at, order)
    if flags.size != 2 or not 2 <= dimensions.size <= 32 or np.any(dimensions < 0):
        raise _DamagedError(f"an array of dimensions {dimensions[:8].tolist()}")
    return int(flags[0]), tuple(dimensions.tolist()), name.tobytes().decode("latin-1"), at


def _name(view: memoryview, order: str) -> str:
    return _head(view, order)[2]


def _value(view: memoryview, order: str, memory: _Memory, depth: int = 0) -> Value:
    """Content of a matrix element."""
    if not len(view):
        return np.empty((0, 0))
    flags, dimensions, _, at = _head(view, order)
    kind = flags & 0xFF
    if kind == _STRUCT and dimensions == (1, 1) and depth < _MOST_DEPTH:
        return _fields(view, at, order, memory, depth)
    if kind == _TEXT:
        letters, _ = _numbers(view, at, order)
        memory.take(_TEXT_BYTES * letters.size)
        return "".join(map(chr, letters.tolist()))
    if kind not in _NUMERIC or flags & _COMPLEX:
        return None
    numbers, _ = _numbers(view, at, order)
    if numbers.size != _product(dimensions):
        raise _DamagedError(f"{numbers.size} numbers for an array of {dimensions}")
    if numbers.dtype.kind == "f" and kind > _LAST_FLOATING:
        raise _DamagedError("fractions in an array of whole numbers")
    wanted = np.dtype(_NUMERIC[kind])
    if wanted != numbers.dtype:
        memory.take(numbers.size * wanted.itemsize)
    with np.errstate(all="ignore"):  # a double that single doesn't hold becomes infinite, as in MATLAB
        return numbers.reshape(dimensions, order="F").astype(wanted, copy=False)


def _product(dimensions: tuple[int, ...]) -> int:
    result = 1
    for n in dimensions:
        result *= n
    return result


def _fields(view: memoryview, at: int, order: str, memory: _Memory, depth: int) -> dict[str, Value]:
    """Fields of a single struct."""
    lengths, at = _numbers(view, at, order)
    names, at = _numbers(view, at, order)
    if lengths.size != 1 or lengths[0] < 1 or names.size % int(lengths[0]):
        raise _DamagedError("field names of uneven length")
    text, length = names.tobytes(), int(lengths[0])
    fields: dict[str, Value] = {}
    for start in range(0, len(text), length):
        memory.take(_FIELD_BYTES)
        kind, content, at = _element(view, at, order)
        if kind != _MATRIX:
            raise _DamagedError(f"type {kind} where a field belongs")
        fields[text[start : start + length].split(b"\0")[0].decode("latin-1")] = _value(
            content, order, memory, depth + 1
        )
    return fields
