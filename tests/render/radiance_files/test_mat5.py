"""MATLAB level 5 files against SciPy's writer and the format's own bytes; damaged and hostile ones."""

import struct
import tracemalloc
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.io
from hypothesis import given, settings
from hypothesis import strategies as st

from render.radiance_files.mat5 import read_variables
from rodcone.errors import InputError

CUBE = np.random.default_rng(5).random((3, 4, 2))
VARIABLES: dict[str, Any] = {
    "cube": CUBE,
    "single": CUBE.astype(np.float32),
    **{f"n{np.dtype(t).name}": np.array([[0, 1, np.iinfo(t).max]], t) for t in "bBhHiIqQ"},
    "text": "400 nm",
    "empty": np.empty((0, 0)),
    "scene": {"name": "a", "data": {"photons": CUBE, "none": []}, "spectrum": {"wave": np.arange(3.0)}},
}


def save(path: Path, variables: dict[str, Any], compressed: bool = True) -> Path:
    scipy.io.savemat(path, variables, do_compression=compressed)
    return path


@pytest.mark.parametrize("compressed", [False, True])
def test_numbers_text_and_structs_read_as_they_were_written(tmp_path: Path, compressed: bool) -> None:
    read: dict[str, Any] = read_variables(save(tmp_path / "a.mat", VARIABLES, compressed), VARIABLES)
    assert set(read) == set(VARIABLES)
    for name, value in VARIABLES.items():
        if isinstance(value, np.ndarray):
            assert read[name].dtype == value.dtype, name
            assert np.array_equal(read[name], value), name
    assert read["text"] == "400 nm"
    assert read["scene"]["name"] == "a"
    assert np.array_equal(read["scene"]["data"]["photons"], CUBE)
    assert read["scene"]["data"]["none"].size == 0
    assert read["scene"]["spectrum"]["wave"].ravel().tolist() == [0, 1, 2]


def test_fields_left_empty_are_read_as_empty(tmp_path: Path) -> None:
    """MATLAB writes ``[]`` in a struct as an element without content."""
    field = element(14, b"")
    read: Any = read_variables(file_of(tmp_path / "a.mat", structure(2, b"a\0b\0", field, field)), "x")["x"]
    assert {name: value.size for name, value in read.items()} == {"a": 0, "b": 0}


@pytest.mark.parametrize("compressed", [False, True])
def test_only_what_is_asked_for_is_read(tmp_path: Path, compressed: bool) -> None:
    path = save(tmp_path / "a.mat", VARIABLES, compressed)
    assert set(read_variables(path, ("text", "absent"))) == {"text"}


def test_cells_complex_numbers_and_struct_arrays_are_passed_over(tmp_path: Path) -> None:
    others = {
        "cell": np.array(["a", 1], dtype=object),
        "complex": np.array([1 + 2j]),
        "many": np.zeros(2, [("a", "O")]),
    }
    read = read_variables(save(tmp_path / "a.mat", {**others, "last": 3.0}), {*others, "last"})
    assert {name: read[name] for name in others} == dict.fromkeys(others)
    assert isinstance(read["last"], np.ndarray)
    assert read["last"].tolist() == [[3.0]]


def element(kind: int, content: bytes, order: str = "<") -> bytes:
    return struct.pack(f"{order}II", kind, len(content)) + content + bytes(-len(content) % 8)


def matrix(kind: int, dimensions: tuple[int, ...], stored: int, content: bytes, order: str = "<") -> bytes:
    """Variable x by the format's description: flags, dimensions, name, numbers."""
    parts = element(6, struct.pack(f"{order}II", kind, 0), order)
    parts += element(5, struct.pack(f"{order}{len(dimensions)}i", *dimensions), order)
    parts += element(1, b"x", order) + element(stored, content, order)
    return element(14, parts, order)


def structure(length: int, names: bytes, *fields: bytes) -> bytes:
    """Single struct x by the format's description: its head, field names of one length, fields."""
    head = element(6, struct.pack("<II", 2, 0)) + element(5, struct.pack("<2i", 1, 1)) + element(1, b"x")
    return element(14, head + element(5, struct.pack("<i", length)) + element(1, names) + b"".join(fields))


