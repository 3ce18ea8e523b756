"""Mutants drawn by a seed from the code that numbers come from, and whether the tests of its package notice each.

python tests/faults/mutants.py --count 300    results are kept in out/mutants.json, so it can go on

Code and tests are the last commit's, and so is the seed, if none is given: its first eight digits. The operators are
cosmic-ray's (``pip install cosmic-ray``). A place in a file is drawn first, then what stands there instead; arithmetic
becomes other arithmetic, since bits of floats fail at once. Annotations are left alone, and a mutant that can't be
imported counts for nothing: another is drawn. The file's own tests run first, then the others of its package. Prints
the survivors and a table.
"""

import argparse
import ast
import difflib
import json
import random
import re
import subprocess
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from cosmic_ray.ast import Visitor, get_ast
from cosmic_ray.mutating import mutate_code
from cosmic_ray.operators.provider import OperatorProvider
from plant_faults import MAKE_TEST, ROOT, run_tests

TESTS = {  # below tests/
    "sensor/readout.py": "sensor",
    "isp/reference.py": "isp",
    "render/transport.py": "render",
    "render/meter.py": "render",
    "studies/pages/verdict.py": "studies/pages",
    "studies/pages/report_compare.py": "studies/pages",
    "studies/photograph/snr.py": "studies/photograph",
    "studies/sweep/database.py": "studies/sweep",
    "studies/sweep/stored.py": "studies/sweep",
    "docs/make/white_pixel.py": "docs/test_white_pixel.py",
}
LEFT_OUT = re.compile(r".*_(RShift|LShift|BitOr|BitAnd|BitXor)_.*|.*_(RShift|LShift|BitOr|BitAnd|BitXor)")
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


def drawn(seed: int, copy: Path) -> Iterator[Mutant]:
    """All mutants in an order of the seed, no place twice."""
    provider = OperatorProvider()
    names = [name for name in provider if name not in NEEDS_ARGUMENTS and not LEFT_OUT.fullmatch(name)]
    operators = {name: provider[name]() for name in sorted(names)}
    source = random.Random(seed)
    places = []
    for file in TESTS:
        found = _Places(operators)
        found.walk(get_ast((copy / file).read_text("utf-8")))
        places += [(file, changes) for changes in found.changes.values()]
    for file, changes in source.sample(places, len(places)):
        text = (copy / file).read_text("utf-8")
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
    """What its package's tests make of a mutant, those of its own file first."""
    file, text, start = copy / mutant.file, (copy / mutant.file).read_text("utf-8"), time.perf_counter()
    folder = copy / "tests" / TESTS[mutant.file]
    tests = [*map(str, folder.rglob(f"test_{file.stem}.py")), str(folder)]
    try:
        file.write_text(mutant.code, "utf-8")
        code, test = run_tests(copy, tests, MAKE_TEST)
    except subprocess.TimeoutExpired:
        code, test = 1, "::it never ends"
    finally:
        file.write_text(text, "utf-8")
    result = "survived" if code == 0 else "caught" if code == 1 and "::" in test else "not importable"
    return {"file": mutant.file, "result": result, "by": test, "seconds": round(time.perf_counter() - start, 1)}


def git(*words: str) -> bytes:
    return subprocess.check_output(["git", *words], cwd=ROOT)


def main() -> int:
    """Draw, try, and print the survivors and a table by file."""
    commit = git("rev-parse", "HEAD").decode().strip()
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=300)
    parser.add_argument("--seed", type=int, default=int(commit[:8], 16))
    parser.add_argument("--results", type=Path, metavar="FILE", default=ROOT / "out" / "mutants.json")
    options = parser.parse_args()
    options.results.parent.mkdir(parents=True, exist_ok=True)
    known: dict[str, Any] = json.loads(options.results.read_text()) if options.results.exists() else {}
    results = known.setdefault(commit, {})
    counted: list[dict[str, Any]] = []
    with tempfile.TemporaryDirectory(prefix="mutants-") as folder:
        copy = Path(folder)
        subprocess.run(["tar", "-x", "-C", folder], input=git("archive", commit), check=True)
        for mutant in drawn(options.seed, copy):
            key = f"{mutant.file} {mutant.change}"
            if key not in results:
                results[key] = tried(mutant, copy)
                options.results.write_text(json.dumps(known))
            if results[key]["result"] != "not importable":
                counted.append(results[key])
            if results[key]["result"] == "survived":
                print(key, flush=True)
            if len(counted) == options.count:
                break
    print(f"\ncommit {commit}, seed {options.seed}\n")
    print("| file | mutants | caught | survived |\n| --- | ---: | ---: | ---: |")
    for file in [*TESTS, "together"]:
        found = Counter(mutant["result"] for mutant in counted if file in (mutant["file"], "together"))
        print(f"| {file} | {found.total()} | {found['caught']} | {found['survived']} |")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
