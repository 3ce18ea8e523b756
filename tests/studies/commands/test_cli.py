"""The command line: exit codes, one line on stderr, results alone on stdout."""

import subprocess
import sys
from importlib import metadata
from pathlib import Path

import pytest

from studies.commands.cli import main


def call(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> tuple[int, str, str]:
    with pytest.raises(SystemExit) as stopped:
        main(arguments)
    captured = capsys.readouterr()
    return int(stopped.value.code or 0), captured.out, captured.err


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["demo", "--scene", "stil_life"], ["scene", "'stil_life'", "still_life"]),
        (["demo", "--sensor", "lownoise"], ["sensor preset", "'lownoise'", "did you mean 'low_noise'?"]),
        (["demo", "--level", "25nits"], ["unit", "'nits'", "cd/m2, lux"]),
        (["demo", "--longest-exposure", "-1s"], ["--longest-exposure", "'-1s' is not a time", "write 20ms"]),
        (["snr", "low_noise", "--exposure", "33"], ["--exposure", "'33' is not a time", "write 33ms or 33s"]),
        (["new", "study", "mine.toml"], ["out: none is given", "write rodcone new study -o mine.toml"]),
        (["demo", "--size", "big"], ["--size", "big"]),
        (["demo", "--bogus", "3"], ["--bogus"]),
        (["dome"], ["dome", "demo"]),
    ],
)
def test_bad_input_is_one_line_and_exit_code_2(
    arguments: list[str],
    words: list[str],
    capsys: pytest.CaptureFixture[str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    code, out, err = call(arguments, capsys)
    assert (code, out, err.count("\n")) == (2, "", 1)
    for word in words:
        assert word in err
    assert list(tmp_path.iterdir()) == []


def test_place_that_cannot_be_written_is_told_before_the_render(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    (tmp_path / "file").write_text("")
    code, out, err = call(["demo", "-o", str(tmp_path / "file" / "out")], capsys)
    assert (code, out, err.count("\n")) == (1, "", 1)
    assert "choose another place with --out" in err


def test_version(capsys: pytest.CaptureFixture[str]) -> None:
    assert call(["--version"], capsys)[:2] == (0, metadata.version("rodcone") + "\n")


def test_the_package_runs_as_the_command() -> None:
    done = subprocess.run([sys.executable, "-m", "rodcone", "--version"], capture_output=True, text=True, check=True)
    assert (done.stdout, done.stderr) == (metadata.version("rodcone") + "\n", "")


def test_doctor_names_library_variant_and_packages(capsys: pytest.CaptureFixture[str]) -> None:
    code, out, _ = call(["doctor"], capsys)
    assert code == 0
    for word in ("LLVM", "Mitsuba variant", "extra explore", "rodcone's own", "all is well"):
        assert word in out


def test_demo_prints_the_report_alone_on_stdout(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    arguments = ["demo", "-o", str(tmp_path / "o"), "--size", "32", "--spp", "8", "--scene", "flat_field"]
    code, out, _ = call([*arguments, "--level", "10cd/m2", "--sensor", "low_noise"], capsys)
    assert (code, out.strip()) == (0, str(tmp_path / "o" / "report.html"))
    assert (tmp_path / "o" / "report.html").stat().st_size > 10_000


@pytest.mark.thorough
def test_a_reader_who_has_enough_ends_the_command_in_silence() -> None:
    command = "import sys; from studies.commands.cli import main; main(['list'])"
    with subprocess.Popen([sys.executable, "-c", command], stdout=subprocess.PIPE, stderr=subprocess.PIPE) as run:
        assert run.stdout is not None
        assert run.stderr is not None
        run.stdout.close()
        assert run.stderr.read() == b""
    assert run.returncode == 0
