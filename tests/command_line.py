"""The command as its user meets it: exit code, what it prints, and refusals of one line that leave no file."""

import os
import re
import subprocess
import sys
from collections.abc import Iterable, Sequence
from contextlib import redirect_stderr, redirect_stdout
from io import StringIO
from pathlib import Path
from shlex import split

import pytest

from studies.commands.cli import main

# The line that a command begins with, of what it will cost.
COST = re.compile(r"\Arodcone: (about|\d+ cells, ).*(; at half the size |; with half the ).*\n")


def call(arguments: Iterable[object]) -> tuple[int, str, str]:
    """Exit code, stdout and stderr of ``rodcone`` with some arguments, without its line of what it will cost."""
    out, err = StringIO(), StringIO()
    with redirect_stdout(out), redirect_stderr(err), pytest.raises(SystemExit) as stopped:
        main([str(argument) for argument in arguments])
    return int(stopped.value.code or 0), out.getvalue(), COST.sub("", err.getvalue())


def check_refusals(command: str, rows: Sequence[tuple[str, str]], folder: Path, code: int = 2) -> None:
    """Each row's words, as a shell cuts them, are refused in one line that holds the row's message.

    Three dots in a message stand for any text. Nothing is printed on stdout, and the folder's files stay as they are.
    """
    before = _content(folder)
    for words, message in rows:
        row = f"rodcone {command} {words}"
        found, out, err = call([*command.split(), *split(words)])
        assert (found, out, err.count("\n")) == (code, "", 1), f"{row}: {err}"
        assert err.startswith("rodcone: "), f"{row}: {err}"
        assert re.search(".*".join(map(re.escape, message.split(" ... "))), err), f"{row}: {err}"
        assert _content(folder) == before, row


def _content(folder: Path) -> dict[Path, tuple[int, int]]:
    """Size and time of the files of a folder."""
    stats = {path: path.stat() for path in folder.rglob("*") if path.is_file()}
    return {path: (stat.st_size, stat.st_mtime_ns) for path, stat in stats.items()}


def new_python(
    code: str, *arguments: object, folder: Path | None = None, **variables: str
) -> subprocess.CompletedProcess[str]:
    """A Python of its own that has run `code`, with the variable that names LLVM unset."""
    kept = {name: value for name, value in os.environ.items() if name != "DRJIT_LIBLLVM_PATH"}
    command, environment = [sys.executable, "-c", code, *map(str, arguments)], kept | variables
    return subprocess.run(
        command, cwd=folder, env=environment, capture_output=True, text=True, timeout=240, check=False
    )


def in_new_python(code: str, *arguments: object, folder: Path | None = None, **variables: str) -> str:
    """What `code` prints in a Python of its own."""
    done = new_python(code, *arguments, folder=folder, **variables)
    assert done.returncode == 0, done.stderr
    return done.stdout.strip()