def file_of(path: Path, *elements: bytes, order: str = "<") -> Path:
    mark = b"IM" if order == "<" else b"MI"
    path.write_bytes(b"MATLAB 5.0 MAT-file".ljust(124) + struct.pack(f"{order}H", 0x0100) + mark + b"".join(elements))
    return path


def test_doubles_stored_as_bytes_and_big_endian_files_are_read(tmp_path: Path) -> None:
    """MATLAB stores whole doubles in the smallest type that holds them."""
    path = file_of(tmp_path / "a.mat", matrix(6, (2, 2), 2, bytes([1, 2, 3, 4])))
    assert np.array_equal(read_variables(path, "x")["x"], [[1.0, 3.0], [2.0, 4.0]])  # columns first
    big = matrix(6, (1, 2), 9, np.array([1.5, -2.0], ">f8").tobytes(), ">")
    read = read_variables(file_of(tmp_path / "b.mat", big, order=">"), "x")["x"]
    assert isinstance(read, np.ndarray)
    assert read.dtype == np.float64
    assert read.tolist() == [[1.5, -2.0]]


@pytest.mark.parametrize(
    ("content", "told"),
    [
        (matrix(6, (2, 3), 9, bytes(16)), "2 numbers for an array of"),
        (matrix(6, (1 << 30, 1 << 30, 1 << 30), 9, bytes(16)), "2 numbers for an array of"),
        (matrix(6, (-1, -2), 9, bytes(16)), "dimensions"),
        (matrix(6, (2,), 9, bytes(16)), "dimensions"),
        (matrix(6, (1, 2), 9, bytes(15)), "bytes of float64 numbers"),
        (matrix(6, (1, 2), 77, bytes(16)), "type 77"),
        (matrix(11, (1, 2), 9, struct.pack("<2d", 1.0, np.nan)), "fractions"),
        (struct.pack("<II", 14, 1 << 31) + bytes(64), "ends early"),
        (
            element(15, zlib.compress(struct.pack("<II", 14, 1 << 31) + matrix(6, (1, 1), 9, bytes(8))[8:])),
            "ends early",
        ),
        (element(15, b"nonsense"), "decompressing"),
        (element(14, element(6, bytes(8)) + struct.pack("<II", 5, 1 << 30)), "longer than its file"),
        (element(14, struct.pack("<HH", 6, 8) + bytes(8)), "small element"),
        (element(14, bytes(2)), "buffer"),
        (matrix(6, (1, 1), 9, bytes(8)) + bytes(3), "buffer"),
        (structure(0, b"abc"), "field names"),
        (structure(2, b"abc"), "field names"),
        (structure(4, b"a\0\0\0", element(9, bytes(8))), "type 9 where a field"),
    ],
    ids=range(17),
)
def test_sizes_that_contradict_each_other_are_refused(tmp_path: Path, content: bytes, told: str) -> None:
    path = file_of(tmp_path / "a.mat", content)
    with pytest.raises(InputError, match=told) as refused:
        read_variables(path, "x")
    assert str(refused.value).startswith(f"{path}: ")


def test_structs_deeper_than_any_scene_are_passed_over(tmp_path: Path) -> None:
    deep: Any = 1.0
    for _ in range(25):
        deep = {"d": deep}
    read: Any = read_variables(save(tmp_path / "a.mat", {"x": deep}), "x")["x"]
    for _ in range(16):
        read = read["d"]
    assert read is None


def test_other_forms_are_named_with_the_way_out(tmp_path: Path) -> None:
    path = tmp_path / "a.mat"
    path.write_bytes(
        b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\0\2IM" + bytes(384) + b"\x89HDF\r\n\x1a\n"
    )
    with pytest.raises(InputError, match=r"-v7\.3 \(HDF5\).*save -v7"):
        read_variables(path, "x")
    scipy.io.savemat(path, {"x": 1.0}, format="4")
    with pytest.raises(InputError, match="level 5"):
        read_variables(path, "x")
    for content in (b"", b"no"):
        path.write_bytes(content)
        with pytest.raises(InputError, match="level 5"):
            read_variables(path, "x")
    with pytest.raises(InputError, match="no such file"):
        read_variables(tmp_path / "missing.mat", "x")


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, bytes]:
    path = save(tmp_path_factory.mktemp("hostile") / "a.mat", VARIABLES, compressed=False)
    return path, path.read_bytes()


