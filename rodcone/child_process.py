"""Child processes: their environment, and how they end together with their parent.

Children import what this process can import, but nothing from the working directory. Python would put that directory
first on a child's path, and the folder of a downloaded scene may contain a numpy.py.
"""

import ctypes
import os
import signal
import sys

_PARENT_DEATH_SIGNAL = 1  # PR_SET_PDEATHSIG of prctl(2)
SAFE_PATH = {"PYTHONSAFEPATH": "1"}  # like `python -P`, but also for the child's own children


def safe_environment(**more: str) -> dict[str, str]:
    """Return the environment for a child process: this process's variables and import path, and `more`."""
    return {**os.environ, **SAFE_PATH, "PYTHONPATH": os.pathsep.join(filter(None, sys.path)), **more}


def end_with_parent() -> None:
    """Have the system kill this process when its parent ends, however that ends; only Linux does so."""
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_PARENT_DEATH_SIGNAL, signal.SIGKILL)
