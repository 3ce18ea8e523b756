"""Pytest as on other processors: ``python tests/any_cpu/configurations.py [--cpu NAME | --cpu by-date] [arguments]``.

BLAS, NumPy and LLVM pick their loops by the processor that they find and add in those loops' order, so last bits hang
on the machine. Each configuration holds one of them to what another processor would make it pick, in pytest and in all
that it starts, and makes sure of it before the tests. Prints configuration, tests, seconds and result.

Dr.Jit's LLVM needs AVX and FMA: for a target with SSE4.2 alone its kernels don't link ("a global offset table was
generated"), and on such a processor it shuts its LLVM down, where rodcone runs its NumPy forms
(`tests/render/test_fallback.py`). `llvm-fma` is the least that it compiles for: Nehalem's SSE4.2 with FMA.
"""

import argparse
import os
import re
import subprocess
import sys
import time
from collections import ChainMap
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path

import numpy._core._multiarray_umath as numpy_core

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
FOUND = {name for name, there in numpy_core.__cpu_features__.items() if there}
ABOVE_BASELINE = [name for name in numpy_core.__cpu_dispatch__ if name in FOUND]
PROBE = """
import numpy._core._multiarray_umath as core, threadpoolctl, sitecustomize
from rodcone.jit import backend, dr
import scipy.linalg
blas = [pool for pool in threadpoolctl.threadpool_info() if pool["user_api"] == "blas"]
print("BLAS:", *sorted({f"{pool.get('architecture')} {pool['num_threads']}" for pool in blas}))
print("NumPy:", *(name for name in core.__cpu_dispatch__ if core.__cpu_features__[name]))
if backend() == "llvm":
    print("Dr.Jit:", sitecustomize.drjit_core(dr)[sitecustomize.VECTOR_WIDTH](), "wide,", dr.thread_count())
"""


@dataclass(frozen=True)
class Configuration:
    """Variables that hold a library to a processor, what this one must have for it, and what `PROBE` then prints."""

    environment: dict[str, str]
    probe: str
    needs: set[str] = field(default_factory=set)  # by NumPy's names


def threads(count: int) -> dict[str, str]:
    return {"OPENBLAS_NUM_THREADS": str(count), "ANY_CPU_DRJIT_THREADS": str(count)}


def blas(kernel: str, *needs: str) -> Configuration:
    return Configuration({"OPENBLAS_CORETYPE": kernel}, rf"BLAS: {kernel} \d+\n", set(needs))


def llvm(target: str, *needs: str) -> Configuration:
    width = target.rpartition(":")[2]
    return Configuration({"ANY_CPU_LLVM_TARGET": target}, rf"Dr.Jit: {width} wide", set(needs))


CONFIGURATIONS = {
    "haswell": blas("Haswell", "AVX2", "FMA3"),
    # OpenBLAS's wheels give a Zen Haswell's kernels
    "zen": Configuration({"OPENBLAS_CORETYPE": "Zen"}, r"BLAS: (Zen|Haswell) \d+\n", {"AVX2", "FMA3"}),
    "skylakex": blas("SkylakeX", "AVX512_SKX"),
    "nehalem": blas("Nehalem", "SSE42"),
    "numpy-baseline": Configuration({"NPY_DISABLE_CPU_FEATURES": " ".join(ABOVE_BASELINE)}, r"NumPy:\n"),
    "one-thread": Configuration(threads(1), r"BLAS: \w+ 1\n(.*\n)+Dr.Jit: \d+ wide, 1\n"),
    "two-threads": Configuration(threads(2), r"BLAS: \w+ 2\n(.*\n)+Dr.Jit: \d+ wide, 2\n"),
    "llvm-avx2": llvm("x86-64-v3::8", "AVX2", "FMA3"),
    "llvm-fma": llvm("nehalem:+fma:4", "FMA3"),
}


def environment(*names: str) -> dict[str, str]:
    """Variables of this process, with these configurations in force."""
    path = os.pathsep.join(filter(None, (str(HERE), str(ROOT), os.environ.get("PYTHONPATH"))))
    held = [CONFIGURATIONS[name].environment for name in names]
    return dict(ChainMap(*held, {"PYTHONPATH": path}, dict(os.environ)))


def missing(configuration: Configuration) -> set[str]:
    """What the processor lacks for a configuration."""
    return configuration.needs - FOUND


def run(name: str, arguments: list[str]) -> tuple[bool, str]:
    """Pytest under one configuration: whether it passed, and its row of the table."""
    configuration = CONFIGURATIONS[name]
    if lacking := missing(configuration):
        return True, f"| {name} | | | not run: no {', '.join(sorted(lacking))} here |"
    variables = environment(name)
    probe = subprocess.run([sys.executable, "-c", PROBE], env=variables, capture_output=True, text=True, check=False)
    if not re.search(configuration.probe, probe.stdout):
        return False, f"| {name} | | | NOT IN FORCE: {(probe.stdout + probe.stderr).strip()!r} |"
    print(f"{name}: {'; '.join(probe.stdout.splitlines())}", flush=True)
    start, lines = time.perf_counter(), [""]
    command = [sys.executable, "-m", "pytest", *arguments]
    with subprocess.Popen(command, env=variables, cwd=ROOT, stdout=subprocess.PIPE, text=True) as process:
        for line in process.stdout or ():
            print(line, end="", flush=True)
            lines.append(line)
    closing = next((line for line in reversed(lines) if re.search(r" in [0-9.]+s", line)), lines[-1])
    counts = {word: int(count) for count, word in re.findall(r"(\d+) (passed|failed|skipped|error)", closing)}
    result = ", ".join(f"{count} {word}" for word, count in counts.items()) or closing.strip()
    passed = process.returncode == 0
    return passed, f"| {name} | {sum(counts.values())} | {time.perf_counter() - start:.0f} | {result} |"


def by_date() -> str:
    """One of those that this processor can run, another one each day."""
    names = [name for name, configuration in CONFIGURATIONS.items() if not missing(configuration)]
    return names[datetime.now(UTC).toordinal() % len(names)]


def main() -> int:
    """Run the configurations and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cpu", choices=[*CONFIGURATIONS, "by-date", "all"], default="all")
    chosen, arguments = parser.parse_known_args()
    names = list(CONFIGURATIONS) if chosen.cpu == "all" else [by_date() if chosen.cpu == "by-date" else chosen.cpu]
    done = [run(name, arguments) for name in names]
    print("", "| configuration | tests | seconds | result |", "|---|---|---|---|", *(row for _, row in done), sep="\n")
    return 0 if all(passed for passed, _ in done) else 1


if __name__ == "__main__":
    raise SystemExit(main())
