"""A long sweep on two workers, disturbed: random SIGKILLs, a disk that fills up, a disk that turns read-only.

    python tests/soak/soak.py --cells 2000 --seed 0

First the sweep runs alone, and its memory is watched; then it is killed, one worker or all of it, until it is done;
then it runs on a small file system of its own. Nothing may be lost, doubled or half-written, and each ledger must be
the first one's, row for row and picture for picture.
"""

import argparse
import os
import random
import shutil
import signal
import sqlite3
import subprocess
import sys
import tempfile
import time
from contextlib import closing, suppress
from dataclasses import dataclass
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import numpy as np
from sweep_sample import content, half_pictures, picture

from studies.sweep.database import FILE

HERE = Path(__file__).resolve().parent
CHILD = HERE / "sweep_child.py"
FULL_KIB, ROOMY_MIB = 600, 512  # a file system on which the ledger hardly fits, and one that holds it all
MOST_MB_PER_100 = 1.0
ENOUGH_CELLS = 500  # for a slope: below it the libraries' first allocations count for more


@dataclass(frozen=True)
class Memory:
    """Memory of the sweep's processes together against the cells done."""

    mb_per_100_cells: float
    last_mb: float
    samples: int


def start(out: Path, cells: int) -> subprocess.Popen[str]:
    command = [sys.executable, str(CHILD), str(out), str(cells)]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)


def workers_of(process: subprocess.Popen[str]) -> list[int]:
    """Process numbers of the living workers; the resource tracker is none."""
    with suppress(OSError):
        children = Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text().split()
        return [int(pid) for pid in children if "spawn_main" in Path(f"/proc/{pid}/cmdline").read_text()]
    return []


def rows_in(out: Path) -> int:
    """Cells that stand in the ledger; 0 before there is one."""
    if (out / FILE).exists():
        with (
            suppress(sqlite3.OperationalError),
            closing(sqlite3.connect(f"file:{out / FILE}?mode=ro", uri=True)) as base,
        ):
            return int(base.execute("SELECT count(*) FROM cells").fetchone()[0])
    return 0


def resident_mb(pids: list[int]) -> float:
    return (
        sum(int(Path(f"/proc/{pid}/statm").read_text().split()[1]) for pid in pids) * os.sysconf("SC_PAGE_SIZE") / 1e6
    )


def alone(out: Path, cells: int) -> Memory:
    """Sweep undisturbed; the slope is fitted to the last two thirds of the cells."""
    process, seen = start(out, cells), []
    while process.poll() is None:
        pids = [process.pid, *workers_of(process)]
        with suppress(OSError):  # one has just ended
            seen.append((len(pids), rows_in(out), resident_mb(pids)))
        time.sleep(0.1)
    _expect(process.returncode == 0, "undisturbed", process)
    count, done, mb = (np.array(column) for column in zip(*seen, strict=True))
    kept = (count == 3) & (done > cells / 3)
    slope = np.polyfit(done[kept], mb[kept], 1)[0] if kept.sum() > 10 else np.nan
    return Memory(float(100 * slope), float(mb[count == 3][-1]), int(kept.sum()))


