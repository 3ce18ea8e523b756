"""Environment of child processes: they import what this process does, and nothing of the working directory.

Python puts the working directory first on a child's path, where the folder of a downloaded scene may hold a numpy.py.
"""

import os
import sys

SAFE_PATH = {"PYTHONSAFEPATH": "1"}  # as python -P, for its own children too


def safe_environment(**more: str) -> dict[str, str]:
    """Variables of this process, its import path and `more`."""
    return {**os.environ, **SAFE_PATH, "PYTHONPATH": os.pathsep.join(filter(None, sys.path)), **more}
