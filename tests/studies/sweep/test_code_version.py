"""A cell's key changes with the code that decides a picture, and with no other."""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from studies.sweep.provenance import ROOT, code_version, deciding_modules

PACKAGES = ("rodcone", "render", "scenes", "sensor", "isp", "studies")


@pytest.fixture(scope="module")
def copy(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("copy")
    for package in PACKAGES:
        shutil.copytree(ROOT / package, folder / package, ignore=shutil.ignore_patterns("__pycache__"))
    return folder


def changed(folder: Path, path: Path) -> bool:
    """Whether one byte more in a file gives another version."""
    before, content = code_version(folder), path.read_bytes()
    path.write_bytes(content + b"#")
    after = code_version(folder)
    path.write_bytes(content)
    return after != before


@pytest.mark.thorough
def test_all_that_making_a_picture_imports_decides_it() -> None:
    """Measured in a process of its own: whatever of `studies` making a frame and running a cell load."""
    script = (
        "import studies.sweep.run_cell, studies.sweep.frames, sys\n"
        "found = {name: module for name, module in sys.modules.items() if name.startswith('studies.')}\n"
        "print(*(module.__file__ for module in found.values() if not hasattr(module, '__path__')))"
    )
    loaded = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True).stdout.split()
    assert {Path(file).resolve() for file in loaded} <= set(deciding_modules())


@pytest.mark.sample(2)
@pytest.mark.parametrize("package", ["rodcone", "render", "scenes", "sensor", "isp"])
def test_every_module_before_the_studies_decides(copy: Path, package: str) -> None:
    paths = sorted((copy / package).rglob("*.py"))
    assert [path for path in (paths[0], paths[-1]) if not changed(copy, path)] == []


@pytest.mark.thorough
def test_a_byte_of_any_deciding_module_changes_the_version(copy: Path) -> None:
    deciding = deciding_modules(copy)
    assert {"quality", "truth", "camera", "picture_file", "lit_scene", "run_cell"} <= {path.stem for path in deciding}
    assert [path for path in deciding if not changed(copy, path)] == []


@pytest.mark.thorough
@pytest.mark.parametrize("folder", ["pages", "commands", "paper"])
def test_what_shows_results_decides_nothing(copy: Path, folder: str) -> None:
    paths = sorted((copy / "studies" / folder).rglob("*.py"))
    assert paths
    assert [path for path in paths if changed(copy, path)] == []
