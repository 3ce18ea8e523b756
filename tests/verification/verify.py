"""All that is too long for `make test`, part by part: ``python tests/verification/verify.py [--part NAME]``.

Slow tests (hard cases among them), every other test as on other processors, planted faults, damaged files and the
soak. What a part found is kept in out/verify.json beside the state of the code it was found with, so an
ended run goes on where it was; a part that fails is tried again the next time. Prints the table that
docs/verification.md holds.
"""

import argparse
import hashlib
import json
import re
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
CODE = ("rodcone", "render", "scenes", "sensor", "isp", "studies", "tests", "benchmarks")
RESULTS = ROOT / "out" / "verify.json"
FUZZED = ROOT / "out" / "fuzz" / "counts.json"
FUZZ_INPUTS, FUZZ_AT_ONCE_S = 1_000_000, 300  # to be tried in total; between two looks at the count
SOAK_CELLS = 2000
Found = tuple[bool, str]


def command(*words: str) -> tuple[int, str]:
    done = subprocess.run([sys.executable, *words], cwd=ROOT, capture_output=True, text=True, check=False)
    return done.returncode, done.stdout + (done.stderr if done.returncode else "")


def slow_files() -> list[str]:
    """Files with slow tests, in order."""
    code, said = command("-m", "pytest", "--collect-only", "-q", "-m", "slow")
    if code:
        raise SystemExit(said)
    return list(dict.fromkeys(line.split("::")[0] for line in said.splitlines() if "::" in line))


def slow_tests(file: str) -> Found:
    code, said = command("-m", "pytest", "-q", "-m", "slow", file)
    closing = [line for line in said.splitlines() if re.search(r"\d+ (passed|skipped|failed|error)", line)]
    return code == 0, closing[-1].strip("= ") if closing else said[-300:]


def faults() -> Found:
    code, said = command("tests/faults/plant_faults.py")
    survivors = [line.split("  ")[0] for line in said.splitlines() if line.startswith("SURVIVED")]
    return code == 0, "; ".join([said.strip().splitlines()[-1], *survivors])


def tried() -> dict[str, int]:
    """Sums over the fuzzer's targets and seeds so far."""
    rows = json.loads(FUZZED.read_text()).values() if FUZZED.exists() else ()
    return {name: sum(row[name] for row in rows) for name in ("tried", "refused", "accepted", "findings")}


def any_cpu() -> Found:
    code, said = command("tests/any_cpu/configurations.py", "-q", "-n", "auto", "-m", "not slow")
    rows = (re.split(r" *\| *", line) for line in said.splitlines() if line.startswith("| "))
    return code == 0, "; ".join(f"{row[1]}: {row[4]}" for row in rows if row[1] != "configuration")


def damaged_files() -> Found:
    before = tried()
    while tried()["tried"] < FUZZ_INPUTS:
        code, said = command("tests/fuzz/run.py", "--seconds", str(FUZZ_AT_ONCE_S))
        if code:
            return False, said[-300:]
    now = tried()
    words = "{tried} inputs tried, {refused} refused, {accepted} read, {findings} findings".format(**now)
    return now["findings"] == before["findings"], words


def soak() -> Found:
    code, said = command("tests/soak/soak.py", "--cells", str(SOAK_CELLS))
    return code == 0, said.strip().replace("\n", "; ")


def code_digest() -> str:
    files = [path for part in CODE for path in sorted((ROOT / part).rglob("*.py"))]
    return hashlib.sha256(b"".join(path.read_bytes() for path in files)).hexdigest()[:16]


def parts(wanted: str | None) -> list[tuple[str, Callable[[], Found]]]:
    """Steps by name; the slow tests a step a file."""
    alone = {"any CPU": any_cpu, "faults": faults, "damaged files": damaged_files, "soak": soak}
    if wanted in alone:
        return [(str(wanted), alone[str(wanted)])]
    if wanted not in (None, "slow tests"):
        raise SystemExit(f"--part: {wanted!r} is not allowed; give slow tests, {', '.join(alone)}")
    tests = [(f"slow tests: {file}", lambda file=file: slow_tests(file)) for file in slow_files()]
    return tests if wanted else [*tests, *alone.items()]


def main() -> int:
    """Run what isn't done with this code yet and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--part", metavar="NAME", help="one part alone, by its name in the table")
    steps, digest = parts(parser.parse_args().part), code_digest()
    known: dict[str, Any] = json.loads(RESULTS.read_text()) if RESULTS.exists() else {}
    for name, step in steps:
        if not (known.get(name, {}).get("kept") and known[name]["digest"] == digest):
            start = time.perf_counter()
            kept, words = step()
            minutes = (time.perf_counter() - start) / 60
            known[name] = {"kept": kept, "words": words, "minutes": round(minutes, 1), "digest": digest}
            RESULTS.parent.mkdir(parents=True, exist_ok=True)
            RESULTS.write_text(json.dumps(known, indent=1))
        print(f"{'kept  ' if known[name]['kept'] else 'FAILED'} {name}: {known[name]['words']}", flush=True)
    print("\n| part | kept | found | minutes |\n| --- | --- | --- | ---: |")
    for name, _ in steps:
        row = known[name]
        print(f"| {name} | {'yes' if row['kept'] else 'NO'} | {row['words']} | {row['minutes']} |")
    return int(not all(known[name]["kept"] for name, _ in steps))


if __name__ == "__main__":
    raise SystemExit(main())
