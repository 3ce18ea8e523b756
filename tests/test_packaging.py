"""The wheel and the source archive: built as a user's pip would, checked as an index would."""

import subprocess
import sys
import tarfile
import zipfile
from email import message_from_bytes
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
PACKAGES = ("rodcone", "render", "scenes", "sensor", "isp", "studies")

pytestmark = [pytest.mark.slow, pytest.mark.timeout(600)]


def run(*command: str) -> None:
    done = subprocess.run([sys.executable, "-m", *command], cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.fixture(scope="module")
def archives(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """The wheel, built from the source archive in an environment of its own, and that archive."""
    folder = tmp_path_factory.mktemp("dist")
    run("build", "--outdir", str(folder), str(ROOT))
    (wheel,), (source,) = folder.glob("*.whl"), folder.glob("*.tar.gz")
    return wheel, source


def files_of(packages: tuple[str, ...]) -> set[str]:
    return {
        path.relative_to(ROOT).as_posix()
        for name in packages
        for path in (ROOT / name).rglob("*")
        if path.is_file() and "__pycache__" not in path.parts and not path.name.startswith(".")
    }


def test_an_index_would_accept_both(archives: tuple[Path, Path]) -> None:
    run("twine", "check", "--strict", *map(str, archives))


def test_the_wheel_holds_every_file_of_the_five_packages_and_nothing_else(archives: tuple[Path, Path]) -> None:
    with zipfile.ZipFile(archives[0]) as wheel:
        held = {name for name in wheel.namelist() if ".dist-info/" not in name}
    assert held == files_of(PACKAGES)
    assert {name.split("/")[0] for name in held} == set(PACKAGES)
    assert {f"{name}/py.typed" for name in PACKAGES} <= held


def test_the_wheel_says_what_it_needs_and_brings_the_command(archives: tuple[Path, Path]) -> None:
    with zipfile.ZipFile(archives[0]) as wheel:
        (info,) = {name.split("/")[0] for name in wheel.namelist() if ".dist-info/" in name}
        metadata = message_from_bytes(wheel.read(f"{info}/METADATA"))
        commands = wheel.read(f"{info}/entry_points.txt").decode()
    assert metadata["Name"] == "rodcone"
    assert metadata["License-Expression"] == "MIT"
    assert metadata["Requires-Python"] == ">=3.11"
    assert "rodcone = studies.commands.cli:main" in commands
    (llvm,) = [need for need in metadata.get_all("Requires-Dist", []) if need.startswith("karellen-llvm-core")]
    assert "linux" in llvm, "its wheels are for Linux x86-64: elsewhere the installation must not ask for it"
    assert "x86_64" in llvm


def test_the_source_archive_holds_what_make_needs(archives: tuple[Path, Path]) -> None:
    with tarfile.open(archives[1]) as source:
        held = {name.split("/", 1)[1] for name in source.getnames() if "/" in name}
    tops = ("Makefile", "pyproject.toml", "LICENSE", "README.md", "VISION.md", "CONTRIBUTING.md", "CHANGELOG.md")
    assert {*tops, "CITATION.cff", "tests/test_architecture.py", "examples/01_picture.py"} | files_of(PACKAGES) <= held
