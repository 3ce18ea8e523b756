"""The choice of the LLVM library, judged by file name."""

from pathlib import Path

import pytest

from rodcone import llvm

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
