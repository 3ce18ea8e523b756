"""What a sweep costs beside its render and its bare captures and developments.

One scene, 9 levels, 3 exposures, 2 sensors, 2 processors, 3 seeds: 324 cells of 256x256, on one process a core. The
bound is twice (its render plus the bare sum of captures and developments over the workers); the rest is metrics, files,
truth, start-up of the workers and the ledger. The bare sum is timed with one thread in this process, on every ninth
cell, twice, the second one counted. Run it on a quiet machine: another load counts against the sweep alone.

    python benchmarks/bench_sweep.py            (minutes)
    python benchmarks/bench_sweep.py --size 128 --spp 64
"""

import argparse
import resource
import tempfile
import time
from functools import partial
from pathlib import Path

from environment import print_environment

from sensor.presets import preset
from studies.cell_run import run_cell
from studies.ledger import open_ledger
from studies.lit_scene import open_all
from studies.model import as_stated
from studies.prepare import Job, scene_cells
from studies.study import RenderLimits, SceneChoice, Study
from studies.sweep import sweep
from studies.workers import cores, run_in_processes

LEVELS = ("0.036cd/m2", "0.1cd/m2", "0.57cd/m2", "1.8cd/m2", "5.7cd/m2", "25cd/m2", "100cd/m2", "570cd/m2", "5700cd/m2")
EVERY = 9  # cell timed by itself


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--scene", default="still_life")
    options.add_argument("--size", type=int, default=256)
    options.add_argument("--spp", type=int, default=512)
    options.add_argument("--workers", type=int, default=cores())
    given = options.parse_args()
    print_environment()
    study = Study(
        (SceneChoice(given.scene),),
        LEVELS,
        exposures=("auto", "5ms", "20ms"),
        sensors=("low_noise", "table1_output"),
        seeds=(0, 1, 2),
        render=RenderLimits(size=given.size, spp=given.spp),
    )
    plan = as_stated(study, {name: preset(name).lens for name in study.sensors})
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder)
        began = time.perf_counter()
        swept = sweep(study, out, plan, partial(run_in_processes, workers=given.workers))
        wall_s = time.perf_counter() - began
        with open_ledger(out) as base:
            render_s = base.execute("SELECT sum(seconds) FROM renders").fetchone()[0]
            job = Job(study, plan, out, base)
            cells = [cell for opened in open_all(study).values() for cell in scene_cells(job, opened, lambda *_: None)]
        cpu_s = children_s()
        timed = [[run_cell(cell, 1) for cell in cells[::EVERY]] for _ in range(2)][1]
    one_s = sum(row.capture_s + row.develop_s for row in timed) / len(timed)
    bare_s = one_s * swept.cells / given.workers
    print(f"cells {swept.cells}, {given.size}x{given.size}, {given.spp} samples, {given.workers} workers")
    per_sample = 1e9 * render_s / _samples(given)
    print(f"render                               {render_s:8.1f} s   {per_sample:.0f} ns a sample and band")
    print(f"captures + developments / workers    {bare_s:8.1f} s   {one_s * 1e3:.1f} ms a cell")
    print(f"whole sweep                          {wall_s:8.1f} s")
    per_cell_ms = 1e3 * cpu_s / swept.cells
    print(f"processor time of the workers        {cpu_s:8.1f} s   {per_cell_ms:.1f} ms a cell, start-up included")
    print(f"ratio to their sum                   {wall_s / (render_s + bare_s):8.2f}     (bound: 2)")


def children_s() -> float:
    """Processor time of the workers that have ended: what another load on the machine doesn't change."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def _samples(given: argparse.Namespace) -> float:
    return float(given.size**2 * given.spp * 20)  # of 20 bands, one light group


if __name__ == "__main__":
    main()
