"""The command `rodcone doctor`: versions, the LLVM library, the backend, and whose packages Python finds.

`render` isn't imported before its folder is known. If another distribution's package `render` hides rodcone's, the
report says so instead of failing at an import.
"""

import os
import platform
from dataclasses import dataclass
from importlib import metadata, util
from pathlib import Path

from rich.text import Text

from studies.commands.console import print_table

PACKAGES = ("scenes", "render", "sensor", "isp", "studies")
NEEDED = ("mitsuba", "drjit", "numpy", "scipy", "colour-science", "OpenEXR", "scikit-image")
# Extras that pip install 'rodcone[...]' brings for a user, with their purpose and distributions.
EXTRAS = {
    "explore": ("the explorer", ("starlette", "uvicorn", "websockets", "anywidget")),
    "opponents": ("Malvar's and Menon's demosaicking", ("colour-demosaicing",)),
    "bm3d": ("processors by BM3D, for non-commercial use", ("bm3d", "colour-demosaicing")),
    "denoise": ("denoised light", ("mitsuba-oidn",)),
    "photographs": ("raw files of real cameras", ("rawpy",)),
    "cluster": ("sweeps on several machines", ("dask", "distributed")),
}
LLVM_WHEEL = "karellen-llvm-core"
_ABSENT = "not installed"
FALLBACK = (
    "numpy: neither CUDA nor LLVM answers, so nothing is rendered, and capture and reconstruction run their NumPy forms"
)


@dataclass(frozen=True)
class Finding:
    """One line of the report; `ok` is False if rodcone can't work properly because of it."""

    name: str
    value: str
    ok: bool = True


def doctor() -> int:
    """Print versions, the LLVM library, the engine, the extras, whether rodcone's packages are its own, and a verdict.

    Exit code 1 where something is wrong.
    """
    report = findings()
    wrong = [finding.name for finding in report if not finding.ok]
    verdict = f"wrong: {', '.join(wrong)}; mend what stands beside" if wrong else "all is well"
    rows = [*report, Finding("verdict", verdict, not wrong)]
    print_table(
        ("", ""), [(finding.name, Text(finding.value, style="" if finding.ok else "red")) for finding in rows], words=2
    )
    return 1 if wrong else 0


def findings() -> tuple[Finding, ...]:
    """Collect all lines of the report. If a package is foreign or missing, the engine isn't imported."""
    usable = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    home = Path(__file__).resolve().parents[2]
    others = intruders(home)
    packages = [package_finding(name, home, others.get(name)) for name in PACKAGES]
    wrong = [finding for finding in packages if not finding.ok]
    beside = [finding for name in PACKAGES for finding in file_findings(name)]
    places = wrong or [Finding("packages", f"{', '.join(PACKAGES)}: rodcone's own, in {home}")]
    unknown = Finding("engine", "not imported: a package named below is not rodcone's own", False)
    return (
        distribution_finding("rodcone", needed=False),
        Finding("Python", platform.python_version()),
        Finding("platform", platform.platform()),
        Finding("CPU threads", f"{usable} of {os.cpu_count()}"),
        *([unknown] if wrong else engine_findings()),
        *map(distribution_finding, NEEDED),
        distribution_finding(LLVM_WHEEL, needed=False),
        *map(extra_finding, EXTRAS),
        *places,
        *beside,
    )


def file_findings(name: str) -> list[Finding]:
    """Report a file in the working directory that has the name of one of rodcone's packages.

    A script in this folder would import that file in place of the package.
    """
    path = Path.cwd() / f"{name}.py"
    words = f"{path} would stand in the place of rodcone's package {name} for every script beside it; rename it"
    return [Finding(f"file {path.name}", words, False)] if path.is_file() else []


def distribution_finding(name: str, *, needed: bool = True) -> Finding:
    """Report the version of a distribution; if it is absent, that is a fault only if it is `needed`."""
    try:
        return Finding(name, metadata.version(name))
    except metadata.PackageNotFoundError:
        return Finding(name, _ABSENT, not needed)


