"""A hundred cells of a sweep under random kills, on a full disk and on a read-only one (slow); stamps of `make verify`.

`python tests/soak/soak.py --cells 2000` is the long form, which holds the memory's slope too.
"""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

SCRIPT = Path(__file__).resolve().parent / "soak" / "soak.py"


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_nothing_is_lost_or_doubled_under_kills_and_bad_disks() -> None:
    done = subprocess.run([sys.executable, str(SCRIPT), "--cells", "100"], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    kills = re.search(r"killed: (\d+) workers and (\d+) whole sweeps", done.stdout)
    assert kills is not None
    assert int(kills[1]) + int(kills[2]) >= 3, "hardly anything was disturbed"
    if "bad disks: skipped" in done.stdout:
        pytest.skip("the kills are survived; mounting in a name space of one's own isn't permitted here")
    full, _, after = done.stdout.partition("[Errno 28]")  # of a picture, or of the ledger
    assert "exit 3" not in full
    assert "readonly" in after or "Read-only" in after


def test_code_that_changes_while_a_part_of_verify_runs_voids_its_stamp(tmp_path: Path) -> None:
    for name in ("rodcone", "render", "scenes", "sensor", "isp", "studies", "tests", "benchmarks", "env/bin"):
        (tmp_path / name).mkdir(parents=True)
    python, code = tmp_path / "env" / "bin" / "python", tmp_path / "rodcone" / "a.py"
    code.touch()
    (tmp_path / "env" / "installed-dev").touch()
    command = [
        "make",
        "--no-print-directory",
        "-f",
        str(SCRIPT.parents[2] / "Makefile"),
        "VENV=env",
        "-o",
        "env/installed-dev",
        "out/verify/soak",
    ]
    apart = {name: value for name, value in os.environ.items() if not name.startswith(("MAKE", "MFLAGS"))}
    said = []
    for script in ("sleep 0.1; touch rodcone/a.py; sleep 0.1", "true", "true"):
        python.write_text(f"#!/bin/sh\n{script}\n")
        python.chmod(0o755)
        said.append(subprocess.run(command, cwd=tmp_path, env=apart, capture_output=True, text=True, check=True).stdout)
    assert [words.startswith("soak") for words in said] == [True, True, False]
