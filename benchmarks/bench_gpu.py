"""What holds on a GPU, in one go: run it once on a machine with CUDA; it writes a page.

Run ``python benchmarks/bench_gpu.py``; the page is ``out/gpu.md``. `STAGES` are its parts, each in a process of its
own, so that one that fails is a line of the page and no end. Times are seconds on the clock of a first call and of a
second, 40 bands each where no number is told; LLVM is had on the same machine by hiding its devices. ``--on llvm``
rehearses it where there is no device, with ``--size``, ``--spp``, ``--most`` and ``--tests`` as small as one likes.
"""

import argparse
import json
import os
import subprocess
import sys
import time
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from environment import print_environment, seconds_of

from render import runs
from render.engine import render
from render.loader import mitsuba_module, variant
from render.transport import Transport
from rodcone.jit import arrays, backend, dr
from scenes.catalogue import load

SCENE = "still_life"
TESTS = ("tests", "tests/statistics/test_render_unbiased.py")
Rows = list[dict[str, object]]


def drawn(size: int, spp: int, bands: int = 40, resume: Transport | None = None) -> Transport:
    nm = 380.0 + 400.0 / bands * (np.arange(bands) + 0.5)
    return render(load(SCENE), (size, size), wavelength_nm=nm, spp=spp, resume=resume)


def timed(given: argparse.Namespace, bands: int = 40) -> Rows:
    """Seconds of the first call and of the second, and the allocator's peak."""
    dr.detail.malloc_clear_statistics()
    first, second = (seconds_of(lambda: drawn(given.size, given.spp, bands))[0] for _ in range(2))
    kind = dr.JitBackend.CUDA if backend() == "cuda" else dr.JitBackend.LLVM
    return [{"first": first, "second": second, "peak_mib": dr.detail.malloc_watermark(kind) / (1 << 20)}]


def tests(given: argparse.Namespace) -> Rows:
    rows: Rows = []
    for place in given.tests:
        began, mark = time.perf_counter(), "slow" if place == TESTS[1] else "not slow"
        command = [sys.executable, "-m", "pytest", "-q", "-m", mark, "--tb=no", "-p", "no:cacheprovider", place]
        lines = subprocess.run(command, capture_output=True, text=True, check=False).stdout.splitlines()
        failed = [line for line in lines if line.startswith(("FAILED", "ERROR"))]
        result = "; ".join([*lines[-1:], *failed])
        rows.append({"tests": place, "result": result, "seconds": time.perf_counter() - began})
    return rows


def resumed(given: argparse.Namespace) -> Rows:
    spp = max(given.spp, 128)
    parts, whole = drawn(given.size, 2 * spp, resume=drawn(given.size, spp)), drawn(given.size, 2 * spp)
    same = np.array_equal(parts.radiance, whole.radiance) and np.array_equal(parts.variance, whole.variance)
    return [{"samples": f"{spp}, then {2 * spp}", "same bits as in one go": same}]


def block_sums(given: argparse.Namespace) -> Rows:
    """Error of each block's sum over the sum of its values' sizes, in units of float32's rounding."""
    rng, rows, number = np.random.default_rng(0), [], arrays().Float
    for length in (1, 2, 3, 7, 33, 255, 1000, 4097):
        values = rng.normal(size=(999, length)).astype(np.float32)
        one, other = (dr.block_sum(number(values.ravel()), length).numpy() for _ in range(2))
        error = np.abs(one - values.sum(axis=1, dtype=np.float64)) / np.abs(values).sum(axis=1, dtype=np.float64)
        units = float(error.max() / np.finfo(np.float32).eps)
        rows.append({"length": length, "error, eps": units, "same bits twice": np.array_equal(one, other)})
    return rows


def first_compile(given: argparse.Namespace) -> Rows:
    """A process with no compiled kernels in its home, and a second one with those of the first."""
    with TemporaryDirectory() as home:
        return [{"kernels": name} | row for name in ("none", "from before") for row in child(given, "timed", HOME=home)]


def launches(given: argparse.Namespace) -> Rows:
    """Threads of a launch: `render.runs.MOST_FLOATS` over the channels of 40 bands and one group."""
    rows: Rows = []
    for power in range(19, given.most + 1):
        runs.MOST_FLOATS = (40 + 4) << power
        rows += [{"threads": f"2^{power}"} | row for row in timed(given)]
    return rows


def band_parts(given: argparse.Namespace) -> Rows:
    """Bands traced along one path, of 80."""
    rows: Rows = []
    for part in (10, 20, 40, 80):
        runs.PART_BANDS = part
        rows += [{"bands in a part": part} | row for row in timed(given, 80)]
    return rows


def beside_llvm(given: argparse.Namespace) -> Rows:
    made = {given.on: timed(given), "llvm, devices hidden": child(given, "timed", CUDA_VISIBLE_DEVICES="")}
    return [{"on": name} | row for name, rows in made.items() for row in rows]


STAGES = (block_sums, resumed, first_compile, launches, band_parts, beside_llvm, tests)


def child(given: argparse.Namespace, stage: str, **environment: str) -> Rows:
    """Rows of a stage from a process of its own; the last lines of one that failed."""
    terms = [f"--{name}={getattr(given, name)}" for name in ("size", "spp", "most")] + ["--tests", *given.tests]
    on = "llvm" if "CUDA_VISIBLE_DEVICES" in environment else given.on
    command = [sys.executable, __file__, "--stage", stage, "--on", on, *terms]
    done = subprocess.run(command, capture_output=True, text=True, env=os.environ | environment, check=False)
    if done.returncode:
        return [{"failed": " ".join(done.stderr.split())[-400:] or f"exit code {done.returncode}"}]
    return list(json.loads(done.stdout.splitlines()[-1]))


def table(rows: Rows) -> str:
    shown = [[f"{x:.3g}" if isinstance(x, float) else str(x) for x in row.values()] for row in rows]
    return "\n".join(f"| {' | '.join(cells)} |" for cells in (list(rows[0]), ["---"] * len(rows[0]), *shown))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--on", choices=("cuda", "llvm"), default="cuda")
    parser.add_argument("--size", type=int, default=512)
    parser.add_argument("--spp", type=int, default=64)
    parser.add_argument("--most", type=int, default=24, help="threads of the largest launch, as a power of two")
    parser.add_argument("--tests", nargs="+", default=list(TESTS))
    parser.add_argument("--out", type=Path, default=Path("out/gpu.md"))
    parser.add_argument("--stage", help="this one alone, as JSON")
    given = parser.parse_args()
    if backend() != given.on:
        sys.exit(f"on: {given.on!r}, and Dr.Jit runs on {backend()!r} here; give --on {backend()}")
    if given.stage:
        print(json.dumps(globals()[given.stage](given)))
        return
    print_environment()
    parts = [f"# On {given.on}\n\nMitsuba {mitsuba_module().__version__}, {variant()}; `{' '.join(sys.argv)}`"]
    for stage in STAGES:
        parts.append(f"## {stage.__name__.replace('_', ' ')}\n\n{table(child(given, stage.__name__))}")
        print(f"\n{parts[-1]}", flush=True)
    given.out.parent.mkdir(parents=True, exist_ok=True)
    given.out.write_text("\n\n".join(parts) + "\n", "utf-8")


if __name__ == "__main__":
    main()
