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
from contextlib import suppress
from pathlib import Path
from typing import Any

from targets import TARGETS
from worker import input_files, keep, work

START = "spawn"  # a forked process would share locks of Dr.Jit's threads
HANGS_S = 60.0  # after which a child is ended
START_S = 240.0  # that a child may take to load its libraries and read the samples
NAMES = ("tried", "refused", "accepted", "findings")


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
    found, left_s = 0, asked.seconds
    while left_s > 0:
        made, left_s = _child(names, left_s, asked.seed, counts, asked.out)
        found += made
        asked.out.mkdir(parents=True, exist_ok=True)
        path.write_text(json.dumps(counts, indent=1), "utf-8")
    _print(counts)
    return 1 if found else 0


def _child(
    names: list[str], seconds: float, seed: int, counts: dict[str, dict[str, int]], out: Path
) -> tuple[int, float]:
    """Run one child to its end; gives the number of findings, and the seconds that are left."""
    shared, began = Path("/dev/shm"), time.monotonic()
    entries = {name: counts.setdefault(f"{name} {seed}", {**dict.fromkeys(NAMES, 0), "next": 0}) for name in names}
    with tempfile.TemporaryDirectory(dir=shared if shared.is_dir() else None, prefix="rodcone-fuzz-") as place:
        context = multiprocessing.get_context(START)
        messages, end = context.Pipe(duplex=False)
        first = {name: entry["next"] for name, entry in entries.items()}
        child = context.Process(target=work, args=(first, seconds, seed, end, out, Path(place)))
        child.start()
        end.close()
        name, found, hangs = "", 0, False
        with suppress(EOFError):  # the child's end
            while not hangs:
                hangs = not messages.poll(HANGS_S if name else START_S)
                if not hangs:
                    name, told = messages.recv()
                    found += _note(entries[name], told) if told else 0
        if hangs:
            child.kill()
        child.join()
    if child.exitcode == 0:
        return found, 0.0
    if not name:
        sys.exit("the child ended before its first input; see above")
    number = entries[name]["next"]  # which it died of
    words = "hangs" if hangs else f"died-{-(child.exitcode or 0)}"
    made = input_files(TARGETS[name], TARGETS[name].samples(), name, seed, number)
    keep(out / "findings" / f"{name}-{words}-{seed}-{number}", made, words)
    _note(entries[name], words)
    # the child's start counts too, so that a target that always dies comes to an end
    return found + 1, seconds - (time.monotonic() - began)


def _note(entry: dict[str, int], told: str) -> bool:
    """Count an input; whether it is a finding."""
    kind = told if told in ("refused", "accepted") else "findings"
    for name in ("tried", kind, "next"):
        entry[name] += 1
    return kind == "findings"


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
