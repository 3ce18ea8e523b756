"""The choice of the LLVM library, judged by file name, and that Dr.Jit compiles with it."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from rodcone import jit

ABORTING = ("libLLVM-14.so.1", "libLLVM-15.so", "libLLVM-15.so.1", "libLLVM-16.so.1", "libLLVM.so.16.0")


def fake_library(folder: Path, name: str) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / name
    path.touch()
    return path


def in_new_python(code: str, **variables: str) -> str:
    """What `code` prints in a Python of its own, where no Dr.Jit is loaded yet."""
    kept = {name: value for name, value in os.environ.items() if name != "DRJIT_LIBLLVM_PATH"}
    done = subprocess.run(
        [sys.executable, "-c", code], env=kept | variables, capture_output=True, text=True, timeout=60, check=False
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.strip()


@pytest.mark.parametrize(
    ("name", "version"),
    [
        ("libLLVM-14.so.1", 14),
        ("libLLVM-14.0.6.so.1", None),  # Debian's real file: no number that is the major version alone
        ("libLLVM-15.so", 15),
        ("libLLVM-17.so", 17),
        ("libLLVM-17.so.1", 17),
        ("libLLVM.so.18.1", 18),
        ("libLLVM.so.23.1", 23),
        ("libLLVM.so.23", 23),
        ("libLLVM.so", None),
        ("libLLVM-C.so", None),
        ("libLLVM-C.so.23", None),
        ("libLLVM-17.so.old", None),
        ("libLTO.so.17", None),
        ("mylibLLVM-17.so", None),
    ],
)
def test_version_is_told_by_the_file_name(name: str, version: int | None) -> None:
    assert jit.llvm_version(Path("/anywhere") / name) == version


@pytest.mark.parametrize("name", ABORTING)
def test_a_system_library_that_aborts_is_never_chosen(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    old = fake_library(tmp_path, name)
    monkeypatch.setattr(jit, "_SYSTEM_DIRECTORIES", (str(tmp_path),))
    chosen = jit._system_library()
    assert chosen != old
    assert chosen is None or (jit.llvm_version(chosen) or 0) >= 17  # the machine may have one of its own


def test_the_newest_system_library_is_chosen(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in (*ABORTING, "libLLVM-17.so.1", "libLLVM-C.so", "libLLVM.so"):
        fake_library(tmp_path / "a", name)
    newest = fake_library(tmp_path / "b", "libLLVM.so.1000.1")  # above any that the machine may have
    fake_library(tmp_path / "b", "libLLVM.so.999.1")  # the greater as text, not as a number
    (tmp_path / "b" / "libLLVM-2000.so").symlink_to(tmp_path / "gone.so")
    folders = (str(tmp_path / "a"), str(tmp_path / "b"), str(tmp_path / "absent"))
    monkeypatch.setattr(jit, "_SYSTEM_DIRECTORIES", folders)
    assert jit._system_library() == newest


def test_the_users_value_comes_first_then_the_wheel_then_the_system(monkeypatch: pytest.MonkeyPatch) -> None:
    own, wheel, system = Path("/own/libLLVM-16.so"), Path("/wheel/libLLVM.so.23.1"), Path("/system/libLLVM-17.so")
    monkeypatch.setattr(jit, "_wheel_library", lambda: wheel)
    monkeypatch.setattr(jit, "_system_library", lambda: system)
    monkeypatch.setenv("DRJIT_LIBLLVM_PATH", str(own))
    assert jit.find_llvm() == own
    monkeypatch.setenv("DRJIT_LIBLLVM_PATH", "")
    assert jit.find_llvm() == wheel, "an empty variable is no choice"
    monkeypatch.delenv("DRJIT_LIBLLVM_PATH")
    assert jit.find_llvm() == wheel
    monkeypatch.setattr(jit, "_wheel_library", lambda: None)
    assert jit.find_llvm() == system
    monkeypatch.setattr(jit, "_system_library", lambda: None)
    assert jit.find_llvm() is None


def test_an_absent_wheel_is_no_error(monkeypatch: pytest.MonkeyPatch) -> None:
    def absent(name: str) -> None:
        raise jit.metadata.PackageNotFoundError(name)

    monkeypatch.setattr(jit.metadata, "files", absent)
    assert jit._wheel_library() is None


def test_the_wheels_library_is_a_file_of_an_accepted_version() -> None:
    library = jit._wheel_library()
    if library is None:
        pytest.skip("karellen-llvm-core is not installed here (its wheels are for Linux x86-64)")
    assert library.is_file()
    assert (jit.llvm_version(library) or 0) >= jit.OLDEST_LLVM


def test_a_new_python_keeps_the_users_value_and_goes_without_llvm_where_it_is_wrong(tmp_path: Path) -> None:
    own = str(tmp_path / "libLLVM-99.so")
    code = "import os; from rodcone import jit; print(os.environ['DRJIT_LIBLLVM_PATH'], jit.LIBLLVM, jit.backend())"
    variable, library, backend = in_new_python(code, DRJIT_LIBLLVM_PATH=own).split()
    assert (variable, library) == (own, own)
    assert backend != "llvm"


def test_a_new_python_compiles_a_kernel_with_the_library_found() -> None:
    if jit.backend() != "llvm":
        pytest.skip(f"Dr.Jit's backend here is {jit.backend()}")
    code = (
        "import os, rodcone.jit as jit; import drjit\n"
        "x = jit.arrays().Float([1.0, 2.0, 5.0])\n"
        "print(drjit.sum(drjit.maximum(x, 3.0))[0], jit.backend(), os.environ['DRJIT_LIBLLVM_PATH'])"
    )
    total, backend, library = in_new_python(code).split()
    assert (float(total), backend) == (11.0, "llvm")  # `maximum` is what LLVM 15 and 16 abort on
    assert (jit.llvm_version(Path(library)) or 0) >= jit.OLDEST_LLVM


def test_arrays_name_the_doctor_where_dr_jit_has_no_backend(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(jit, "backend", lambda: "numpy")
    with pytest.raises(RuntimeError, match="rodcone doctor"):
        jit.arrays()
