"""The notebooks of the documentation run, and show something."""

import json
import re
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