def killed(out: Path, cells: int, rng: random.Random) -> tuple[int, int]:
    """Sweep under random kills until it is done; gives the kills of workers and of the whole."""
    of_workers = of_all = 0
    most = min(30, max(2, cells // 12))  # cells between two kills: by progress, so that any machine sees as many
    while True:
        process = start(out, cells)
        due = rows_in(out) + rng.randint(1, most)
        while process.poll() is None:
            time.sleep(rng.uniform(0.0, 0.05))  # anywhere within a cell
            if rows_in(out) < due:
                continue
            due = rows_in(out) + rng.randint(1, most)
            workers = workers_of(process)
            if rng.random() < 0.3:
                process.kill()
                of_all += 1
                process.wait()
            elif workers:
                with suppress(ProcessLookupError):
                    os.kill(rng.choice(workers), signal.SIGKILL)
                    of_workers += 1
        if process.returncode == 0:
            return of_workers, of_all
        _expect(process.returncode in (-signal.SIGKILL, 3), "killed", process)


def on_bad_disks(scene: Path, out: Path, cells: int) -> list[str]:
    """Sweep on a file system that is full, then read-only, then neither; gives what the sweep said each time."""
    script = f"""
        set -e
        mount -t tmpfs -o size={FULL_KIB}k none "$1"; cp "$2" "$1/scene.exr"
        "$3" "$4" "$1/out" {cells} || echo "exit $?"
        mount -o remount,ro "$1"
        "$3" "$4" "$1/out" {cells} || echo "exit $?"
        mount -o remount,rw,size={ROOMY_MIB}m "$1"
        "$3" "$4" "$1/out" {cells} || echo "exit $?"
        cp -r "$1/out" "$5"
    """
    with tempfile.TemporaryDirectory() as mount:
        command = ["unshare", "-rm", "bash", "-c", script, "-", mount, str(scene), sys.executable, str(CHILD), str(out)]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        raise SystemExit(f"on bad disks: {done.stdout}{done.stderr}")
    return done.stdout.splitlines()


def may_mount() -> bool:
    """Whether this machine lets a user mount a file system in a name space of his own."""
    if shutil.which("unshare") is None:
        return False
    command = ["unshare", "-rm", "mount", "-t", "tmpfs", "none", "/mnt"]
    return subprocess.run(command, capture_output=True, check=False).returncode == 0


def _expect(kept: bool, what: str, process: subprocess.Popen[str]) -> None:
    if not kept:
        raise SystemExit(f"{what}: the sweep ended with {process.returncode}: {process.stdout.read()}")


def compare(name: str, out: Path, first: Path, cells: int) -> None:
    """End the soak where a ledger isn't the undisturbed one's."""
    rows, wanted = content(out), content(first)
    if len(rows) != cells or len({row[0] for row in rows}) != cells:
        raise SystemExit(f"{name}: {len(rows)} rows, {len({row[0] for row in rows})} different, of {cells} cells")
    if rows != wanted:
        raise SystemExit(f"{name}: {sum(a != b for a, b in zip(rows, wanted, strict=True))} rows differ")
    if half_pictures(out):
        raise SystemExit(f"{name}: half-written {half_pictures(out)}")


def main() -> int:
    """Run the three phases and print what each survived."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cells", type=int, default=2000, help="a multiple of 4")
    parser.add_argument("--seed", type=int, default=0, help="of the kills")
    options = parser.parse_args()
    cells = options.cells // 4 * 4
    with tempfile.TemporaryDirectory(prefix="soak-") as name:
        folder = Path(name)
        picture(folder / "scene.exr")
        memory = alone(folder / "alone", cells)
        print(
            f"alone: {cells} cells; {memory.mb_per_100_cells:+.3f} MB per 100 cells over {memory.samples} samples, "
            f"{memory.last_mb:.0f} MB in three processes at the end",
            flush=True,
        )
        compare("alone", folder / "alone", folder / "alone", cells)
        if cells >= ENOUGH_CELLS and not memory.mb_per_100_cells < MOST_MB_PER_100:
            raise SystemExit(f"memory: {memory.mb_per_100_cells:.2f} MB per 100 cells; allowed: {MOST_MB_PER_100:g}")
        of_workers, of_all = killed(folder / "killed", cells, random.Random(options.seed))
        compare("killed", folder / "killed", folder / "alone", cells)
        print(
            f"killed: {of_workers} workers and {of_all} whole sweeps; nothing lost, doubled or half-written", flush=True
        )
        if may_mount():
            for line in on_bad_disks(folder / "scene.exr", folder / "disks", cells):
                print(f"bad disks: {line}")
            compare("bad disks", folder / "disks", folder / "alone", cells)
            print("bad disks: full, then read-only, then neither; nothing lost, doubled or half-written")
        else:
            print("bad disks: skipped, mounting in a name space of one's own isn't permitted here")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
