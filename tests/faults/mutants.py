"""Mutants drawn by a seed from the code that numbers come from, and whether the tests of its package notice each.

python tests/faults/mutants.py --count 300    results are kept in out/mutants.json, so it can go on

Code and tests are the last commit's, and so is the seed, if none is given: its first eight digits. The operators are
cosmic-ray's (``pip install cosmic-ray``). A place in a file is drawn first, then what stands there instead; arithmetic
becomes other arithmetic, since bits of floats fail at once. A mutant that can't be imported counts for nothing: another
is drawn. The file's own tests run first, then the others of its package. Prints the survivors and a table.
"""

import argparse
import json
import random
import re
import subprocess
import tempfile
import time
from collections import Counter, defaultdict
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from cosmic_ray.commands import init
from cosmic_ray.mutating import use_mutation
from cosmic_ray.plugins import get_operator
from cosmic_ray.work_db import use_db
from cosmic_ray.work_item import MutationSpec
from plant_faults import MAKE_TEST, ROOT, run_tests

TESTS = {  # below tests/
    "sensor/readout.py": "sensor",
    "isp/interleaved/numpy_form.py": "isp",
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


def drawn(seed: int, copy: Path) -> Iterator[MutationSpec]:
    """All mutants in an order of the seed, no place twice."""
    places: dict[Any, list[MutationSpec]] = defaultdict(list)
    with use_db(copy / "mutants.sqlite") as base:
        init([copy / file for file in TESTS], base, {})
        for mutant in (item.mutations[0] for item in base.work_items):
            if not LEFT_OUT.fullmatch(mutant.operator_name):
                places[mutant.module_path, mutant.start_pos, mutant.end_pos].append(mutant)
    source = random.Random(seed)
    for place in source.sample(sorted(places), len(places)):
        yield source.choice(sorted(places[place], key=lambda mutant: (mutant.operator_name, mutant.occurrence)))


def tried(mutant: MutationSpec, file: str, copy: Path) -> dict[str, Any]:
    """What its package's tests make of a mutant, those of its own file first."""
    folder, start = copy / "tests" / TESTS[file], time.perf_counter()
    tests = [*map(str, folder.rglob(f"test_{mutant.module_path.stem}.py")), str(folder)]
    with use_mutation(mutant.module_path, get_operator(mutant.operator_name)(), mutant.occurrence):
        try:
            code, test = run_tests(copy, tests, MAKE_TEST)
        except subprocess.TimeoutExpired:
            code, test = 1, "::it never ends"
    result = "survived" if code == 0 else "caught" if code == 1 and "::" in test else "not importable"
    return {"file": file, "result": result, "by": test, "seconds": round(time.perf_counter() - start, 1)}


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
            file = str(mutant.module_path.relative_to(copy))
            key = (
                f"{file}:{mutant.start_pos[0]} column {mutant.start_pos[1]}: {mutant.operator_name} {mutant.occurrence}"
            )
            if key not in results:
                results[key] = tried(mutant, file, copy)
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
