"""What Python runs first where this folder is on PYTHONPATH: Dr.Jit gets the target and threads of `configurations.py`.

Tests start processes of their own, so the choice travels in the environment. Dr.Jit 1.5 lets a program choose LLVM's
target in C++ alone (`jit_llvm_set_target` of drjit-core/jit.h; `drjit.detail` has no more than `llvm_version`): it is
called by its mangled name as soon as Dr.Jit is imported.
"""

import ctypes
import importlib.util
import os
import sys
from importlib.abc import MetaPathFinder
from pathlib import Path

TARGET, THREADS = "ANY_CPU_LLVM_TARGET", "ANY_CPU_DRJIT_THREADS"
SET_TARGET, VECTOR_WIDTH = "_Z19jit_llvm_set_targetPKcS0_j", "_Z21jit_llvm_vector_widthv"


def drjit_core(drjit):
    return ctypes.CDLL(str(Path(drjit.__file__).with_name("libdrjit-core.so")))


def configure(drjit):
    if TARGET in os.environ:
        cpu, features, width = os.environ[TARGET].split(":")
        drjit_core(drjit)[SET_TARGET](cpu.encode(), features.encode() or None, ctypes.c_uint(int(width)))
    if THREADS in os.environ:
        drjit.set_thread_count(int(os.environ[THREADS]))


class Finder(MetaPathFinder):
    """Finds Dr.Jit as Python would, once, and configures it after its import."""

    def find_spec(self, name, path=None, target=None):
        if name != "drjit":
            return None
        sys.meta_path.remove(self)
        spec = importlib.util.find_spec(name)
        if spec is None or spec.loader is None:
            return spec
        run = spec.loader.exec_module

        def run_and_configure(module):
            run(module)
            configure(module)

        spec.loader.exec_module = run_and_configure
        return spec


if TARGET in os.environ or THREADS in os.environ:
    sys.meta_path.insert(0, Finder())
