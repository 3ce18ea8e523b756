"""What `rodcone doctor` tells: versions, the LLVM library, the backend, and whose packages Python finds.

Nothing of `render` is imported before its place is known: where another distribution's `render` shadows rodcone's,
the report says so instead of failing at an import.
"""

import os
import platform
from collections.abc import Callable
from dataclasses import dataclass
from importlib import metadata, util
from importlib.machinery import ModuleSpec
from pathlib import Path

PACKAGES = ("scenes", "render", "sensor", "isp", "studies")
NEEDED = ("mitsuba", "drjit", "numpy", "scipy", "colour-science", "OpenEXR", "scikit-image", "flip-evaluator")
LLVM_WHEEL = "karellen-llvm-core"
FALLBACK = (
    "numpy: neither CUDA nor LLVM answers, so stock path + specfilm renders in scalar_spectral, "
    "and capture and reconstruction run their NumPy forms"
)

ENGINE_UNASKED = "not asked: a package named below is not rodcone's own"

FindSpec = Callable[[str], ModuleSpec | None]


@dataclass(frozen=True)
class Row:
    """One line of the report; `ok` is False where rodcone can't work as it should."""

    name: str
    value: str
    ok: bool = True


@dataclass(frozen=True)
class Report:
    """All rows in the order in which they are printed."""

    rows: tuple[Row, ...]

    @property
    def ok(self) -> bool:
        """Whether no row is at fault; the command line exits with code 1 otherwise."""
        return all(row.ok for row in self.rows)


def installed_version(distribution: str) -> str | None:
    """Version of an installed distribution, None where it is absent."""
    try:
        return metadata.version(distribution)
    except metadata.PackageNotFoundError:
        return None


def distribution_row(name: str, *, needed: bool = True) -> Row:
    """Version of a distribution; its absence is a fault only where it is needed."""
    version = installed_version(name)
    return Row(name, version or "not installed", bool(version) or not needed)


def intruders(home: Path) -> dict[str, str]:
    """Other distributions that installed files into rodcone's own folders in `home`, by package name.

    Two wheels with one top-level name are merged into one folder, which no path can tell.
    """
    others = (item for item in metadata.distributions() if item.name.lower() != "rodcone")
    here = [item for item in others if Path(str(item.locate_file(""))).resolve() == home.resolve()]
    tops = {item.name: {file.parts[0] for file in item.files or []} for item in here}
    return {name: other for other, names in tops.items() for name in PACKAGES if name in names}


def package_row(name: str, home: Path, intruder: str | None = None, find_spec: FindSpec = util.find_spec) -> Row:
    """Tell whether the package `name` that Python finds lies in `home`, the folder that holds rodcone's packages."""
    label = f"package {name}"
    spec = find_spec(name)
    if spec is None:
        return Row(label, "not found; install rodcone again", False)
    places = [Path(place).resolve() for place in spec.submodule_search_locations or [spec.origin or "built in"]]
    fix = "install rodcone into an environment of its own"
    if places != [home.resolve() / name]:
        found = ", ".join(map(str, places))
        return Row(label, f"foreign, {found}; rodcone's lies in {home}: {fix}, or clear PYTHONPATH", False)
    if intruder:
        return Row(label, f"shared with {intruder} in {places[0]}: {fix}", False)
    return Row(label, f"rodcone's own, {places[0]}")


def package_rows(find_spec: FindSpec = util.find_spec) -> tuple[Row, ...]:
    """Look for each of rodcone's packages beside the `studies` that this module was imported from."""
    home = Path(__file__).resolve().parents[2]
    others = intruders(home)
    return tuple(package_row(name, home, others.get(name), find_spec) for name in PACKAGES)


def llvm_origin(library: Path) -> str:
    """Where the choice of the library came from, judged by where it lies."""
    try:
        wheel = [Path(str(file.locate())).resolve() for file in metadata.files(LLVM_WHEEL) or []]
    except metadata.PackageNotFoundError:
        wheel = []
    if library.resolve() in wheel:
        return f"from {LLVM_WHEEL}"
    return "from DRJIT_LIBLLVM_PATH" if wheel else "from the system or DRJIT_LIBLLVM_PATH"


def llvm_row(library: Path | None, version: int | None, oldest: int) -> Row:
    """Tell the LLVM library, and the fix where it can't serve."""
    if library is None:
        return Row("LLVM", f"none of version {oldest} or newer; pip install {LLVM_WHEEL} (Linux x86-64) brings one")
    fix = f"unset DRJIT_LIBLLVM_PATH or name a library of version {oldest} or newer"
    if not library.is_file():
        return Row("LLVM", f"{library} doesn't exist; {fix}", False)
    if version is not None and version < oldest:
        return Row("LLVM", f"{library} is version {version}; {fix}", False)
    told = f"version {version}" if version else "version not told by its name"
    return Row("LLVM", f"{library}, {told}, {llvm_origin(library)}")


def engine_rows() -> tuple[Row, ...]:
    """LLVM library, backend, variant and threads, as the render and the kernels use them."""
    try:
        from render.loader import integrator_name, variant
        from rodcone import jit, llvm
    except (ImportError, NameError) as error:  # Dr.Jit stumbles with a NameError over a failed import of its own
        cause = str(error.__context__ or error)
        fix = "; Debian: apt install libatomic1" if "libatomic" in cause else ""
        return (Row("engine", f"can't be imported: {cause}{fix}", False),)
    version = llvm.llvm_version(llvm.LIBLLVM) if llvm.LIBLLVM else None
    backend = jit.backend()
    return (
        llvm_row(llvm.LIBLLVM, version, llvm.OLDEST_LLVM),
        Row("backend", FALLBACK if backend == "numpy" else backend),
        Row("Mitsuba variant", variant()),
        Row("integrator", integrator_name()),
        Row("Dr.Jit threads", str(jit.dr.thread_count())),
    )


def machine_rows() -> tuple[Row, ...]:
    """Python, platform and the CPU threads that this process may use."""
    usable = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    return (
        Row("rodcone", installed_version("rodcone") or "not installed; run from its folder"),
        Row("Python", platform.python_version()),
        Row("platform", platform.platform()),
        Row("CPU threads", f"{usable} of {os.cpu_count()}"),
    )


def report() -> Report:
    """Collect every row. Where a package is foreign or missing, the engine isn't asked."""
    packages = package_rows()
    engine = engine_rows() if all(row.ok for row in packages) else (Row("engine", ENGINE_UNASKED, False),)
    versions = (*map(distribution_row, NEEDED), distribution_row(LLVM_WHEEL, needed=False))
    return Report((*machine_rows(), *engine, *versions, *packages))
