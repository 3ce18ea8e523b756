"""Feed changed files to every reader: ``python tests/fuzz/run.py --seconds 60 --seed 0 [--target exr]``.

The readers run in a child process, which may die, hang or run out of memory: each such input is a finding. Counts go
on from run to run in out/fuzz/counts.json; the files of each finding are kept beside it.
"""

import argparse
import json
import multiprocessing
import os
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from targets import TARGETS
from worker import ACCEPTED, COLUMNS, FINDINGS, NOW, REFUSED, TRIED, input_files, keep, work

START = "spawn"  # a forked process would share locks of Dr.Jit's threads
HANGS_S = 60.0  # after which a child is ended
START_S = 120.0  # that a child may take to load its libraries and read the samples
NAMES = {"tried": TRIED, "refused": REFUSED, "accepted": ACCEPTED, "findings": FINDINGS}


def main() -> int:
    """Run, print a table; 1 where there are findings in this run."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=60.0, help="for all targets together")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--target", action="append", choices=sorted(TARGETS), help="again for more; left out, all")
    parser.add_argument("--out", type=Path, default=Path("out/fuzz"))
    asked = parser.parse_args()
    names = asked.target or list(TARGETS)
    path = asked.out / "counts.json"
    counts: dict[str, dict[str, Any]] = json.loads(path.read_text("utf-8")) if path.is_file() else {}
    found = 0
    plan = [(name, asked.seconds / len(names)) for name in names]
    while plan:
        made, plan = _child(plan, asked.seed, counts, asked.out)
        found += made
        asked.out.mkdir(parents=True, exist_ok=True)
        path.write_text(json.dumps(counts, indent=1), "utf-8")
    _print(counts)
    return 1 if found else 0


def _child(plan: list[tuple[str, float]], seed: int, counts: dict[str, Any], out: Path) -> tuple[int, list[Any]]:
    """Run one child to its end; gives the number of findings, and what it left to be done."""
    shared = Path("/dev/shm")
    first = {
        name: counts.setdefault(f"{name} {seed}", {**dict.fromkeys(NAMES, 0), "next": 0})["next"] for name, _ in plan
    }
    with tempfile.TemporaryDirectory(dir=shared if shared.is_dir() else None, prefix="rodcone-fuzz-") as place:
        context = multiprocessing.get_context(START)
        state = context.Array("q", COLUMNS * len(plan), lock=False)
        state[:] = [-1] * len(state)
        for row in range(len(plan)):
            state[COLUMNS * row + TRIED : COLUMNS * row + COLUMNS] = [0] * (COLUMNS - 1)
        steps = [(name, first[name], seconds) for name, seconds in plan]
        child = context.Process(target=work, args=(steps, seed, state, out, Path(place)))
        child.start()
        hung = _wait(child, state)
    found = _note(plan, seed, counts, state)
    rows = [row for row in range(len(plan)) if state[COLUMNS * row + NOW] >= 0]
    if child.exitcode == 0:
        return found, []
    if not rows:
        sys.exit("the child ended before its first input; see above")
    name, seconds = plan[rows[-1]]  # which it died of
    number = state[COLUMNS * rows[-1] + NOW]
    made = input_files(TARGETS[name], TARGETS[name].samples(), name, seed, number)
    words = "hangs" if hung else f"died-{-(child.exitcode or 0)}"
    keep(out / "findings" / f"{name}-{words}-{seed}-{number}", made, words)
    entry = counts[f"{name} {seed}"]
    entry.update(tried=entry["tried"] + 1, findings=entry["findings"] + 1, next=number + 1)
    left = (
        [(name, seconds / 2)] if seconds > 2.0 else []
    )  # half of it, so that a target that always dies comes to an end
    return found + 1, [*left, *plan[rows[-1] + 1 :]]


def _wait(child: Any, state: Any) -> bool:
    """Wait for a child's end; end it where it stays with one input, which is told."""
    seen, since, limit = list(state), time.monotonic(), START_S
    while child.is_alive():
        child.join(0.2)
        if list(state) != seen:
            seen, since, limit = list(state), time.monotonic(), HANGS_S
        elif time.monotonic() - since > limit:
            child.kill()
            child.join()
            return True
    return False


def _note(plan: list[tuple[str, float]], seed: int, counts: dict[str, Any], state: Any) -> int:
    found = 0
    for row, (name, _) in enumerate(plan):
        entry, place = counts[f"{name} {seed}"], COLUMNS * row
        for key, column in NAMES.items():
            entry[key] += state[place + column]
        if state[place + NOW] < -1:
            entry["next"] = -state[place + NOW] - 1
        found += state[place + FINDINGS]
    return found


def _print(counts: dict[str, Any]) -> None:
    line = "{:<16}{:>10}{:>10}{:>10}{:>10}".format
    print(line("target", *NAMES))
    totals = {name: dict.fromkeys(NAMES, 0) for name in TARGETS}
    for key, entry in counts.items():
        for name in NAMES:
            totals[key.split()[0]][name] += entry[name]
    for target, entry in totals.items():
        print(line(target, *entry.values()))
    print(line("all", *(sum(entry[name] for entry in totals.values()) for name in NAMES)))


if __name__ == "__main__":
    os.environ.setdefault("OMP_NUM_THREADS", "1")  # one input at a time: threads only cost
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    sys.exit(main())
