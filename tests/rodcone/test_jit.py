"""Dr.Jit compiles with the LLVM library that `rodcone.llvm` has chosen."""

from pathlib import Path

import numpy as np
import pytest
from command_line import in_new_python

from rodcone import jit, llvm
from rodcone.llvm import OLDEST_LLVM, llvm_version


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
    assert (llvm_version(Path(library)) or 0) >= OLDEST_LLVM


def test_arrays_name_the_doctor_where_dr_jit_has_no_backend(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(jit, "backend", lambda: "numpy")
    with pytest.raises(RuntimeError, match="rodcone doctor"):
        jit.arrays()


# The choice of the LLVM library, judged by file name.


ABORTING = ("libLLVM-14.so.1", "libLLVM-15.so", "libLLVM-15.so.1", "libLLVM-16.so.1", "libLLVM.so.16.0")


def fake_library(folder: Path, name: str) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / name
    path.touch()
    return path


def test_version_is_told_by_the_file_name() -> None:
    for name, version in (
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
    ):
        assert llvm.llvm_version(Path("/anywhere") / name) == version, name


def test_a_system_library_that_aborts_is_never_chosen(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(llvm, "_SYSTEM_DIRECTORIES", (str(tmp_path),))
    for name in ABORTING:
        old = fake_library(tmp_path, name)
        chosen = llvm._system_library()
        assert chosen != old
        # the machine may have one of its own
        assert chosen is None or (llvm.llvm_version(chosen) or 0) >= 17
        old.unlink()


def test_the_newest_system_library_is_chosen(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in (*ABORTING, "libLLVM-17.so.1", "libLLVM-C.so", "libLLVM.so"):
        fake_library(tmp_path / "a", name)
    newest = fake_library(tmp_path / "b", "libLLVM.so.1000.1")  # above any that the machine may have
    fake_library(tmp_path / "b", "libLLVM.so.999.1")  # the greater as text, not as a number
    (tmp_path / "b" / "libLLVM-2000.so").symlink_to(tmp_path / "gone.so")
    folders = (str(tmp_path / "a"), str(tmp_path / "b"), str(tmp_path / "absent"))
    monkeypatch.setattr(llvm, "_SYSTEM_DIRECTORIES", folders)
    assert llvm._system_library() == newest


def test_the_users_value_comes_first_then_the_wheel_then_the_system(monkeypatch: pytest.MonkeyPatch) -> None:
    own, wheel, system = Path("/own/libLLVM-16.so"), Path("/wheel/libLLVM.so.23.1"), Path("/system/libLLVM-17.so")
    monkeypatch.setattr(llvm, "_wheel_library", lambda: wheel)
    monkeypatch.setattr(llvm, "_system_library", lambda: system)
    monkeypatch.setenv("DRJIT_LIBLLVM_PATH", str(own))
    assert llvm.find_llvm() == own
    monkeypatch.setenv("DRJIT_LIBLLVM_PATH", "")
    assert llvm.find_llvm() == wheel, "an empty variable is no choice"
    monkeypatch.delenv("DRJIT_LIBLLVM_PATH")
    assert llvm.find_llvm() == wheel
    monkeypatch.setattr(llvm, "_wheel_library", lambda: None)
    assert llvm.find_llvm() == system
    monkeypatch.setattr(llvm, "_system_library", lambda: None)
    assert llvm.find_llvm() is None


def test_the_wheels_library_is_a_file_of_an_accepted_version() -> None:
    library = llvm._wheel_library()
    if library is None:
        pytest.skip("karellen-llvm-core is not installed here (its wheels are for Linux x86-64)")
    assert library.is_file()
    assert (llvm.llvm_version(library) or 0) >= llvm.OLDEST_LLVM


@pytest.mark.skipif(jit.backend() == "numpy", reason="Dr.Jit has neither LLVM nor CUDA here")
def test_compiling_counts_new_kernels_alone() -> None:
    new = float(np.random.default_rng().random())  # a number in the code: no kernel that Dr.Jit keeps has it
    kind = jit.arrays().Float
    with jit.compiling() as told:
        jit.dr.eval(jit.dr.sin(jit.dr.arange(kind, 3)) * new)
        first = told()
        jit.dr.eval(jit.dr.sin(jit.dr.arange(kind, 3)) * new)
        assert told() == first > 0
