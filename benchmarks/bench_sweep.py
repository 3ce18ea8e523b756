"""What `rodcone sweep` costs beside its render and its captures and developments.

One scene, 9 levels, 3 exposures, 2 sensors, 2 processors, 3 seeds: 324 cells of 256x256. The command runs twice, on the
clock and in processor time of all its processes: for one cell, which makes the render, and for the rest. Beside the
rest stand the seconds that its rows state for capture and development; what is left is metrics, files, truth, start-up
of the workers, the ledger and the report. Run it on a quiet machine: another load counts against the sweep alone.

    python benchmarks/bench_sweep.py            (minutes)
    python benchmarks/bench_sweep.py --size 128 --spp 64
"""

import argparse
import csv
import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from environment import print_environment

STUDY = """
scenes = ["{scene}"]
levels = ["0.036cd/m2", "0.1cd/m2", "0.57cd/m2", "1.8cd/m2", "5.7cd/m2", "25cd/m2", "100cd/m2", "570cd/m2",
          "5700cd/m2"]
exposures = ["auto", "5ms", "20ms"]
sensors = ["low_noise", "table1_output"]
processors = ["interleaved", "bayer"]
seeds = [0, 1, 2]
render = {{ size = {size}, spp = {spp} }}
"""
ONE = ("levels=['25cd/m2']", "exposures=['20ms']", "sensors=['low_noise']", "processors=['bayer']", "seeds=[0]")


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--scene", default="still_life")
    options.add_argument("--size", type=int, default=256)
    options.add_argument("--spp", type=int, default=512)
    options.add_argument("--workers", type=int, default=os.cpu_count())
    given = options.parse_args()
    print_environment()
    with tempfile.TemporaryDirectory() as folder:
        study, out, table = (Path(folder) / name for name in ("study.toml", "out", "rows.csv"))
        study.write_text(STUDY.format(**vars(given)))
        sweep = ("sweep", str(study), "-o", str(out), "--as-stated", "--workers", str(given.workers))
        first = seconds_of_command(*sweep, *(word for change in ONE for word in ("--set", change)))
        rest = seconds_of_command(*sweep)
        seconds_of_command("export", str(out), "-o", str(table))
        rows = list(csv.DictReader(table.open()))
    bare_s = sum(float(row[step] or 0.0) for row in rows for step in ("capture_s", "develop_s"))
    cells = len(rows) - 1
    print(f"{cells + 1} cells, {given.size}x{given.size}, {given.spp} samples, {given.workers} workers")
    samples = given.size**2 * given.spp * 20  # bands
    each = f"{1e9 * first[0] / samples:.0f} ns a sample and band, processor {1e9 * first[1] / samples:.0f} ns"
    print(f"render and one cell         {first[0]:8.1f} s, processor {first[1]:8.1f} s: {each}")
    print(f"the other cells             {rest[0]:8.1f} s, processor {rest[1]:8.1f} s")
    print(f"a cell, start-up included   {1e3 * rest[0] / cells:8.0f} ms, processor {1e3 * rest[1] / cells:8.0f} ms")
    print(f"its capture and development {1e3 * bare_s / (cells + 1):8.0f} ms, as its row states")
    ratio = (first[0] + rest[0]) / (first[0] + bare_s / given.workers)
    print(f"whole over render, captures and developments: {ratio:.2f}")


def seconds_of_command(*words: str) -> tuple[float, float]:
    """Seconds of a rodcone command: on the clock, and of the processor in all of its processes."""
    wall, cpu = time.perf_counter(), _children_s()
    command = "from studies.commands.cli import main; raise SystemExit(main())"
    subprocess.run([sys.executable, "-c", command, *words], check=True, stdout=subprocess.DEVNULL)
    return time.perf_counter() - wall, _children_s() - cpu


def _children_s() -> float:
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


if __name__ == "__main__":
    main()
