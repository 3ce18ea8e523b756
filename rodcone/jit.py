"""Dr.Jit, with the LLVM library of `rodcone.llvm`. The only module that imports Dr.Jit."""

from functools import cache
from typing import Any, Literal

import drjit as dr  # the package's own import has run `rodcone.llvm` by now, which tells Dr.Jit where its LLVM is
import drjit.scalar

from rodcone.llvm import LIBLLVM

Backend = Literal["cuda", "llvm", "numpy"]

__all__ = ["Backend", "Matrix4", "arrays", "backend", "compiler_version", "dr"]

Matrix4 = dr.scalar.Matrix4f64  # a 4x4 transform as `mitsuba.load_dict` takes it in every variant


@cache
def backend() -> Backend:
    """Where kernels run: ``cuda`` where a device answers, else ``llvm``, else ``numpy``."""
    if dr.has_backend(dr.JitBackend.CUDA):
        return "cuda"
    return "llvm" if LIBLLVM and dr.has_backend(dr.JitBackend.LLVM) else "numpy"


def compiler_version() -> str:
    """Version of the LLVM or CUDA that kernels are compiled by, ``none`` on ``numpy``."""
    found = {"llvm": dr.detail.llvm_version, "cuda": dr.detail.cuda_version}.get(backend())
    return ".".join(map(str, found())) if found else "none"


def arrays() -> Any:
    """Module of Dr.Jit array types (`Float`, `UInt`, ...) of the backend; raises RuntimeError on ``numpy``."""
    name = backend()
    if name == "numpy":
        raise RuntimeError("Dr.Jit has neither LLVM nor CUDA here; see `rodcone doctor`")
    import drjit.cuda
    import drjit.llvm

    return drjit.cuda if name == "cuda" else drjit.llvm
