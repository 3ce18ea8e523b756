"""Make every figure and table that README and the pages quote: `make results`, or `make results PART=white_pixel`.

docs/results/parts.toml lists the parts with their commands. A part that was made by the code and the commands of today
is left alone, and one that was ended goes on where it stopped, because sweeps and scenes keep what they have. A table
begins with a line, after ``#``, that says which version, day and machine made it, and by which command.
"""

import os
import shlex
import subprocess
import sys
import time
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import date
from pathlib import Path
from typing import Any

from page_parts import RESULTS, quote_everywhere, run, stamped

from rodcone.errors import InputError
from rodcone.files import write_files
from studies.photograph.clock import processor_name
from studies.sweep.provenance import code_version

ROOT = RESULTS.parents[1]
PARTS = RESULTS / "parts.toml"
WORK = ROOT / "out" / "results"


@dataclass(frozen=True)
class Part:
    """What one run of `make results PART=name` makes.

    Attributes
    ----------
    name : str
    minutes : float
        About how long it takes on two cores with AVX-512.
    commands : tuple of str
        Run in the repository's root, in this order; ``{work}`` is the part's own folder.
    tables : tuple of str
        Files of docs/results that it writes, without their ending.
    """

    name: str
    minutes: float
    commands: tuple[str, ...]
    tables: tuple[str, ...]

    @property
    def work(self) -> Path:
        """The folder in which the part goes on."""
        return WORK / self.name

    def made_by(self, version: str) -> str:
        """Return the text that a stamp holds: another version or another command makes the part anew."""
        return "\n".join([version, *self.commands, ""])

    def is_made(self, version: str) -> bool:
        """Return whether the part was made by this version and these commands."""
        stamp = self.work / "made"
        return stamp.is_file() and stamp.read_text("utf-8") == self.made_by(version)


def read_parts(text: str) -> list[Part]:
    """Return the parts that docs/results/parts.toml lists, in its order."""
    entries: Mapping[str, Mapping[str, Any]] = tomllib.loads(text)
    return [
        Part(name, entry["minutes"], tuple(entry["commands"]), tuple(entry["tables"]))
        for name, entry in entries.items()
    ]


def announcement(parts: Sequence[Part], version: str) -> str:
    """Return what will be made and how long it takes, a line for each part."""
    waiting = [part for part in parts if not part.is_made(version)]
    lines = [f"{part.name:18} {'made' if part.is_made(version) else f'{part.minutes:4g} min'}" for part in parts]
    total = sum(part.minutes for part in waiting)
    return "\n".join([*lines, f"about {total:g} minutes on two cores with AVX-512, in {version}"])


def make(part: Part, version: str) -> None:
    """Run a part's commands, and state in its tables where they come from.

    Raises
    ------
    InputError
        Where a command fails or a table isn't written: the part goes on there when it is called again.
    """
    part.work.mkdir(parents=True, exist_ok=True)
    began = time.time()
    bin_first = {**os.environ, "PATH": os.pathsep.join([str(Path(sys.executable).parent), os.environ.get("PATH", "")])}
    for command in part.commands:
        words = command.format(work=part.work.relative_to(ROOT))
        print(f"{part.name}: {words}", flush=True)
        code = subprocess.run(shlex.split(words), cwd=ROOT, env=bin_first, check=False).returncode
        if code:
            raise InputError(f"{part.name}: {words!r} ended with {code}; call `make results` again to go on there")
    tables = {RESULTS / f"{name}.csv": name for name in part.tables}
    old = [name for path, name in tables.items() if not path.is_file() or path.stat().st_mtime < began]
    if old:
        raise InputError(f"{part.name}: its commands don't write {', '.join(old)}; correct {PARTS.name}")
    origin = f"{version}, {date.today().isoformat()}, {processor_name()}, {os.cpu_count()} cores"
    origin += f": make results PART={part.name}"
    stamp = {part.work / "made": part.made_by(version)}
    write_files({**{path: stamped(path.read_text("utf-8"), origin) for path in tables}, **stamp})
    print(f"{part.name}: made in {(time.time() - began) / 60:.1f} minutes", flush=True)


def main(*names: str) -> None:
    """Make the parts of these names, or all, and then every figure that a page quotes."""
    parts = {part.name: part for part in read_parts(PARTS.read_text("utf-8"))}
    unknown = [name for name in names if name not in parts]
    if unknown:
        raise InputError(f"PART: {unknown[0]!r} is unknown; allowed: {', '.join(parts)}")
    asked = [parts[name] for name in names or parts]
    version = code_version()
    print(announcement(asked, version), flush=True)
    for part in asked:
        if not part.is_made(version):
            make(part, version)
            quote_everywhere()


if __name__ == "__main__":
    run(main, sys.argv[1:], True, "")
