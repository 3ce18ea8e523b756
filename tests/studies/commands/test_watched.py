"""A run that ends suddenly, as where memory runs out while LLVM compiles: one line, and status 2."""

import resource
import signal
import subprocess
import sys
from pathlib import Path

import pytest

SCRIPT = """
import os, sys
from studies.commands import cli

def run(words, **_):
    os.mkdir(".shot.tif.render")
    print("at work", flush=True)
    eval(words[1])

cli.app = run
sys.argv[1:] = ["capture", sys.argv[1], "--force", "--out=shot.tif"]
cli.main()
"""


def ended(ending: str, folder: Path) -> tuple[int, str, str]:
    """Exit status, output and errors of a command that comes to an end by an expression."""
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT, ending], cwd=folder, capture_output=True, text=True, check=False, timeout=60
    )
    return done.returncode, done.stdout, done.stderr


@pytest.mark.parametrize("name", ["SIGSEGV", "SIGABRT", "SIGKILL"])
def test_a_sudden_end_is_one_line_that_says_what_is_kept(name: str, tmp_path: Path) -> None:
    (tmp_path / ".shot.dng.render").mkdir()  # of an earlier run, which this one does not go on from
    code, out, err = ended(f"os.kill(os.getpid(), {int(getattr(signal, name))})", tmp_path)
    assert (code, out) == (2, "at work\n")
    assert err == (
        f"rodcone: memory: it ran out (the system ended the run by {name}, as where a compiler gets no more); take a "
        "smaller picture (--size), fewer bands or fewer workers; the render is kept in .shot.tif.render, from which "
        "the same command goes on\n"
    )


def test_any_other_end_stays_as_it_is(tmp_path: Path) -> None:
    assert ended("sys.exit(7)", tmp_path) == (7, "at work\n", "")
    (tmp_path / ".shot.tif.render").rmdir()
    assert ended(f"os.kill(os.getpid(), {int(signal.SIGTERM)})", tmp_path)[0] == 128 + signal.SIGTERM


@pytest.mark.thorough
@pytest.mark.parametrize("most_mb", [1200, 1000])
def test_a_render_for_which_memory_does_not_suffice_ends_in_one_line(most_mb: int, tmp_path: Path) -> None:
    """Whatever part of the program finds no memory: a finished picture, or a line, and a render's folder is named."""
    words = ["capture", "flat_field", "--size", "700", "--render", "--spp", "8", "--force", "-o", "shot.tif"]
    done = subprocess.run(
        [sys.executable, "-c", "from studies.commands.cli import main; main()", *words],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_AS, (most_mb * 10**6,) * 2),
    )
    if done.returncode == 0:
        assert {"shot.tif", "shot.json"} <= {path.name for path in tmp_path.iterdir()}
        return
    last = done.stderr.splitlines()[-1]
    assert done.returncode == 2, done.stderr
    assert last.startswith("rodcone: memory: it ran out ("), done.stderr
    assert (tmp_path / ".shot.tif.render").is_dir() == ("the render is kept in" in last)