def compressed_again(content: bytes) -> bytes:
    """Wrap each variable as `save -v7` does, so that changed bytes lie under the checksum."""
    result, at = content[:128], 128
    while at + 8 <= len(content):
        size = 8 + struct.unpack_from("<I", content, at + 4)[0]
        result += element(15, zlib.compress(content[at : at + size]))
        at += size
    return result


@settings(max_examples=200, deadline=2000, derandomize=True)
@given(
    st.lists(st.tuples(st.integers(128, 1 << 16), st.integers(0, 255)), min_size=1, max_size=4),
    st.integers(0, 1 << 16),
    st.sampled_from(["changed", "compressed", "cut"]),
)
def test_changed_bytes_give_an_error_of_one_line_or_numbers(
    whole: tuple[Path, bytes], changes: list[tuple[int, int]], length: int, how: str
) -> None:
    path, content = whole
    changed = bytearray(content)
    for place, value in changes:
        changed[128 + place % (len(content) - 128)] = value
    result = compressed_again(bytes(changed)) if how == "compressed" else bytes(changed)
    path.write_bytes(content[: length % len(content)] if how == "cut" else result)
    told = ""
    try:
        read_variables(path, VARIABLES)
    except InputError as refused:
        told = str(refused)
    assert "\n" not in told


def packed(path: Path, content: bytes) -> Path:
    deflated = zlib.compress(content, 9)
    return file_of(path, struct.pack("<II", 15, len(deflated)) + deflated)  # alone among elements it isn't padded


def test_bytes_that_swell_to_more_than_their_file_may_hold_are_refused_before_they_do(tmp_path: Path) -> None:
    """20 kB hold 20 MB of zeros, each of them a double: 160 MB."""
    path = packed(tmp_path / "a.mat", matrix(6, (20_000_000, 1), 2, bytes(20_000_000)))
    tracemalloc.start()
    with pytest.raises(InputError, match="more than a file of its size may hold"):
        read_variables(path, "x")
    taken = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert 20_000_000 < taken < 70_000_000  # inflated, and while it was being inflated
    path = packed(path, matrix(6, (5_000_000, 1), 2, bytes(5_000_000)))  # 5 kB that stand for 40 MB do no harm
    assert np.array_equal(read_variables(path, "x")["x"], np.zeros((5_000_000, 1)))


def test_a_claim_of_gigabytes_is_inflated_no_further_than_allowed(tmp_path: Path) -> None:
    """100 kB may hold 200 MB; these hold 4 GiB by their own word, and 100 MB in truth."""
    path = packed(tmp_path / "a.mat", struct.pack("<II", 14, 0xFFFFFFF8) + matrix(6, (1, 1), 9, bytes(8))[8:])
    with pytest.raises(InputError, match="ends early"):
        read_variables(path, "x")
    path = packed(path, matrix(9, (80_000_000, 1), 2, bytes(80_000_000)))
    assert 2000 * path.stat().st_size > 80_000_000
    assert read_variables(path, "x")["x"].shape == (80_000_000, 1)  # type: ignore[union-attr]


@pytest.mark.parametrize(
    "letter", [struct.pack("<f", 1.5), struct.pack("<i", -1), struct.pack("<I", 0x110000)], ids="fiI"
)
def test_letters_that_are_none_are_refused(letter: bytes, tmp_path: Path, request: pytest.FixtureRequest) -> None:
    stored = {"f": 7, "i": 5, "I": 6}[request.node.callspec.id]
    with pytest.raises(InputError, match=r"the \.mat file is damaged"):
        read_variables(file_of(tmp_path / "a.mat", matrix(4, (1, 1), stored, letter)), "x")


def test_a_struct_of_far_too_many_fields_is_refused_at_once(tmp_path: Path) -> None:
    path = packed(tmp_path / "a.mat", structure(1, 100_000 * b"a", *(100_000 * [element(14, b"")])))
    with pytest.raises(InputError, match="more than a file of its size may hold"):
        read_variables(path, "x")
