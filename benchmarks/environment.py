"""What every benchmark prints first: the machine and the versions that its figures belong to."""

import os
import platform
from pathlib import Path

import numpy as np

from render.jit import LIBLLVM, backend, dr


def print_environment() -> None:
    """Print processor, cores, versions, engine and load."""
    processor = platform.processor() or platform.machine()
    cpuinfo = Path("/proc/cpuinfo")
    if cpuinfo.exists():
        names = [line.split(":", 1)[1].strip() for line in cpuinfo.read_text().splitlines() if "model name" in line]
        processor = names[0] if names else processor
    library = LIBLLVM.name if LIBLLVM else "none"
    print(f"{processor}, {os.cpu_count()} cores, {dr.thread_count()} threads; Python {platform.python_version()}")
    print(f"NumPy {np.__version__}, Dr.Jit {dr.__version__} on {backend()}, LLVM library {library}")
    if hasattr(os, "getloadavg"):
        print(f"load before the run: {os.getloadavg()[0]:.1f}")
