"""The command line: exit codes, one line on stderr, results alone on stdout."""

import subprocess
import sys
from importlib import metadata
from pathlib import Path

from command_line import call, check_refusals


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
