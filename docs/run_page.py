"""Run the code of a documentation page in order, as a reader would: `python docs/run_page.py PAGE FOLDER`.

In FOLDER, block by block: one with a title is written to the file of that name, ``python`` is run (all of a page in one
namespace), ``sh`` is run by bash. Blocks of any other language are for reading alone. What a block prints is kept in
FOLDER/output.json, by the block's number: the built page shows it.
"""

import json
import os
import re
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import redirect_stdout, suppress
from dataclasses import dataclass
from io import StringIO
from pathlib import Path
from typing import Any

FENCE = re.compile(r'^```(\w+)(?: title="([^"]+)")?\n(.*?)^```$', re.MULTILINE | re.DOTALL)


@dataclass(frozen=True)
class Block:
    """A fenced block of a page; `line` is that of its first line of code."""

    language: str
    title: str
    code: str
    line: int


def blocks(text: str) -> Iterator[Block]:
    """Fenced blocks of a page, in order."""
    for fence in FENCE.finditer(text):
        yield Block(fence[1], fence[2] or "", fence[3], text.count("\n", 0, fence.start(3)) + 1)


def run(page: Path, folder: Path) -> None:
    """Run a page's blocks in `folder`, which is made; what fails ends it with the page's name and line."""
    page = page.resolve()
    folder.mkdir(parents=True, exist_ok=True)
    os.chdir(folder)
    sys.path[0] = os.getcwd()  # in place of this script's folder: a page's own modules
    os.environ["PATH"] = os.pathsep.join([str(Path(sys.executable).parent), os.environ.get("PATH", "")])
    names: dict[str, Any] = {"__name__": "__page__"}
    printed = {}
    for number, block in enumerate(blocks(page.read_text("utf-8"))):
        if block.title:
            Path(block.title).parent.mkdir(parents=True, exist_ok=True)
            Path(block.title).write_text(block.code, "utf-8")
        elif block.language == "python":
            with redirect_stdout(StringIO()) as output:
                exec(compile("\n" * (block.line - 1) + block.code, str(page), "exec"), names)
            printed[number] = output.getvalue()
        elif block.language == "sh":
            code, printed[number] = run_shell(block.code)
            if code:
                sys.exit(f"{page.name}:{block.line}: exit code {code}")
    Path("output.json").write_text(json.dumps(printed, indent=1), "utf-8")


def run_shell(code: str) -> tuple[int, str]:
    """Exit code and output of a shell block; what it leaves in the background is ended with it."""
    with tempfile.TemporaryFile("w+", encoding="utf-8") as output:
        shell = subprocess.Popen(["bash", "-euo", "pipefail", "-c", code], stdout=output, start_new_session=True)
        try:
            shell.wait()
        finally:
            with suppress(ProcessLookupError):
                os.killpg(shell.pid, signal.SIGTERM)
        output.seek(0)
        return shell.returncode, output.read()


if __name__ == "__main__":
    run(Path(sys.argv[1]), Path(sys.argv[2]))
