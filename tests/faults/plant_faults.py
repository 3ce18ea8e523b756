"""Plant each fault of faults.toml in a copy of the project and show that a test fails.

python tests/faults/plant_faults.py                    all faults; results are kept in out/faults.json, so it can go on
python tests/faults/plant_faults.py --only "cos^3"     one of them
python tests/faults/plant_faults.py --draw 5           five, drawn by the date
python tests/faults/plant_faults.py --make-test        caught by the tests of `make test` alone?
"""

import argparse
import ast
import hashlib
import json
import os
import random
import re
import shutil
import subprocess
import sys
import tempfile
import time
import tomllib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from datetime import UTC, date, datetime
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
PARTS = ("rodcone", "render", "scenes", "sensor", "isp", "studies", "tests", "benchmarks", "docs/make")
PARTS += ("pyproject.toml",)
MINUTES = 8  # for one fault's tests
ALL, MAKE_TEST = "not slow", "not slow and not thorough"  # what `make test-all` and `make test` run


@dataclass(frozen=True)
class Fault:
    """One mistake that a person could make.

    Attributes
    ----------
    name : str
    file : str
        Below the repository's root.
    function : str
        The function of the file that it is in; empty for the whole file.
    edits : tuple of pairs of str
        Code that is there, and what the mistaken author wrote.
    tests : tuple of str
        Files of tests that should notice, the likeliest first.
    """

    name: str
    file: str
    function: str
    edits: tuple[tuple[str, str], ...]
    tests: tuple[str, ...]


def read_faults() -> Iterator[Fault]:
    """Faults of the catalogue beside this file."""
    for place, group in tomllib.loads(Path(__file__).with_name("faults.toml").read_text("utf-8")).items():
        file, _, function = place.partition("::")
        tests = tuple(f"tests/{test}.py" for test in group["tests"])
        for name, edits in group["faults"].items():
            yield Fault(name, file, function, tuple(zip(edits[::2], edits[1::2], strict=True)), tests)


FAULTS = tuple(read_faults())


def planted(fault: Fault, text: str) -> ast.Module:
    """Syntax of the file with the fault in it."""
    tree = ast.parse(text)
    scope = next((node for node in ast.walk(tree) if getattr(node, "name", None) == fault.function), tree)
    code = ast.unparse(scope)
    for there, instead in fault.edits:
        old = ast.unparse(ast.parse(f"_({there})"))[2:-1] if there.endswith(",") else ast.unparse(ast.parse(there))
        if code.count(old) != 1:
            raise SystemExit(f"{fault.name}: {there!r} stands {code.count(old)} times in {fault.file}; write it anew")
        code = code.replace(old, instead.rstrip(","))
    made = ast.parse(code)
    vars(scope).update(vars(made if scope is tree else made.body[0]))
    return ast.fix_missing_locations(tree)


def drawn(count: int, day: date) -> list[Fault]:
    """Some faults, the same all day long."""
    return random.Random(day.isoformat()).sample(FAULTS, count)


def copy_project(target: Path) -> None:
    """Copy what the tests read, without compiled files."""
    for part in PARTS:
        source = ROOT / part
        if source.is_dir():
            shutil.copytree(source, target / part, ignore=shutil.ignore_patterns("__pycache__"))
        else:
            shutil.copy2(source, target / part)


def run_tests(copy: Path, tests: Sequence[str], markers: str) -> tuple[int, str]:
    """Exit code of pytest at the first failure, and the test that failed."""
    environment = {**os.environ, "PYTHONPATH": str(copy), "PYTHONDONTWRITEBYTECODE": "1"}
    command = [sys.executable, "-m", "pytest", "-x", "-q", "-m", markers, "-p", "no:cacheprovider", *tests]
    done = subprocess.run(
        command, cwd=copy, env=environment, capture_output=True, text=True, timeout=60 * MINUTES, check=False
    )
    failed = re.search(r"^(?:FAILED|ERROR) (\S+)", done.stdout, re.MULTILINE)
    return done.returncode, failed[1] if failed else done.stdout[-400:]


def plant(fault: Fault, copy: Path, markers: str = ALL) -> dict[str, Any]:
    """Result of one fault; the copy is as before afterwards."""
    file = copy / fault.file
    text = file.read_text()
    start = time.perf_counter()
    try:
        file.write_text(ast.unparse(planted(fault, text)))
        code, test = run_tests(copy, fault.tests, markers)
    finally:
        file.write_text(text)
    # Exit code 1 alone means that tests ran and one failed; a fault that can't even be imported proves nothing.
    return {
        "caught": code == 1 and "::" in test,
        "by": test,
        "seconds": round(time.perf_counter() - start, 1),
        "digest": digest(fault),
        "finished": datetime.now(UTC).isoformat(timespec="seconds"),
    }


def digest(fault: Fault) -> str:
    """Changes with the fault, the project's code and the tests that should notice."""
    code = [path for part in PARTS[:6] for path in sorted((ROOT / part).rglob("*.py"))]
    shared = sorted((ROOT / "tests").glob("*.py"))  # conftest, which chooses the cases, and the helpers
    content = b"".join(path.read_bytes() for path in (*code, *shared, *(ROOT / test for test in fault.tests)))
    return hashlib.sha256(repr(fault).encode() + content).hexdigest()[:16]


def chosen(options: argparse.Namespace) -> list[Fault]:
    if options.draw:
        return drawn(options.draw, date.today())
    faults = [fault for fault in FAULTS if options.only in (None, fault.name)]
    if not faults:
        raise SystemExit(f"--only: {options.only!r} is no fault's name; see tests/faults/faults.toml")
    return faults


def main() -> int:
    """Plant, print a line a fault, and end with the count."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", metavar="NAME", help="one fault by its name")
    parser.add_argument("--draw", type=int, metavar="N", help="this many, drawn by the date")
    parser.add_argument("--make-test", action="store_true", help="with the tests of `make test` alone")
    parser.add_argument("--results", type=Path, metavar="FILE")
    options = parser.parse_args()
    markers = MAKE_TEST if options.make_test else ALL
    options.results = options.results or ROOT / "out" / f"faults{'-make-test' * options.make_test}.json"
    known: dict[str, Any] = json.loads(options.results.read_text()) if options.results.exists() else {}
    faults = chosen(options)
    with tempfile.TemporaryDirectory(prefix="faults-") as folder:
        copy = Path(folder)
        copy_project(copy)
        for fault in faults:
            if known.get(fault.name, {}).get("digest") != digest(fault):
                known[fault.name] = plant(fault, copy, markers)
                options.results.parent.mkdir(parents=True, exist_ok=True)
                options.results.write_text(json.dumps(known, indent=1))
            result = known[fault.name]
            word = "caught  " if result["caught"] else "SURVIVED"
            print(f"{word} {fault.name:48} {result['seconds']:6.1f} s  {result['by']}", flush=True)
    caught = sum(known[fault.name]["caught"] for fault in faults)
    print(f"{caught} of {len(faults)} faults caught")
    return int(caught < len(faults))


if __name__ == "__main__":
    raise SystemExit(main())
