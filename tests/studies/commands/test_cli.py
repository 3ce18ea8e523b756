"""The command line: exit codes, one line on stderr, results alone on stdout."""

import json
import os
import re
import subprocess
import sys
from importlib import metadata
from pathlib import Path

import numpy as np
import pytest
from command_line import call, check_refusals, in_new_python
from scipy.io import savemat

from isp.ple.prior import load_prior, own_prior
from isp.processors.catalogue import PROCESSORS
from render import illuminants
from render.illuminants import illuminant
from scenes import catalogue
from sensor import cfa, presets
from sensor.cameras.library import measured_cameras
from studies.commands import train


def test_bad_input_is_refused_and_a_bad_place_is_told_before_the_render(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    rows = (
        ("demo --longest-exposure -1s", "--longest-exposure ... '-1s' is not a time ... write 20ms"),
        ("snr low_noise --exposure 33", "--exposure ... '33' is not a time ... write 33ms or 33s"),
        ("new study mine.toml", "out: none is given ... write rodcone new study -o mine.toml"),
        ("demo --size big", "--size ... big"),
        ("demo --bogus 3", "--bogus"),
        ("dome", "dome ... demo"),
    )
    check_refusals("", rows, tmp_path)
    (tmp_path / "file").write_text("")
    check_refusals("demo", [("-o file/out", "choose another place with --out")], tmp_path, code=1)


def test_the_package_runs_as_the_command() -> None:
    done = subprocess.run([sys.executable, "-m", "rodcone", "--version"], capture_output=True, text=True, check=True)
    assert (done.stdout, done.stderr) == (metadata.version("rodcone") + "\n", "")


def test_demo_prints_the_report_alone_on_stdout(tmp_path: Path) -> None:
    arguments = ["demo", "-o", str(tmp_path / "o"), "--size", "32", "--spp", "8", "--scene", "flat_field"]
    arguments += ["--processor", "interleaved", "--processor", "bayer"]
    code, out, _ = call([*arguments, "--level", "10cd/m2", "--sensor", "low_noise"])
    assert (code, out.strip()) == (0, str(tmp_path / "o" / "report.html"))
    assert (tmp_path / "o" / "report.html").stat().st_size > 10_000


# What `rodcone list` says: every name that a catalogue knows, and temperatures as the spectra have them.


def printed(*arguments: object) -> str:
    code, out, _ = call(["list", *arguments])
    assert code == 0
    return out


def test_every_name_of_every_catalogue_is_listed() -> None:
    found = json.loads(printed("--json"))
    assert tuple(found["scenes"]) == catalogue.scene_names()
    assert tuple(found["lights"]) == (*illuminants.illuminant_names(), "3000K", "D7000K")
    assert tuple(found["sensors"]) == (*presets.preset_names(), *measured_cameras())
    assert tuple(found["mosaics"]) == (*cfa.mosaics(), *presets.VARIATIONS)
    assert found["mosaics"]["rgbw_nd"].startswith("RG/BW: ")
    assert tuple(found["processors"]) == tuple(PROCESSORS)
    assert "flip_mean" in found["metrics"]
    assert all(text.strip() for lines in found.values() for text in lines.values())
    for name in found["lights"]:
        illuminant(name)


def test_one_kind_is_listed_alone_with_a_line_a_name() -> None:
    lines = printed("mosaics").splitlines()
    assert lines[0] == "mosaics"
    assert [line.split()[:2] for line in lines[1:3]] == [["rgbw", "RG/BW:"], ["bayer", "RG/GB:"]]


@pytest.mark.thorough
def test_curves_are_drawn_with_every_name(tmp_path: Path) -> None:
    for kind, names in (("lights", [*illuminants.illuminant_names(), "3000K"]), ("sensors", ["the presets"])):
        printed(kind, "-o", tmp_path / "curves.svg")
        drawn = (tmp_path / "curves.svg").read_text("utf-8")
        assert [name for name in names if f">{name}</text>" not in drawn] == []


def test_what_has_no_curves_or_no_place_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    rows = (("lights -o a.png", ".svg"), ("scenes -o a.svg", "no curves to show"), ("-o a.svg", "no curves to show"))
    check_refusals("list", rows, tmp_path)


@pytest.mark.sample(1)
@pytest.mark.parametrize("kind", ["", "scenes", "lights", "sensors", "mosaics", "processors", "metrics"])
def test_lists_import_no_renderer(kind: str) -> None:
    """Nor what takes long to load: 0.2 to 0.6 s of processor time a command, where a list of mosaics took 1.7 s."""
    program = (
        f"import sys; from studies.commands.cli import app; app('list {kind}', result_action='return_value'); "
        f"print([name for name in 'mitsuba drjit matplotlib colour scipy.ndimage'.split() if name in sys.modules])"
    )
    assert in_new_python(program).splitlines()[-1] == "[]"


@pytest.mark.sample(1)
@pytest.mark.parametrize("command", ["develop", "capture"])
def test_commands_that_may_need_no_renderer_import_none(command: str) -> None:
    """Dr.Jit takes a quarter of a second and 60 MB, which `ple` and a light from a file don't need."""
    program = (
        f"import sys, studies.commands.{command}; "
        f"slow = 'mitsuba drjit matplotlib colour scipy.linalg scipy.ndimage'.split(); "
        f"print([name for name in slow if name in sys.modules])"
    )
    assert in_new_python(program).splitlines()[-1] == "[]"


# No Python file of the working directory runs: it may be the folder of a downloaded scene.


ROOT = Path(__file__).parents[3]
PLANTED = ("numpy", "random", "socket", "pickle", "scipy", "render", "studies")
# What pip installs as `rodcone` does the same; spawned workers import this file anew.
SCRIPT = """
import sys
from functools import partial
from threading import Event

from studies.commands.cli import main
from studies.explore.slow import begin

if __name__ == "__main__":
    developed, results = Event(), []
    begin("ple", partial(len, "abc"), lambda x: (results.append(x), developed.set()))
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


STARTS = r"^ *(import|from) .*\b(subprocess|multiprocessing|ProcessPoolExecutor)\b|\bos\.(system|popen|spawn|exec)"
# A fork (`studies.commands.watched`) goes on as this process, with its path.


def test_every_module_that_starts_a_process_gives_it_a_safe_path() -> None:
    packages = ("rodcone", "render", "scenes", "sensor", "isp", "studies")
    starting = {}
    for path in (path for name in packages for path in (ROOT / name).rglob("*.py")):
        text = path.read_text("utf-8")
        if re.search(STARTS, text, re.MULTILINE):
            starting[path.relative_to(ROOT).as_posix()] = "rodcone.child_process" in text
    assert len(starting) >= 3
    assert all(starting.values()), starting


# `rodcone train`: what it writes, and what it refuses; the fit itself is tests/studies/training's.


def test_it_writes_a_prior_and_prints_its_path(tmp_path, monkeypatch):
    asked = []
    monkeypatch.setattr(train, "train_prior", lambda *given: asked.append(given[1:]) or own_prior())
    code, out, _ = call(["train", "--sensor", "low_noise", "-o", tmp_path / "prior.npz", "--json"])
    assert (code, asked) == (0, [("low_noise", 1)])
    facts = json.loads(out)
    assert load_prior(tmp_path / "prior.npz").source == own_prior().source
    assert facts["path"] == str(tmp_path / "prior.npz")
    assert facts["seed"] == json.loads(own_prior().source)["seed"]


def test_another_ending_is_refused(tmp_path):
    rows = [(f"--sensor low_noise -o {name}", "has another ending; allowed: .npz") for name in ("prior.txt", "prior")]
    check_refusals("train", rows, tmp_path)
