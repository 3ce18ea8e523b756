"""No Python file of the working directory runs: it may be the folder of a downloaded scene."""

import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat

ROOT = Path(__file__).parents[3]
PLANTED = ("numpy", "random", "socket", "pickle", "scipy", "render", "studies")
# What pip installs as `rodcone` does the same; spawned workers import this file anew.
SCRIPT = """
import sys
from functools import partial
from threading import Event
from types import SimpleNamespace

from studies.commands.cli import main
from studies.explore.slow import begin

if __name__ == "__main__":
    developed, results = Event(), []
    begin(SimpleNamespace(develop=partial(len, "abc"), processor="ple"), lambda x: (results.append(x), developed.set()))
    assert developed.wait(60) and results == [3], results
    main(["sweep", *sys.argv[1:]])
"""
STUDY = 'scenes = [{source = "desk.mat", light = "E"}]\nlevels = ["1cd/m2"]\nprocessors = ["bayer"]\n'
SCENE = """
holds = "radiance"
variable = "values"
wavelength_nm = [400, 700]
axes = ["height", "width", "wavelength"]
"""


@pytest.mark.thorough
def test_a_sweep_its_workers_a_mat_file_and_a_slow_processor_run_no_file_beside_them(tmp_path: Path) -> None:
    folder, script = tmp_path / "downloaded", tmp_path / "bin" / "run.py"
    for path in (folder, script.parent):
        path.mkdir()
    script.write_text(SCRIPT, "utf-8")
    for name in PLANTED:
        (folder / f"{name}.py").write_text(f'open({str(tmp_path / "ran")!r}, "a").write({name + " "!r})\n1 / 0\n')
    savemat(folder / "desk.mat", {"values": np.full((16, 20, 7), 1e-3)})
    (folder / "desk.toml").write_text(SCENE, "utf-8")
    (folder / "study.toml").write_text(STUDY, "utf-8")
    done = subprocess.run(
        [sys.executable, str(script), "study.toml", "-o", "out", "--workers", "2", "--as-stated"],
        cwd=folder,
        env={**{name: text for name, text in os.environ.items() if name != "PYTHONSAFEPATH"}, "PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        check=False,
    )
    ran = (tmp_path / "ran").read_text() if (tmp_path / "ran").exists() else ""
    assert (done.returncode, done.stdout, ran) == (0, "out/ledger.sqlite\n", ""), done.stderr


STARTS = r"^ *(import|from) .*\b(subprocess|multiprocessing|ProcessPoolExecutor)\b|\bos\.(system|popen|spawn|exec|fork)"


def test_every_module_that_starts_a_process_gives_it_a_safe_path() -> None:
    packages = ("rodcone", "render", "scenes", "sensor", "isp", "studies")
    starting = {}
    for path in (path for name in packages for path in (ROOT / name).rglob("*.py")):
        text = path.read_text("utf-8")
        if re.search(STARTS, text, re.MULTILINE):
            starting[path.relative_to(ROOT).as_posix()] = "rodcone.child_process" in text
    assert len(starting) >= 3
    assert all(starting.values()), starting
