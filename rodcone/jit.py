"""Dr.Jit, with the LLVM library of `rodcone.llvm`. The only module that imports Dr.Jit.

The import happens when Dr.Jit is first needed, because it takes a quarter of a second and 60 MB. Neither `ple` nor
commands that read light from a file need Dr.Jit.
"""

import ctypes
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache, wraps
from importlib import import_module
from types import ModuleType
from typing import TYPE_CHECKING, Any, Literal, TypeAlias

from rodcone.llvm import LIBLLVM  # its import tells Dr.Jit where LLVM is

Backend = Literal["cuda", "llvm", "numpy"]
# Arrays of a kernel, one value per thread. Their classes depend on the backend, so that a type checker sees only `Any`;
# the names show a reader which class is meant.
Float: TypeAlias = Any  # single precision
Double: TypeAlias = Any
UInt: TypeAlias = Any
Int: TypeAlias = Any
Mask: TypeAlias = Any

__all__ = [
    "Backend",
    "Double",
    "Float",
    "Int",
    "Mask",
    "Matrix4",
    "UInt",
    "arrays",
    "at_least_two_threads",
    "backend",
    "compiler_version",
    "compiling",
    "dr",
    "release_memory",
    "syntax",
]


class _Deferred(ModuleType):
    """A module that is imported when one of its attributes is first used."""

    def __getattr__(self, name: str) -> Any:
        """Import the module and return its attribute of this name."""
        return getattr(import_module(self.__name__), name)


if TYPE_CHECKING:
    import drjit as dr
    from drjit.scalar import Matrix4f64 as Matrix4
else:
    dr = _Deferred("drjit")

    def __getattr__(name: str) -> Any:
        """Return `Matrix4`, a 4x4 transform as `mitsuba.load_dict` takes it in every variant."""
        if name == "Matrix4":
            return import_module("drjit.scalar").Matrix4f64
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def syntax(function: Callable[..., Any]) -> Callable[..., Any]:
    """Decorate a function as `drjit.syntax` does, once it is first called."""

    @cache
    def transformed() -> Callable[..., Any]:
        return dr.syntax(function)

    @wraps(function)
    def traced(*args: Any, **kwargs: Any) -> Any:
        return transformed()(*args, **kwargs)

    return traced


@cache
def backend() -> Backend:
    """Return where kernels run: ``cuda`` if a device answers, else ``llvm``, else ``numpy``."""
    if dr.has_backend(dr.JitBackend.CUDA):
        return "cuda"
    return "llvm" if LIBLLVM and dr.has_backend(dr.JitBackend.LLVM) else "numpy"


def compiler_version() -> str:
    """Return the version of LLVM or CUDA that compiles kernels; ``none`` on ``numpy``."""
    version = {"llvm": dr.detail.llvm_version, "cuda": dr.detail.cuda_version}.get(backend())
    return ".".join(map(str, version())) if version else "none"


@contextmanager
def compiling() -> Iterator[Callable[[], float]]:
    """Yield a function that returns the seconds of compiling so far: 0 if all kernels existed already."""
    seconds: float = 0.0

    def seconds_so_far() -> float:
        nonlocal seconds
        seconds += float(sum(kernel.get("backend_time", 0.0) for kernel in dr.kernel_history())) / 1e3
        return seconds

    with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
        dr.kernel_history_clear()
        yield seconds_so_far


def arrays() -> ModuleType:
    """Return the module of the backend's Dr.Jit array types (`Float`, `UInt`, ...); raise RuntimeError on ``numpy``."""
    name = backend()
    if name == "numpy":
        raise RuntimeError("Dr.Jit has neither LLVM nor CUDA here; see `rodcone doctor`")
    import drjit.cuda
    import drjit.llvm

    return drjit.cuda if name == "cuda" else drjit.llvm


@contextmanager
def at_least_two_threads() -> Iterator[None]:
    """Give Dr.Jit a second thread for a while: Mitsuba reads OpenEXR files in its threads.

    The thread that calls Mitsuba waits and doesn't read itself. With one thread, on a machine of one core, it would
    wait for ever.
    """
    count = dr.thread_count()
    dr.set_thread_count(max(2, count))
    try:
        yield
    finally:
        dr.set_thread_count(count)


def release_memory() -> None:
    """Return free memory of Dr.Jit and the C library to the system, after a render or after many small calls."""
    if backend() != "numpy":
        dr.flush_malloc_cache()
    if sys.platform == "linux" and hasattr(library := ctypes.CDLL(None), "malloc_trim"):  # glibc's
        library.malloc_trim(0)
