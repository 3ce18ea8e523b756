"""Meshes whose faces name vertices that aren't there are refused; Mitsuba would end the process."""

import struct
import zlib
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
from loop import loop
from refusal import refusal

from render.user_scene.mesh_files import check_mesh_file
from render.user_scene.scene_file import load_scene_file
from rodcone.errors import InputError

CORNERS = np.array([[0, 0, 9], [1, 0, 9], [0, 1, 9]], "<f4")
SCENE = """<scene version="3.0.0"><sensor type="perspective"/><emitter type="constant"/>
<shape type="{}"><string name="filename" value="{}"/></shape></scene>"""


def ply(folder: Path, layout: str, *faces: tuple[int, ...]) -> Path:
    order = ">" if "big" in layout else "<"
    head = f"ply\nformat {layout} 1.0\ncomment by hand\nelement vertex 3\nproperty float x\nproperty float y\n"
    head += f"property float z\nelement face {len(faces)}\nproperty list uchar int vertex_indices\nend_header\n"
    if layout == "ascii":
        rows = [*(" ".join(map(str, corner)) for corner in CORNERS.tolist())]
        rows += [" ".join(map(str, (len(face), *face))) for face in faces]
        body = "\n".join(rows).encode() + b"\n"
    else:
        packed = (struct.pack(f"{order}B{len(face)}i", len(face), *face) for face in faces)
        body = CORNERS.astype(f"{order}f4").tobytes() + b"".join(packed)
    path = folder / "mesh.ply"
    path.write_bytes(head.encode() + body)
    return path


def serialized(folder: Path, version: int, *faces: tuple[int, ...], flags: int = 0x1000) -> Path:
    """Mitsuba's binary format: version 3 without names and with places of four bytes, 4 with both."""
    corners = CORNERS.astype("<f8" if flags & 0x2000 else "<f4")
    normals = corners if flags & 1 else corners[:0]
    name = b"mesh\0" if version == 4 else b""
    mesh = struct.pack("<I", flags) + name + struct.pack("<QQ", 3, len(faces))
    mesh += corners.tobytes() + normals.tobytes() + np.array(faces, "<u4").tobytes()
    path = folder / "mesh.serialized"
    place = struct.pack("<Q" if version == 4 else "<I", 0)
    path.write_bytes(struct.pack("<HH", 0x041C, version) + zlib.compress(mesh) + place + struct.pack("<I", 1))
    return path


@loop("layout", ["ascii", "binary_little_endian", "binary_big_endian"])
def test_a_ply_face_names_vertices_that_are_there(layout: str, tmp_path: Path) -> None:
    check_mesh_file("ply", ply(tmp_path, layout, (0, 1, 2), (2, 1, 0)))
    for index in (3, 99_999_999, -5):
        with pytest.raises(InputError, match=rf"mesh.ply: face 1 names vertex {index}; allowed: 0 to 2"):
            check_mesh_file("ply", ply(tmp_path, layout, (0, 1, 2), (0, index, 1)))
    refusal(check_mesh_file, "ply", ply(tmp_path, layout, (0, 1, 2, 0)), match="no triangle")


@loop(("version", "flags"), [(4, 0x1000), (4, 0x2001), (3, 0x1000)])
def test_a_serialized_face_names_vertices_that_are_there(version: int, flags: int, tmp_path: Path) -> None:
    check_mesh_file("serialized", serialized(tmp_path, version, (0, 1, 2), flags=flags))
    with pytest.raises(InputError, match="face 1 names vertex 3; allowed: 0 to 2"):
        check_mesh_file("serialized", serialized(tmp_path, version, (0, 1, 2), (0, 1, 3), flags=flags))


@loop("kind", ["ply", "serialized"])
def test_a_file_cut_anywhere_is_refused_or_passes(kind: str, tmp_path: Path) -> None:
    path = ply(tmp_path, "ascii", (0, 1, 2)) if kind == "ply" else serialized(tmp_path, 4, (0, 1, 2))
    content = path.read_bytes()
    for length in range(len(content)):
        path.write_bytes(content[:length])
        with suppress(InputError):
            check_mesh_file(kind, path)


def test_a_scene_that_names_such_a_mesh_is_refused_and_a_right_one_loads(tmp_path: Path) -> None:
    scene = tmp_path / "scene.xml"
    scene.write_text(SCENE.format("ply", ply(tmp_path, "ascii", (0, 1, 99_999_999)).name))
    refusal(load_scene_file, scene, match="names vertex 99999999")
    ply(tmp_path, "ascii", (0, 1, 2))
    assert load_scene_file(scene).scene.groups
