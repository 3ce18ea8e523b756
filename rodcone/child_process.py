"""Child processes: their environment, and their end with their parent's.

They import what this process does, and nothing of the working directory.

Python puts the working directory first on a child's path, where the folder of a downloaded scene may hold a numpy.py.
"""

import ctypes
import os
import signal
import sys

_PARENT_DEATH_SIGNAL = 1  # PR_SET_PDEATHSIG of prctl(2)
SAFE_PATH = {"PYTHONSAFEPATH": "1"}  # as python -P, for its own children too


def safe_environment(**more: str) -> dict[str, str]:
    """Return the environment for a child process: this process's variables and import path, and `more`."""
    return {**os.environ, **SAFE_PATH, "PYTHONPATH": os.pathsep.join(filter(None, sys.path)), **more}


def end_with_parent() -> None:
    """Have the system kill this process when its parent ends, however that ends; only Linux does so."""
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_PARENT_DEATH_SIGNAL, signal.SIGKILL)
