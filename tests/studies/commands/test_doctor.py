"""What the doctor tells, and that it sees a foreign package without failing at its import."""

import os
import re
import tomllib
from importlib.machinery import ModuleSpec
from pathlib import Path

import pytest
from command_line import call, in_new_python, new_python

from rodcone import jit, llvm
from studies.commands import doctor

HOME = Path(doctor.__file__).resolve().parents[2]


def test_every_row_is_there_and_this_environment_is_sound() -> None:
    code, out, _ = call(["doctor"])
    assert code == 0
    assert "all is well" in out
    found = doctor.findings()
    rows = {each.name: each for each in found}
    wanted = {"rodcone", "Python", "platform", "CPU threads", "LLVM", "backend", "Mitsuba variant", "Dr.Jit threads"}
    wanted |= {*doctor.NEEDED, doctor.LLVM_WHEEL, "packages", *(f"extra {name}" for name in doctor.EXTRAS)}
    assert wanted <= rows.keys()
    assert len(rows) == len(found), "a name stands twice"
    assert all("\n" not in each.value and each.value for each in found)
    assert all(each.ok for each in found), [each for each in found if not each.ok]
    assert rows["backend"].value.split(":")[0] == jit.backend()
    assert int(rows["Dr.Jit threads"].value) == jit.dr.thread_count()


def test_a_file_with_a_packages_name_is_named_by_the_doctor_and_by_the_import(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "sensor.py").write_text("x = 1\n", "utf-8")
    monkeypatch.chdir(tmp_path)
    (found,) = [each for each in doctor.findings() if not each.ok]
    assert found.name == "file sensor.py"
    assert str(tmp_path / "sensor.py") in found.value
    done = new_python("import rodcone", folder=tmp_path)
    (last,) = done.stderr.splitlines()[-1:]
    assert last.startswith(f"ImportError: rodcone: {tmp_path / 'sensor.py'} stands in the place of rodcone's package")


def test_threads_are_those_that_this_process_may_use_of_the_machines(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "sched_getaffinity", lambda process: {3}, raising=False)
    monkeypatch.setattr(os, "cpu_count", lambda: 8)
    assert doctor.Finding("CPU threads", "1 of 8") in doctor.findings()


def test_one_fault_makes_the_exit_code_1(monkeypatch: pytest.MonkeyPatch) -> None:
    good, bad = doctor.Finding("a", "1"), doctor.Finding("b", "[2]", False)
    for found, code in (((good, good), 0), ((good, bad, good), 1)):
        monkeypatch.setattr(doctor, "findings", lambda found=found: found)
        ended, out, _ = call(["doctor"])
        assert ended == code
        *rows, verdict = [line.split(maxsplit=1) for line in out.splitlines()]
        assert [[name, value.strip()] for name, value in rows] == [[each.name, each.value] for each in found]
        words = "wrong: b; mend what stands beside" if code else "all is well"
        assert [text.strip() for text in verdict] == ["verdict", words]


def test_without_llvm_and_cuda_the_fallback_is_said_in_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(llvm, "LIBLLVM", None)
    monkeypatch.setattr(jit, "backend", lambda: "numpy")
    rows = {each.name: each for each in doctor.engine_findings()}
    assert rows["LLVM"].value.startswith("none of version 17 or newer")
    assert rows["backend"].ok, "stored light is still photographed"
    for part in ("numpy", "nothing is rendered", "capture and reconstruction", "NumPy forms"):
        assert part in rows["backend"].value
    assert "\n" not in rows["backend"].value


def test_an_engine_that_cannot_be_imported_is_a_row_and_no_traceback(tmp_path: Path) -> None:
    (tmp_path / "drjit.py").write_text(
        "try:\n"
        "    raise ImportError('libatomic.so.1: cannot open shared object file')\n"
        "except ImportError:\n"
        "    missing.name\n"  # what Dr.Jit 1.5 does
    )
    done = in_folder(tmp_path, "from studies.commands.doctor import engine_findings\nprint(engine_findings())")
    assert "libatomic.so.1: cannot open" in done
    assert "apt install libatomic1" in done
    assert "ok=False" in done


def test_llvm_finding_names_the_library_and_the_fix(tmp_path: Path) -> None:
    for name, version, ok in (
        ("libLLVM-16.so", 16, False),
        ("libLLVM-17.so", 17, True),
        ("libLLVM.so", None, True),
        ("gone.so", None, False),
    ):
        library = tmp_path / name
        if name != "gone.so":
            library.touch()
        found = doctor.llvm_finding(library, version, 17)
        assert found.ok is ok, name
        assert str(library) in found.value
        assert ("unset DRJIT_LIBLLVM_PATH" in found.value) is not ok, name
        assert "DRJIT_LIBLLVM_PATH" in found.value, "a library outside the wheel is the user's or the system's"


def in_folder(folder: Path, code: str) -> str:
    """What `code` prints in a Python of its own that looks into `folder` first."""
    return in_new_python(f"import os; os.chdir({str(folder)!r})\n{code}", PYTHONPATH=f"{folder}{os.pathsep}{HOME}")


def test_a_package_is_own_foreign_missing_or_shared(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def found(folder: Path | None, intruder: str | None = None) -> doctor.Finding:
        spec = ModuleSpec("scenes", None, is_package=True)
        spec.submodule_search_locations = [str(folder / "scenes")] if folder else []
        monkeypatch.setattr(doctor.util, "find_spec", lambda name: spec if folder else None)
        return doctor.package_finding("scenes", HOME, intruder)

    own, foreign, missing, shared = found(HOME), found(tmp_path), found(None), found(HOME, "stage-tools")
    assert own.ok
    assert own.value.startswith("rodcone's own")
    assert not foreign.ok
    assert str(tmp_path / "scenes") in foreign.value
    assert not missing.ok
    assert not shared.ok
    assert "stage-tools" in shared.value


def test_a_distribution_that_wrote_into_rodcones_folder_is_found(tmp_path, monkeypatch):
    info = tmp_path / "stage_tools-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: stage-tools\nVersion: 1.0\n")
    (info / "RECORD").write_text("scenes/curtain.py,,\nlights/__init__.py,,\n")
    for file in ("scenes/curtain.py", "lights/__init__.py"):  # a backport lists only what is there
        (tmp_path / file).parent.mkdir()
        (tmp_path / file).touch()
    monkeypatch.syspath_prepend(tmp_path)
    assert doctor.intruders(tmp_path) == {"scenes": "stage-tools"}
    assert doctor.intruders(tmp_path / "elsewhere") == {}


def test_the_extras_are_those_of_the_project_and_what_they_bring() -> None:
    project = tomllib.loads((HOME / "pyproject.toml").read_text("utf-8"))["project"]["optional-dependencies"]
    named = {name: [re.split("[<>=~]", text)[0] for text in texts] for name, texts in project.items()}
    assert {name: list(brought) for name, (_, brought) in doctor.EXTRAS.items()} == {
        name: brought for name, brought in named.items() if name not in ("docs", "bench", "train-net", "test", "dev")
    }
