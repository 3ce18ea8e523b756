"""Mutants drawn by a seed from the code that numbers come from, and whether the tests of its package notice each.

python tests/faults/mutants.py --count 300    results are kept in out/mutants.json, so it can go on

Code and tests are the last commit's, and so is the seed, if none is given: its first eight digits. The operators are
cosmic-ray's (``pip install cosmic-ray coverage``). A place in a file is drawn first, then what stands there instead;
arithmetic becomes other arithmetic, since bits of floats fail at once. Annotations are left alone, and a mutant that
can't be imported counts for nothing: another is drawn. A package's tests run once, line by line under coverage; of a
mutant only those that reach its lines run, the fastest first, and after them the rest of their files, which may share a
fixture with them. Prints the survivors and a table.
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
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
from cosmic_ray.ast import Visitor, get_ast
from cosmic_ray.mutating import mutate_code
from cosmic_ray.operators.provider import OperatorProvider
from coverage import Coverage
from plant_faults import MAKE_TEST, ROOT

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


class Reach:
    """Pytest's plugin: writes the tests that reach each line of some files, and the seconds of each that passes."""

    def __init__(self, files: list[str]) -> None:
        self.coverage, self.seconds = Coverage(data_file=None, include=files), dict[str, float]()
        self.coverage.start()

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> None:
        self.coverage.switch_context(item.nodeid)

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        if report.when == "call" and report.passed:
            self.seconds[report.nodeid] = report.duration

    def pytest_sessionfinish(self) -> None:
        self.coverage.stop()
        data = self.coverage.get_data()
        lines = {os.path.relpath(file): data.contexts_by_lineno(file) for file in data.measured_files()}
        Path("reach.json").write_text(json.dumps([self.seconds, lines]))


def reached(copy: Path, known: dict[str, Any]) -> dict[str, tuple[dict[str, float], dict[str, list[str]]]]:
    """Of each file: the seconds of its package's tests, and the tests that reach each line; kept in `known`."""
    result = {}
    for tests in dict.fromkeys(TESTS.values()):
        files = [file for file in TESTS if TESTS[file] == tests]
        kept = " ".join(git("rev-parse", *(f"HEAD:{path}" for path in (f"tests/{tests}", *files))).decode().split())
        if kept not in known:
            log = run_tests(copy, ["-q", "-m", MAKE_TEST, f"tests/{tests}"], 3600, files)[1]
            print(
                tests,
                *re.findall("^(?:FAILED|ERROR) .*", log, re.MULTILINE),
                log.splitlines()[-1],
                sep="\n",
                flush=True,
            )
            known[kept] = json.loads((copy / "reach.json").read_text())
        seconds, lines = known[kept]
        result |= {file: (seconds, lines.get(file, {})) for file in files}
    return result


def git(*words: str) -> bytes:
    return subprocess.check_output(["git", *words], cwd=ROOT)


def reaching(text: str, line: int, lines: dict[str, list[str]]) -> set[str]:
    """The tests that reach the statement at a line; of code that runs at import, all that reach the file."""
    nodes = (node for node in ast.walk(ast.parse(text)) if isinstance(node, ast.stmt))
    around = [node for node in nodes if node.lineno <= line <= (node.end_lineno or 0)]  # the outermost first
    in_function = any(isinstance(node, ast.FunctionDef) for node in around[:-1])
    numbers = map(str, range(around[-1].lineno, (around[-1].end_lineno or 0) + 1)) if in_function else lines
    return {test for number in numbers for test in lines.get(number, ())}


def tried(mutant: Mutant, copy: Path, seconds: dict[str, float], lines: dict[str, list[str]]) -> dict[str, Any]:
    """What its tests make of a mutant: those of one file after another, the quickest first, then the files' others."""
    file, text, start = copy / mutant.file, (copy / mutant.file).read_text("utf-8"), time.perf_counter()
    near = reaching(text, int(mutant.change.split()[1].rstrip(":")), lines) & seconds.keys()
    of_file = {test: test.partition("::")[0] for test in seconds}
    spent = Counter[str]()
    for test in near:
        spent[of_file[test]] += seconds[test]  # type: ignore[assignment]
    tests = sorted(
        (test for test in seconds if of_file[test] in spent),
        key=lambda test: (test not in near, spent[of_file[test]], of_file[test], seconds[test]),
    )
    try:
        file.write_text(mutant.code, "utf-8")
        most_s = 120 + 4 * sum(seconds[test] for test in tests)
        code, log = run_tests(copy, ["-x", "-q", *tests], most_s) if tests else (0, "not reached")
    finally:
        file.write_text(text, "utf-8")
    failed = re.search(r"^(?:FAILED|ERROR) (\S+)", log, re.MULTILINE)
    test = failed[1] if failed else log[-400:]
    result = "survived" if code == 0 else "caught" if code == 1 and "::" in test else "not importable"
    return {"file": mutant.file, "result": result, "by": test, "seconds": round(time.perf_counter() - start, 1)}


def run_tests(copy: Path, arguments: list[str], seconds: float, reach: Sequence[str] = ()) -> tuple[int, str]:
    """Exit code of pytest and what it printed; in a fork, which has the libraries loaded."""
    log = copy / "log"
    child = multiprocessing.get_context("fork").Process(target=_pytest, args=(copy, arguments, reach, log))
    child.start()
    child.join(seconds)
    if child.is_alive():
        child.kill()
        return 1, "FAILED ::it never ends"
    return child.exitcode or 0, log.read_text()


def _pytest(copy: Path, arguments: list[str], reach: Sequence[str], log: Path) -> None:
    os.chdir(copy)
    os.environ["PYTHONPATH"] = str(copy)
    sys.path.insert(0, str(copy))
    sys.dont_write_bytecode = not reach
    with log.open("w") as out:
        os.dup2(out.fileno(), 1)
        os.dup2(out.fileno(), 2)
    plugins = [Reach([str(copy / file) for file in reach])] if reach else []
    os._exit(int(pytest.main(["-p", "no:cacheprovider", *arguments], plugins=plugins)))


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
        for library in LIBRARIES:
            importlib.import_module(library)
        reach = reached(copy, known.setdefault("reach", {}))
        for mutant in drawn(options.seed, copy):
            key = f"{mutant.file} {mutant.change}"
            if key not in results:
                results[key] = tried(mutant, copy, *reach[mutant.file])
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
