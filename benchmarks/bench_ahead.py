"""How busy a sweep's workers are, while the process that sweeps renders one scene after the other.

Ten scenes with a hundred cells each, on two processes or on two workers of dask. From the first row to the last one
counts, in shares of workers times time:

- rows: the seconds that the rows themselves state (capture, development, metrics, first calls),
- working: how often a worker was found at work or ready for it (states R and D of its threads), not waiting. On a
  machine with other loads that is the fairer count: a worker that others keep from the processor isn't idle.

    python benchmarks/bench_ahead.py
    python benchmarks/bench_ahead.py --dask
    python benchmarks/bench_ahead.py --scenes 3 --cells 20
"""

import argparse
import csv
import os
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from datetime import datetime
from pathlib import Path

from environment import print_environment

SCENES = (
    *("cornell_box", "color_checker", "dead_leaves", "flat_field", "metamers"),
    *("oecf", "siemens_star", "still_life", "lit_and_shadowed", "contrast_patches"),
)
STUDY = """
scenes = {scenes}
levels = ["0.1cd/m2", "1cd/m2"]
exposures = ["auto"]
processors = ["ple_bayer"]
seeds = {seeds}
render = {{ size = {size}, spp = {spp} }}
"""
COMMAND = "from studies.commands.cli import main; raise SystemExit(main())"


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--scenes", type=int, default=len(SCENES))
    options.add_argument("--cells", type=int, default=100, help="of each scene")
    options.add_argument("--size", type=int, default=64)
    options.add_argument("--spp", type=int, default=64)
    options.add_argument("--workers", type=int, default=2)
    options.add_argument("--dask", action="store_true")
    given = options.parse_args()
    print_environment()
    with tempfile.TemporaryDirectory() as name, ExitStack() as stack:
        folder = Path(name)
        study, out, table = folder / "study.toml", folder / "out", folder / "rows.csv"
        scenes = list(SCENES[: given.scenes])
        study.write_text(STUDY.format(scenes=scenes, seeds=given.cells // 2, size=given.size, spp=given.spp))
        who = ["--workers", str(given.workers)]
        parent = None
        if given.dask:
            address, parent = stack.enter_context(cluster(folder, given.workers))
            who = ["--cluster", address]
        began = time.time()
        sweep = [sys.executable, "-c", COMMAND, "sweep", str(study), "-o", str(out), "--as-stated", *who]
        with subprocess.Popen(sweep, stdout=subprocess.DEVNULL) as process:
            seen = list(watched(process, parent or process.pid))
        if process.returncode:
            raise SystemExit(process.returncode)
        ended = time.time()
        subprocess.run([sys.executable, "-c", COMMAND, "export", str(out), "-o", str(table)], check=True)
        rows = list(csv.DictReader(table.open()))
    told(rows, seen, given.workers, began, ended)


def told(
    rows: list[dict[str, str]], seen: list[tuple[float, int, float]], workers: int, began: float, ended: float
) -> None:
    finished = sorted(datetime.fromisoformat(row["finished"]).timestamp() for row in rows)
    own_s = [
        sum(float(row[name] or 0.0) for name in ("capture_s", "develop_s", "measure_s", "first_s")) for row in rows
    ]
    span_s = finished[-1] - finished[0]
    between = [sample for sample in seen if finished[0] <= sample[0] <= finished[-1]]
    working = sum(count for _, count, _ in between) / (workers * len(between))
    processor_s = between[-1][2] - between[0][2]
    print(f"{len(rows)} cells, {workers} workers: {ended - began:.1f} s, {span_s:.1f} s from the first row to the last")
    print(f"rows' own seconds      {sum(own_s) / (workers * span_s):6.1%}")
    print(f"working, by state      {working:6.1%} of {len(between)} looks")
    print(f"workers' processor time {processor_s:.1f} s, {processor_s / (workers * span_s):.1%} of workers times time")


def watched(process: "subprocess.Popen[bytes]", parent: int) -> Iterator[tuple[float, int, float]]:
    """Give time, how many workers work or could, and their processor seconds so far, until the sweep has ended."""
    ticks = os.sysconf("SC_CLK_TCK")
    while process.poll() is None:
        working, processor = 0, 0.0
        for pid in spawned(parent):
            with suppress(OSError):
                fields = [
                    path.read_text().rpartition(")")[2].split() for path in Path(f"/proc/{pid}/task").glob("*/stat")
                ]
                working += any(thread[0] in "RD" for thread in fields)
                processor += sum(int(thread[11]) + int(thread[12]) for thread in fields) / ticks
        yield time.time(), working, processor
        time.sleep(0.05)


def spawned(pid: int) -> list[int]:
    """Process numbers of a process's descendants that are workers."""
    found = list[int]()
    with suppress(OSError):
        of_threads = Path(f"/proc/{pid}/task").glob("*/children")  # dask's nannies start workers in a thread
        for child in [int(text) for path in of_threads for text in path.read_text().split()]:
            if "spawn_main" in Path(f"/proc/{child}/cmdline").read_text():
                found.append(child)
            found += spawned(child)
    return found


@contextmanager
def cluster(folder: Path, workers: int) -> Iterator[tuple[str, int]]:
    """Address of a scheduler on this machine, and the process whose children are its workers."""
    with socket.socket() as place:
        place.bind(("127.0.0.1", 0))
        port = place.getsockname()[1]
    address, here = f"tcp://127.0.0.1:{port}", ("--host", "127.0.0.1", "--no-dashboard")
    settings = Path(__file__).resolve().parents[1] / "studies" / "data" / "dask.yaml"
    environment = os.environ | {"DASK_CONFIG": str(settings), "PYTHONSAFEPATH": "1"}

    def start(*words: str) -> "subprocess.Popen[bytes]":
        command = [sys.executable, "-m", "dask", *words, *here]
        with (folder / f"{words[0]}.log").open("w") as log:
            return subprocess.Popen(command, stdout=log, stderr=log, env=environment, cwd=folder)

    processes = [start("scheduler", "--port", str(port))]
    try:
        while processes[0].poll() is None:
            with socket.socket() as place:
                if place.connect_ex(("127.0.0.1", port)) == 0:
                    break
            time.sleep(0.2)
        processes.append(start("worker", address, "--nworkers", str(workers), "--nthreads", "1"))
        yield address, processes[1].pid
    finally:
        for process in reversed(processes):
            process.terminate()
            process.wait()


if __name__ == "__main__":
    main()
