"""The numbered scripts of examples/ run as a reader runs them, write what they say, and import rodcone alone."""

import ast
import re
import subprocess
import sys
from pathlib import Path

import pytest

FOLDER = Path(__file__).resolve().parent.parent / "examples"
SCRIPTS = sorted(FOLDER.glob("*.py"))
QUICK = {"03_sensor"}  # renders nothing: under a second
WRITTEN = re.compile(r"\b[\w/]+\.(?:png|dng|exr|html)\b")


def test_scripts_are_numbered_from_1_to_9() -> None:
    assert [path.stem[:3] for path in SCRIPTS] == [f"{number:02d}_" for number in range(1, 10)]


def test_a_script_is_a_page() -> None:
    lengths = {path.stem: path.read_text("utf-8").count("\n") for path in SCRIPTS}
    assert max(lengths.values()) <= 65, lengths


@pytest.mark.parametrize(
    "path",
    [pytest.param(path, marks=() if path.stem in QUICK else pytest.mark.thorough, id=path.stem) for path in SCRIPTS],
)
def test_a_script_runs_and_writes_what_its_docstring_says(path: Path, tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-W", "error", str(path), "32"], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip()
    written = WRITTEN.findall(ast.get_docstring(ast.parse(path.read_text("utf-8"))) or "")
    assert [name for name in written if not list(tmp_path.rglob(name))] == []
