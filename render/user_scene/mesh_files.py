"""Checks of mesh files before Mitsuba reads them, because a face with a missing vertex crashes Mitsuba's process.

Mitsuba itself checks the rest, such as truncated files and faces that are no triangles.
"""

import re
import struct
import zlib
from pathlib import Path

import numpy as np

from rodcone.errors import InputError, read_errors

# Scalar types of PLY, after Greg Turk, "The PLY polygon file format" (1994), and their later names.
_PLY_TYPES = {
    **dict.fromkeys(("char", "int8"), "i1"),
    **dict.fromkeys(("uchar", "uint8"), "u1"),
    **dict.fromkeys(("short", "int16"), "i2"),
    **dict.fromkeys(("ushort", "uint16"), "u2"),
    **dict.fromkeys(("int", "int32"), "i4"),
    **dict.fromkeys(("uint", "uint32"), "u4"),
    **dict.fromkeys(("float", "float32"), "f4"),
    **dict.fromkeys(("double", "float64"), "f8"),
}
_BYTE_ORDER = {"binary_little_endian": "<", "binary_big_endian": ">"}
# Optional sections of Mitsuba's serialized meshes: bit in the flags, and numbers per vertex. Positions always exist.
_SERIALIZED_SECTIONS = ((0x1, 3), (0x2, 2), (0x8, 3))
_SERIALIZED_DOUBLE = 0x2000
_MOST_BYTES = 4 << 30  # largest size of an unpacked mesh


def check_mesh_file(kind: str, path: Path) -> None:
    """Raise `InputError` for a face with a vertex that its mesh doesn't have.

    Parameters
    ----------
    kind : str
        Plug-in that reads the file; only files of ``ply`` and ``serialized`` are checked.
    path : Path
    """
    damage = (ValueError, KeyError, struct.error, zlib.error)
    with read_errors(f"{path}: it can't be read as a {kind} mesh", "export the mesh anew", damage):
        if kind == "ply":
            _check_ply(path)
        elif kind == "serialized":
            _check_serialized(path)


def _check_indices(path: Path, indices: np.ndarray, vertices: int) -> None:
    outside = np.flatnonzero((indices < 0) | (indices >= vertices))
    if outside.size:
        index = int(indices.flat[outside[0]])
        raise InputError(
            f"{path}: face {outside[0] // 3} names vertex {index}; allowed: 0 to {vertices - 1}; export the mesh anew"
        )


def _check_ply(path: Path) -> None:
    content = path.read_bytes()
    header = re.match(rb"ply\r?\n(.*?)end_header\r?\n", content[: 1 << 16], re.DOTALL)
    if header is None:
        raise ValueError("its header has no end")
    lines = [line.split() for line in header[1].decode("latin-1").splitlines()]
    layout = next(words[1] for words in lines if words[:1] == ["format"])
    counts: dict[str, int] = {}
    fields: dict[str, list[tuple[str, str]]] = {}
    for words in lines:
        if words[:1] == ["element"]:
            element, counts[words[1]], fields[words[1]] = words[1], int(words[2]), []
        elif words[:2] == ["property", "list"]:  # a triangle's vertices: a count of 3, then three indices
            fields[element] += [(f"{words[4]} count", _PLY_TYPES[words[2]])]
            fields[element] += [(words[4], f"3{_PLY_TYPES[words[3]]}")]
        elif words[:1] == ["property"]:
            fields[element] += [(words[2], _PLY_TYPES[words[1]])]
    place = header.end()
    tokens = content[header.end() :].split() if layout == "ascii" else []
    for element, count in counts.items():
        if layout == "ascii":
            width = sum(3 if kind[0] == "3" else 1 for _, kind in fields[element])
            table = np.array(tokens[place - header.end() : place - header.end() + count * width]).reshape(count, width)
            starts = np.cumsum([0, *(3 if kind[0] == "3" else 1 for _, kind in fields[element])])
            columns = {
                name: table[:, i:j] for (name, _), i, j in zip(fields[element], starts, starts[1:], strict=False)
            }
            place += count * width
        else:
            order = _BYTE_ORDER[layout]
            record = np.dtype([(name, re.sub(r"(?=[iuf])", order, kind, count=1)) for name, kind in fields[element]])
            records = np.frombuffer(content, record, count, place)
            columns = {name: records[name] for name in records.dtype.names or ()}
            place += count * record.itemsize
        if element == "face":
            name = next(name for name, kind in fields["face"] if kind[0] == "3")
            if (columns[f"{name} count"].astype(np.int64) != 3).any():
                raise InputError(f"{path}: a face is no triangle; allowed: triangles; export the mesh triangulated")
            _check_indices(path, columns[name].astype(np.int64), counts["vertex"])


def _check_serialized(path: Path) -> None:
    content = path.read_bytes()
    (meshes,) = struct.unpack_from("<I", content, len(content) - 4)
    wide = struct.unpack_from("<HH", content)[1] > 3  # from version 4 on, positions have 8 bytes and meshes have names
    place_bytes = 8 if wide else 4
    directory = len(content) - 4 - place_bytes * meshes
    for mesh in range(meshes):
        (place,) = struct.unpack_from("<Q" if wide else "<I", content, directory + place_bytes * mesh)
        stream = zlib.decompressobj()
        head = stream.decompress(content[place + 4 :], 1 << 16)
        (flags,) = struct.unpack_from("<I", head)
        start = head.index(b"\0", 4) + 1 if wide else 4
        vertices, faces = struct.unpack_from("<QQ", head, start)
        scalar_bytes = 8 if flags & _SERIALIZED_DOUBLE else 4
        numbers = 3 + sum(count for bit, count in _SERIALIZED_SECTIONS if flags & bit)
        first = start + 16 + vertices * numbers * scalar_bytes
        if first + 12 * faces > _MOST_BYTES:
            raise InputError(f"{path}: a mesh of {faces} faces; allowed: {_MOST_BYTES >> 30} GiB; split it")
        whole = head + stream.decompress(stream.unconsumed_tail, max(1, first + 12 * faces - len(head)))
        _check_indices(path, np.frombuffer(whole, "<u4", 3 * faces, first).astype(np.int64), vertices)
