"""Mutants drawn by a seed from the code that numbers come from, and whether the nearest tests notice each.

python tests/faults/mutants.py --count 300 --seed 1    results are kept in out/mutants.json, so it can go on

The operators are cosmic-ray's (``pip install cosmic-ray``). A place in a file is drawn first, then what stands there
instead; arithmetic becomes other arithmetic, since bits of floats fail at once. Annotations are left alone, and a
mutant that can't be imported counts for nothing: another is drawn. Prints the survivors and a table.
"""

import argparse
import ast
import difflib
import importlib
import json
import multiprocessing
import os
import random
import re
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
from cosmic_ray.ast import Visitor, get_ast
from cosmic_ray.mutating import mutate_code
from cosmic_ray.operators.provider import OperatorProvider
from plant_faults import ALL, MINUTES, ROOT, copy_project

TESTS = {  # below tests/, the likeliest first
    "sensor/readout.py": [
        *(
            "sensor/test_readout",
            "sensor/test_readout_variance",
            "sensor/test_readout_crosstalk",
            "sensor/test_capture",
        ),
        *("studies/photograph/test_snr", "sensor/test_photodiodes", "sensor/readings/test_noise"),
    ],
    "isp/reference.py": ["isp/kernel/test_kernel", "isp/test_interleaved"],
    "render/transport.py": [
        *("render/test_transport", "render/test_error_estimates", "render/test_scene_range", "rodcone/test_notebook")
    ],
    "render/meter.py": ["render/test_meter", "render/test_cache", "render/test_fallback"],
    "studies/pages/verdict.py": ["studies/pages/test_verdict", "studies/pages/test_headline"],
    "studies/pages/report_compare.py": [
        *("studies/pages/test_verdict", "studies/pages/test_headline", "studies/pages/test_report_sweep")
    ],
    "studies/photograph/snr.py": ["studies/photograph/test_snr"],
    "studies/sweep/database.py": [
        "studies/sweep/test_database",
        "studies/sweep/test_stored",
        "studies/sweep/test_export",
    ],
    "studies/sweep/stored.py": ["studies/sweep/test_database", "studies/sweep/test_stored"],
}
LEFT_OUT = re.compile(r".*_(RShift|LShift|BitOr|BitAnd|BitXor)_.*|.*_(RShift|LShift|BitOr|BitAnd|BitXor)")
# Loaded once; Dr.Jit and Mitsuba not, whose threads a fork would lose.
LIBRARIES = ("colour", "matplotlib.pyplot", "scipy.signal", "scipy.stats", "skimage.metrics", "tifffile")
NEEDS_ARGUMENTS = ("VariableInserter", "VariableReplacer")


@dataclass(frozen=True)
class Mutant:
    """A file with one change: its code, and the lines that changed."""

    file: str
    code: str
    change: str


class _Places(Visitor):
    """Counts, for each place in a file, the operators that change it."""

    def __init__(self, operators: dict[str, Any]) -> None:
        self.operators, self.counts = operators, Counter[str]()
        self.changes: dict[tuple[Any, Any], list[tuple[str, int]]] = {}

    def visit(self, node: Any) -> Any:
        for name, operator in self.operators.items():
            for place in operator.mutation_positions(node):
                self.changes.setdefault(place, []).append((name, self.counts[name]))
                self.counts[name] += 1
        return node


def drawn(seed: int) -> Iterator[Mutant]:
    """All mutants in an order of the seed, no place twice."""
    provider = OperatorProvider()
    names = [name for name in provider if name not in NEEDS_ARGUMENTS and not LEFT_OUT.fullmatch(name)]
    operators = {name: provider[name]() for name in sorted(names)}
    source = random.Random(seed)
    places = []
    for file in TESTS:
        found = _Places(operators)
        found.walk(get_ast((ROOT / file).read_text("utf-8")))
        places += [(file, changes) for changes in found.changes.values()]
    for file, changes in source.sample(places, len(places)):
        text = (ROOT / file).read_text("utf-8")
        name, number = source.choice(changes)
        code = mutate_code(text, operators[name], number)
        with suppress(SyntaxError):
            if without_annotations(code) != without_annotations(text):
                yield Mutant(file, code, difference(text, code))


