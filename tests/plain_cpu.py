"""Pytest with NumPy held to its baseline instructions: ``python tests/plain_cpu.py [pytest's arguments]``.

NumPy picks loops by the processor that it finds and adds in their order, so a result in the last bits may hang on the
machine. Here each instruction set that it could pick is off, in this process and in all that it starts.
"""

import os
import sys
from pathlib import Path

import numpy._core._multiarray_umath as numpy_core
import pytest

SWITCH = "NPY_DISABLE_CPU_FEATURES"  # read when NumPy is imported; an instruction set that is absent may not be named


def main() -> int:
    """Start anew with all off, make sure that they are, and run pytest."""
    on = [name for name in numpy_core.__cpu_dispatch__ if numpy_core.__cpu_features__[name]]
    if on and SWITCH not in os.environ:
        os.execve(sys.executable, [sys.executable, *sys.argv], {**os.environ, SWITCH: " ".join(on)})
    if on:
        raise SystemExit(f"NumPy still has {', '.join(on)} on; {SWITCH} was {os.environ[SWITCH]!r} before: unset it")
    print(f"NumPy with its baseline alone; off: {os.environ.get(SWITCH) or 'nothing that was on'}", flush=True)
    os.chdir(Path(__file__).resolve().parents[1])
    return pytest.main()


if __name__ == "__main__":
    raise SystemExit(main())
