"""MATLAB level 5 files against SciPy's writer and the format's own bytes; damaged ones end a child alone."""

import resource
import struct
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.io
from loop import loop
from refusal import refusal

from render.radiance_files import mat_file, mat_reader
from render.radiance_files.mat_file import read_numbers

CUBE = np.random.default_rng(5).random((3, 4, 2))
VARIABLES: dict[str, Any] = {
    "cube": CUBE,
    "single": CUBE.astype(np.float32),
    **{f"n{np.dtype(t).name}": np.array([[0, 1, np.iinfo(t).max]], t) for t in "bBhHiIqQ"},
    "scene": {"name": "a", "data": {"photons": CUBE}, "spectrum": {"wave": np.arange(3.0)}},
    "text": "400 nm",
    "cell": np.array(["a", 1], dtype=object),
    "many": np.zeros(2, [("a", "O")]),
}
NUMBERS = [name for name, value in VARIABLES.items() if isinstance(value, np.ndarray) and value.dtype.kind in "iuf"]


def element(kind: int, content: bytes, order: str = "<") -> bytes:
    return struct.pack(f"{order}II", kind, len(content)) + content + bytes(-len(content) % 8)


def matrix(kind: int, dimensions: tuple[int, ...], stored: int, content: bytes, order: str = "<") -> bytes:
    """Variable x by the format's description: flags, dimensions, name, numbers."""
    parts = element(6, struct.pack(f"{order}II", kind, 0), order)
    parts += element(5, struct.pack(f"{order}{len(dimensions)}i", *dimensions), order)
    parts += element(1, b"x", order) + element(stored, content, order)
    return element(14, parts, order)


def file_of(path: Path, *elements: bytes, order: str = "<") -> Path:
    mark = b"IM" if order == "<" else b"MI"
    path.write_bytes(b"MATLAB 5.0 MAT-file".ljust(124) + struct.pack(f"{order}H", 0x0100) + mark + b"".join(elements))
    return path


@loop("compressed", [False, True])
def test_numbers_are_read_as_they_were_written_and_nothing_else(tmp_path: Path, compressed: bool) -> None:
    path = tmp_path / "a.mat"
    scipy.io.savemat(path, VARIABLES, do_compression=compressed)
    inner = ["scene/data/photons", "scene/spectrum/wave", "scene/name", "scene/data/none", "cube/data"]
    read = read_numbers(path, [*VARIABLES, *inner, "absent"])
    assert set(read) == {*NUMBERS, "scene/data/photons", "scene/spectrum/wave"}
    for name in NUMBERS:
        assert read[name].dtype == VARIABLES[name].dtype, name
        assert np.array_equal(read[name], VARIABLES[name]), name
    assert np.array_equal(read["scene/data/photons"], CUBE)
    assert read["scene/spectrum/wave"].ravel().tolist() == [0, 1, 2]


@pytest.mark.sample(1)
@pytest.mark.parametrize(
    "content",
    [
        matrix(6, (2, 3), 9, bytes(16)),
        matrix(6, (1 << 30, 1 << 30, 1 << 30), 9, bytes(16)),
        element(15, b"nonsense"),
        struct.pack("<II", 14, 1 << 31) + bytes(64),
    ],
    ids=["too few numbers", "far too few", "no deflated bytes", "cut"],
)
def test_damaged_files_are_refused_in_one_line(tmp_path: Path, content: bytes) -> None:
    path = file_of(tmp_path / "a.mat", content)
    assert refusal(read_numbers, path, ["x"], match=r"SciPy can\'t read the \.mat file: \w").startswith(f"{path}: ")


@loop(
    ("end", "told"),
    [
        ("import os, signal; os.kill(os.getpid(), signal.SIGSEGV)", "it ended the reader by signal 11"),
        ("import time; time.sleep(60)", "took over 1 s to read"),
    ],
)
def test_a_reader_that_ends_or_hangs_is_an_error_here(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, end: str, told: str
) -> None:
    script = tmp_path / "reader.py"
    script.write_text(end)
    monkeypatch.setattr(mat_reader, "__file__", str(script))
    monkeypatch.setattr(mat_file, "_SECONDS", 0.6 if "sleep" in end else 60)
    path = tmp_path / "a.mat"
    scipy.io.savemat(path, {"x": 1.0})
    refusal(read_numbers, path, ["x"], match=told)


@pytest.mark.thorough
def test_bytes_that_swell_to_more_than_their_file_may_hold_are_refused(tmp_path: Path) -> None:
    """10 kB hold 10 MB of zeros, each of them a double: 80 MB, where 64 MiB are allowed; 40 MB do no harm."""
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    for count, fits in ((10_000_000, False), (5_000_000, True)):
        deflated = zlib.compress(matrix(6, (count, 1), 2, bytes(count)), 9)
        path = file_of(tmp_path / "a.mat", struct.pack("<II", 15, len(deflated)) + deflated)
        if fits:
            assert np.array_equal(read_numbers(path, ["x"])["x"], np.zeros((count, 1)))
        else:
            refusal(read_numbers, path, ["x"], match="SciPy can't read")
            grown = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before  # kilobytes on Linux
            assert grown < 60_000


def test_complex_numbers_are_refused_and_not_cut(tmp_path: Path) -> None:
    path = tmp_path / "a.mat"
    scipy.io.savemat(path, {"x": np.array([1 + 2j])})
    refusal(read_numbers, path, ["x"], match="complex")


def test_other_forms_are_named_with_the_way_out(tmp_path: Path) -> None:
    path = tmp_path / "a.mat"
    path.write_bytes(
        b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\0\2IM" + bytes(384) + b"\x89HDF\r\n\x1a\n"
    )
    refusal(read_numbers, path, ["x"], match=r"-v7\.3 \(HDF5\).*save -v7")
    scipy.io.savemat(path, {"x": 1.0}, format="4")
    refusal(read_numbers, path, ["x"], match="level 5")
    for content in (b"", b"no"):
        path.write_bytes(content)
        refusal(read_numbers, path, ["x"], match="level 5")
    refusal(read_numbers, tmp_path / "missing.mat", ["x"], match="no such file")
