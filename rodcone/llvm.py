"""The LLVM library that Dr.Jit compiles with: chosen, and named to Dr.Jit, at `import rodcone`; Dr.Jit isn't imported.

Dr.Jit 1.5 refuses LLVM 14 and aborts the process with 15 and 16, so a library is judged by its file name and never
loaded to find out. Order: the user's own ``DRJIT_LIBLLVM_PATH``, the `karellen-llvm-core` wheel, the newest system
library of version 17 or more.
"""

import os
import re
import sys
import warnings
from collections.abc import Iterable
from glob import glob
from pathlib import Path

OLDEST_LLVM = 17  # 15 and 16 abort with "Cannot select: fmaximum" at the first kernel (measured with Dr.Jit 1.5)
_SYSTEM_DIRECTORIES = ("/usr/lib", "/usr/lib64", "/usr/local/lib", "/usr/lib/*64-linux-gnu", "/usr/lib/llvm-*/lib")
_LIBRARY_NAME = re.compile(r"libLLVM(?:-(\d+)\.so(?:\.\d+)*|\.so\.(\d+)(?:\.\d+)*)$")


def llvm_version(path: Path) -> int | None:
    """Return the major version of an LLVM library by its file name; None if the name doesn't state it."""
    match = _LIBRARY_NAME.match(path.name)
    return int(match[1] or match[2]) if match else None


def _newest(paths: Iterable[Path]) -> Path | None:
    versions = {path: llvm_version(path) or 0 for path in paths}
    return max((path for path in versions if versions[path] >= OLDEST_LLVM), key=versions.__getitem__, default=None)


def _wheel_library() -> Path | None:
    """Return the library of the wheel `karellen-llvm-core`; None if it isn't installed.

    Its list of files is read directly, because `importlib.metadata` takes as long as all the rest of `import rodcone`.
    """
    for folder in map(Path, sys.path):
        for record in sorted(folder.glob("karellen_llvm_core-*.dist-info/RECORD")):
            files = [folder / line.split(",")[0] for line in record.read_text("utf-8").splitlines()]
            return _newest(file.resolve() for file in files if llvm_version(file))
    return None


def _system_library() -> Path | None:
    files = (Path(file) for folder in _SYSTEM_DIRECTORIES for file in sorted(glob(f"{folder}/libLLVM*.so*")))
    return _newest(file for file in files if file.is_file())


def find_llvm() -> Path | None:
    """Return the LLVM library that Dr.Jit should use; None if there is none of version 17 or more."""
    stated_path = os.environ.get("DRJIT_LIBLLVM_PATH")
    return Path(stated_path) if stated_path else _wheel_library() or _system_library()


def _loaded_too_early() -> Path | None:
    """Return an LLVM library below 17 that an earlier `import drjit` has loaded, if any; it can't be replaced."""
    maps = Path("/proc/self/maps")
    if "drjit" not in sys.modules or not maps.is_file():
        return None
    paths = {Path(line.split()[-1]) for line in maps.read_text().splitlines() if "libLLVM" in line}
    return next((path for path in paths if (llvm_version(path) or OLDEST_LLVM) < OLDEST_LLVM), None)


LIBLLVM = find_llvm()
if _early := _loaded_too_early():
    warnings.warn(
        f"Dr.Jit was imported before rodcone and loaded {_early}, which aborts: nothing is rendered, reconstruction "
        f"runs its slow form; import rodcone first, or set DRJIT_LIBLLVM_PATH={LIBLLVM}",
        RuntimeWarning,
        stacklevel=3,  # the line that imports rodcone; level 2 is a line of rodcone's own
    )
    LIBLLVM = None
# Without a usable library Dr.Jit would search by itself, and might load one that aborts the process. Therefore it is
# then given the name of a file that doesn't exist.
os.environ["DRJIT_LIBLLVM_PATH"] = str(LIBLLVM) if LIBLLVM else "/nonexistent/libLLVM.so"
