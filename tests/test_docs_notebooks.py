"""The notebooks of the documentation run, and show something."""

import ast
import json
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
NOTEBOOKS = sorted((ROOT / "docs" / "notebooks").glob("*.ipynb"))


def test_there_is_a_notebook_for_each_user() -> None:
    names = ["camera_engineer.ipynb", "first_picture.ipynb", "student.ipynb", "vision_scientist.ipynb"]
    assert [path.name for path in NOTEBOOKS] == names


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.name)
def test_fields_that_a_notebook_shows_are_still_in_the_code(path: Path) -> None:
    packages = ("render", "sensor", "isp", "studies")
    code = "".join(file.read_text("utf-8") for package in packages for file in sorted((ROOT / package).rglob("*.py")))
    for cell in json.loads(path.read_text("utf-8"))["cells"]:
        for output in cell.get("outputs", []):
            shown = "".join(output.get("data", {}).get("text/plain", []))
            for field in re.findall(r"[( ](\w+)=", shown):
                assert re.search(rf"^    {field}: ", code, re.MULTILINE), field


@pytest.mark.slow
@pytest.mark.filterwarnings("default")  # Jupyter's own warn of its transport
@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.name)
def test_a_notebook_runs_from_top_to_bottom_and_every_cell_shows_something(path: Path) -> None:
    nbformat = pytest.importorskip("nbformat", reason="needs nbclient and ipykernel (extra dev)")
    nbclient = pytest.importorskip("nbclient", reason="needs nbclient and ipykernel (extra dev)")
    pytest.importorskip("ipykernel", reason="needs nbclient and ipykernel (extra dev)")
    notebook = nbformat.read(path, as_version=4)
    nbformat.validate(notebook)
    nbclient.NotebookClient(notebook, timeout=280, kernel_name="python3").execute()
    for cell in notebook.cells:
        if cell.cell_type == "code":
            shown = [output.get("data", {}) for output in cell.outputs]
            assert any({"text/html", "image/png"} & data.keys() for data in shown), cell.source


# The numbered scripts of examples/ run as a reader runs them, write what they say, and import rodcone alone.


FOLDER = Path(__file__).resolve().parent.parent / "examples"
SCRIPTS = sorted(FOLDER.glob("*.py"))
QUICK = {"03_sensor"}  # renders nothing: under a second
WRITTEN = re.compile(r"\b[\w/]+\.(?:png|dng|exr|html)\b")


def test_scripts_are_numbered_from_1_to_10() -> None:
    assert [path.stem[:3] for path in SCRIPTS] == [f"{number:02d}_" for number in range(1, 11)]


def test_a_script_says_what_is_new_and_what_to_expect() -> None:
    for path in SCRIPTS:
        said = ast.get_docstring(ast.parse(path.read_text("utf-8"))) or ""
        assert [len(re.findall(rf"^{word}: \S", said, re.MULTILINE)) for word in ("New here", "Expect")] == [1, 1], path


def test_a_script_is_a_page() -> None:
    lengths = {path.stem: path.read_text("utf-8").count("\n") for path in SCRIPTS}
    assert max(lengths.values()) <= 70, lengths


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
