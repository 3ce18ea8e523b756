"""Sweep so many small cells into a folder with two workers: what the soak disturbs. ``sweep_child.py FOLDER CELLS``."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from functools import partial

from sweep_sample import small_study, swept

from rodcone.errors import InputError
from studies.sweep.workers import run_in_processes

PER_SEED = 4  # two levels of two processors


def main() -> int:
    """Give 0 where all cells stand in the ledger, 3 where the sweep gave up with a message."""
    out, cells = Path(sys.argv[1]), int(sys.argv[2])
    study = small_study(out.parent, seeds=tuple(range(cells // PER_SEED)), processors=("bayer", "interleaved"))
    try:
        done = swept(study, out, partial(run_in_processes, workers=2))
    except (InputError, OSError) as error:
        print(f"{type(error).__name__}: {error}")
        return 3
    print(f"{done.cells} cells, {done.made} made, {done.seconds:.1f} s")
    return 0


if __name__ == "__main__":
    sys.exit(main())