def without_annotations(code: str) -> str:
    """Syntax of code that has no annotations."""
    tree = ast.parse(code)
    for node in ast.walk(tree):
        for name in ("annotation", "returns"):
            if getattr(node, name, None) is not None:
                setattr(node, name, ast.Constant(None))
    return ast.dump(tree)


def difference(text: str, code: str) -> str:
    lines = list(difflib.unified_diff(text.splitlines(), code.splitlines(), n=0, lineterm=""))[2:]
    return " ".join(re.sub(r"^@@ -(\d+).*", r"line \1:", line) for line in lines)


def tried(mutant: Mutant, copy: Path) -> dict[str, Any]:
    """What the nearest tests make of a mutant; the copy is as before afterwards."""
    file, text, start = copy / mutant.file, (copy / mutant.file).read_text("utf-8"), time.perf_counter()
    try:
        file.write_text(mutant.code, "utf-8")
        code, test = run_tests(copy, TESTS[mutant.file])
    finally:
        file.write_text(text, "utf-8")
    result = "survived" if code == 0 else "caught" if code == 1 and "::" in test else "not importable"
    return {"file": mutant.file, "result": result, "by": test, "seconds": round(time.perf_counter() - start, 1)}


def run_tests(copy: Path, tests: list[str], keep_bytecode: bool = False) -> tuple[int, str]:
    """Exit code of pytest at the first failure, and the test that failed; in a fork, which has the libraries loaded."""
    log = copy / "log"
    child = multiprocessing.get_context("fork").Process(target=_pytest, args=(copy, tests, log, keep_bytecode))
    child.start()
    child.join(60 * MINUTES)
    if child.is_alive():
        child.kill()
        return 1, "::it never ends"
    failed = re.search(r"^(?:FAILED|ERROR) (\S+)", log.read_text(), re.MULTILINE)
    return child.exitcode or 0, failed[1] if failed else log.read_text()[-400:]


def _pytest(copy: Path, tests: list[str], log: Path, keep_bytecode: bool) -> None:
    os.chdir(copy)
    os.environ["PYTHONPATH"] = str(copy)
    sys.path.insert(0, str(copy))
    sys.dont_write_bytecode = not keep_bytecode
    with log.open("w") as out:
        os.dup2(out.fileno(), 1)
        os.dup2(out.fileno(), 2)
    arguments = ["-x", "-q", "-m", ALL, "-p", "no:cacheprovider", *(f"tests/{test}.py" for test in tests)]
    os._exit(int(pytest.main(arguments)))


def main() -> int:
    """Draw, try, and print the survivors and a table by file."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=300)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--results", type=Path, metavar="FILE", default=ROOT / "out" / "mutants.json")
    options = parser.parse_args()
    known: dict[str, Any] = json.loads(options.results.read_text()) if options.results.exists() else {}
    counted: list[dict[str, Any]] = []
    with tempfile.TemporaryDirectory(prefix="mutants-") as folder:
        copy_project(Path(folder))
        for library in LIBRARIES:
            importlib.import_module(library)
        for file, tests in TESTS.items():
            if (code := run_tests(Path(folder), tests, keep_bytecode=True)[0]) != 0:
                raise SystemExit(f"{file}: its tests fail without a mutant, exit code {code}")
        for mutant in drawn(options.seed):
            key = f"{mutant.file} {mutant.change}"
            if key not in known:
                known[key] = tried(mutant, Path(folder))
                options.results.parent.mkdir(parents=True, exist_ok=True)
                options.results.write_text(json.dumps(known, indent=1))
            if known[key]["result"] != "not importable":
                counted.append(known[key])
            if known[key]["result"] == "survived":
                print(key, flush=True)
            if len(counted) == options.count:
                break
    print("\n| file | mutants | caught | survived |\n| --- | ---: | ---: | ---: |")
    for file in TESTS:
        results = Counter(mutant["result"] for mutant in counted if mutant["file"] == file)
        print(f"| {file} | {results.total()} | {results['caught']} | {results['survived']} |")
    results = Counter(mutant["result"] for mutant in counted)
    print(f"| together | {results.total()} | {results['caught']} | {results['survived']} |")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