def extra_finding(name: str) -> Finding:
    """Report whether an extra is installed, and its purpose; its absence is no fault."""
    purpose, distributions = EXTRAS[name]
    installed = all(distribution_finding(finding, needed=False).value != _ABSENT for finding in distributions)
    state = "installed" if installed else f"not installed; pip install 'rodcone[{name}]'"
    return Finding(f"extra {name}", f"{purpose}: {state}")


def intruders(home: Path) -> dict[str, str]:
    """Find other distributions that installed files into rodcone's own folders in `home`; return them by package name.

    Wheels with the same top-level name are merged into one folder, so that a package's path doesn't show whose it is.
    """
    others = (item for item in metadata.distributions() if item.name.lower() != "rodcone")
    neighbours = [item for item in others if Path(str(item.locate_file(""))).resolve() == home.resolve()]
    tops = {item.name: {file.parts[0] for file in item.files or []} for item in neighbours}
    return {name: other for other, names in tops.items() for name in PACKAGES if name in names}


def package_finding(name: str, home: Path, intruder: str | None = None) -> Finding:
    """Check whether the package that Python finds lies in `home`, the folder that holds rodcone's packages."""
    label = f"package {name}"
    fix = "install rodcone into an environment of its own"
    spec = util.find_spec(name)
    if spec is None:
        return Finding(label, "not found; install rodcone again", False)
    places = [Path(place).resolve() for place in spec.submodule_search_locations or [spec.origin or "built in"]]
    if places != [home.resolve() / name]:
        paths = ", ".join(map(str, places))
        return Finding(label, f"foreign, {paths}; rodcone's lies in {home}: {fix}, or clear PYTHONPATH", False)
    if intruder:
        return Finding(label, f"shared with {intruder} in {places[0]}: {fix}", False)
    return Finding(label, f"rodcone's own, {places[0]}")


def llvm_finding(library: Path | None, version: int | None, oldest: int) -> Finding:
    """Report the path, version and origin of the LLVM library, or a remedy if it can't be used."""
    if library is None:
        return Finding("LLVM", f"none of version {oldest} or newer; pip install {LLVM_WHEEL} (Linux x86-64) brings one")
    fix = f"unset DRJIT_LIBLLVM_PATH or name a library of version {oldest} or newer"
    if not library.is_file():
        return Finding("LLVM", f"{library} doesn't exist; {fix}", False)
    if version is not None and version < oldest:
        return Finding("LLVM", f"{library} is version {version}; {fix}", False)
    try:
        wheel = [Path(str(file.locate())).resolve() for file in metadata.files(LLVM_WHEEL) or []]
    except metadata.PackageNotFoundError:
        wheel = []
    origin = "the system or DRJIT_LIBLLVM_PATH"
    if wheel:
        origin = LLVM_WHEEL if library.resolve() in wheel else "DRJIT_LIBLLVM_PATH"
    words = f"version {version}" if version else "version not in its name"
    return Finding("LLVM", f"{library}, {words}, from {origin}")


def engine_findings() -> list[Finding]:
    """Find which LLVM library, backend, Mitsuba variant and number of threads renders and kernels use here."""
    try:
        from render.loader import variant
        from rodcone import jit, llvm

        backend = jit.backend()
    except (ImportError, NameError) as error:  # Dr.Jit raises a NameError where an import of its own has failed
        cause = str(error.__context__ or error)
        fix = "; Debian: apt install libatomic1" if "libatomic" in cause else ""
        return [Finding("engine", f"can't be imported: {cause}{fix}", False)]
    version = llvm.llvm_version(llvm.LIBLLVM) if llvm.LIBLLVM else None
    return [
        llvm_finding(llvm.LIBLLVM, version, llvm.OLDEST_LLVM),
        Finding("backend", FALLBACK if backend == "numpy" else backend),
        Finding("Mitsuba variant", variant()),
        Finding("Dr.Jit threads", str(jit.dr.thread_count())),
    ]
