"""The catalogue of planted faults fits the code, and the script that plants them can tell a fault from none.

`make faults` plants all of them; here five drawn by the date (slow).
"""

import ast
import subprocess
import sys
from collections import Counter
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "tests" / "faults"))

import plant_faults as faults  # noqa: E402
from plant_faults import FAULTS, Fault  # noqa: E402


def test_there_are_at_least_forty_faults_each_with_a_name_of_its_own() -> None:
    assert len(FAULTS) >= 40
    assert not [name for name, count in Counter(fault.name for fault in FAULTS).items() if count > 1]


def test_a_fault_changes_the_code_and_what_it_leaves_is_still_python() -> None:
    texts = {fault.file: (ROOT / fault.file).read_text() for fault in FAULTS}
    for fault in FAULTS:
        # which ends with a line where the code has moved on
        compile(faults.planted(fault, texts[fault.file]), fault.file, "exec")
        assert all(there != instead for there, instead in fault.edits), fault.name
        assert [test for test in fault.tests if not (ROOT / test).is_file()] == [], fault.name


def test_the_files_and_the_tests_of_the_mutants_are_there() -> None:
    tree = ast.parse((ROOT / "tests" / "faults" / "mutants.py").read_text())
    table = next(
        node.value for node in tree.body if isinstance(node, ast.Assign) and ast.unparse(node).startswith("TESTS")
    )
    paths = {ROOT / file: ROOT / "tests" / tests for file, tests in ast.literal_eval(table).items()}
    assert len(paths) == 10
    assert [path for pair in paths.items() for path in pair if not path.exists()] == []


def test_a_fault_whose_text_is_gone_is_told() -> None:
    gone = Fault("gone", "sensor/readout.py", "", (("not + there", "at + all"),), ())
    with pytest.raises(SystemExit, match="stands 0 times"):
        faults.planted(gone, "x = 1\n")


def _project(folder: Path, test: str) -> Fault:
    (folder / "sensor").mkdir()
    (folder / "sensor" / "part.py").write_text("FACTOR = 2\n")
    (folder / "test_part.py").write_text(test)
    return Fault("factor", "sensor/part.py", "", (("FACTOR = 2", "FACTOR = 3"),), ("test_part.py",))


READS = "from pathlib import Path\nTEXT = (Path(__file__).parent / 'sensor' / 'part.py').read_text()\n"


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("test", "caught"),
    [
        (READS + "def test_factor():\n    assert 'FACTOR = 2' in TEXT\n", True),
        (READS + "def test_nothing():\n    assert TEXT\n", False),
        (READS + "if 'FACTOR = 2' not in TEXT:\n    raise RuntimeError\ndef test_nothing():\n    pass\n", False),
    ],
    ids=["a test that fails", "tests that pass", "a module that can't be imported"],
)
def test_only_a_test_that_fails_counts_as_caught(tmp_path, monkeypatch, test, caught):
    fault = _project(tmp_path, test)
    (tmp_path / "pytest.ini").write_text("[pytest]\nmarkers = slow\n")
    monkeypatch.setattr(faults, "digest", lambda fault: "")
    result: dict[str, Any] = faults.plant(fault, tmp_path)
    assert result["caught"] is caught, result
    assert (tmp_path / "sensor" / "part.py").read_text() == "FACTOR = 2\n"


@pytest.mark.slow
@pytest.mark.timeout(1500)
def test_five_faults_drawn_by_the_date_are_caught(tmp_path: Path) -> None:
    command = [sys.executable, str(ROOT / "tests" / "faults" / "plant_faults.py"), "--draw", "5"]
    done = subprocess.run(
        [*command, "--results", str(tmp_path / "faults.json")], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert "5 of 5 faults caught" in done.stdout
