"""Where a cell's numbers come from: the render's variant, engines and versions. Cells that differ are not averaged."""

import json
import platform
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from functools import cache
from importlib import metadata
from pathlib import Path

from isp.processors.catalogue import libraries
from rodcone.digests import digest, digest_file
from rodcone.errors import InputError
from rodcone.jit import backend, compiler_version, dr
from studies.sweep.row import Row

ROOT = Path(__file__).resolve().parents[2]
_WHOLE = ("rodcone", "render", "scenes", "sensor", "isp")  # packages of which everything decides a picture
# Modules of `studies` which, with what they import, make frames and run cells. The others only ask, store and show.
_DECIDING = ("studies.sweep.run_cell", "studies.sweep.frames")
_CODE = (".py", ".toml", ".csv", ".json", ".npz")  # code, and the tables and priors that it reads
# Imports of modules of `studies` at the beginning of a line, searched in the text because a syntax tree takes twenty
# times as long. A line of a docstring that looks like an import names no module, or one module too many.
_IMPORTS = re.compile(
    r"^[ \t]*(?:from[ \t]+(studies[\w.]*)[ \t]+import[ \t]*(\([^)]*\)|[^\n]*)|import[ \t]+(studies[\w.]*))",
    re.MULTILINE,
)


def code_version(root: Path = ROOT, names: Sequence[str] = _DECIDING) -> str:
    """Return rodcone's version and a hash of the sources that decide a picture.

    `names` are the modules of `studies` whose sources count, together with those of the modules that they import.
    """
    files = [path for name in _WHOLE for path in (root / name).rglob("*") if path.suffix in _CODE]
    files += deciding_modules(root, names)
    contents = {path.relative_to(root).as_posix(): digest_file(path) for path in files}
    return f"{metadata.version('rodcone')}+{digest(contents)[:12]}"


def deciding_modules(root: Path = ROOT, names: Sequence[str] = _DECIDING) -> list[Path]:
    """Return the files of the named modules of `studies`, and of all modules of `studies` that these import.

    The default names are those of the modules that decide a picture.
    """
    paths = set[Path]()
    waiting = list(names)
    while waiting:
        name = waiting.pop()
        path = root.joinpath(*name.split(".")).with_suffix(".py")
        if not path.is_file() or path in paths:  # a package decides nothing, and some names are functions
            continue
        paths.add(path)
        for module, names_within, whole in _IMPORTS.findall(path.read_text("utf-8")):
            waiting += [whole or module, *(f"{module}.{name}" for name in re.findall(r"\w+", names_within))]
    return sorted(paths)


_PACKAGES = ("mitsuba", "drjit", "numpy", "scipy", "scikit-image", "colour-science")


@dataclass(frozen=True)
class Provenance:
    """Variant, engines and versions that make a cell.

    Attributes
    ----------
    variant : str
        Variant of Mitsuba that rendered the scene; ``none`` for a picture file.
    readout_engine, development_engine : str
        ``cuda``, ``llvm`` or ``numpy``.
    versions : str
        Versions of rodcone with its sources, of the packages that compute and of LLVM, as JSON.
    """

    variant: str
    readout_engine: str
    development_engine: str
    versions: str


def provenance(
    variant: str, processor: str, on_backend: bool, user_versions: Mapping[str, str], exact: bool
) -> Provenance:
    """Return the provenance of a cell that is made in this process; `exact` is as in `studies.study.model.ImageModel`.

    `user_versions` holds the version of a user's own processor (`isp.processors.own.own_version`), which doesn't cover
    modules that the processor's file imports.
    """
    return Provenance(
        variant=variant,
        readout_engine="numpy" if exact else backend(),
        development_engine=backend() if on_backend else "numpy",
        versions=json.dumps({**versions(processor), **user_versions}, sort_keys=True),
    )


@cache
def versions(processor: str | None = None) -> dict[str, str]:
    """Return the versions of rodcone, of all packages that compute, of the backend and of a processor's libraries."""
    names = (*_PACKAGES, *(libraries(processor) if processor else ()))
    result = {"rodcone": _own_code(), **{name: metadata.version(name) for name in names}, "llvm": "none"}
    if backend() != "numpy":
        result[backend()] = compiler_version()
    return result


@cache
def _own_code() -> str:
    """Return `code_version`, computed once per process."""
    return code_version()


def threads() -> int:
    """Return the number of threads that Dr.Jit's kernels use in this process."""
    return int(dr.thread_count()) if backend() == "llvm" else 1


def in_words(made_by: Provenance) -> dict[str, str]:
    """Return the variant, engines and versions, each under a name for a reader."""
    return {
        "Mitsuba variant": made_by.variant,
        "engine of captures": made_by.readout_engine,
        "engine of development": made_by.development_engine,
        **json.loads(made_by.versions),
    }


def require_same(stated: Provenance, processor: str, on_backend: bool, user_versions: Mapping[str, str]) -> None:
    """Raise `InputError` if this process has other code, versions or engines than `stated`, those of a cell's sweep.

    The other parameters are as in `provenance`.
    """
    exact = stated.readout_engine == "numpy"
    local = in_words(provenance(stated.variant, processor, on_backend, user_versions, exact))
    for name, version in in_words(stated).items():
        if local.get(name) != version:
            raise InputError(
                f"worker on {platform.node()}: its {name} is {local.get(name)}, the sweep's is {version}; allowed: the "
                "same; install the same rodcone with the same packages and start the worker again"
            )


def made_by(row: Row) -> Provenance:
    """Return the provenance of a row."""
    return Provenance(**{field.name: getattr(row, field.name) for field in fields(Provenance)})


def require_alike(rows: Sequence[Row]) -> None:
    """Raise `InputError` if rows were made by different versions, variants or engines, so that no mean is allowed.

    All rows must have the same version of each package, those of a scene the same variant, those of a condition the
    same engine of captures, and those of a processor the same engine of development.
    """
    values: dict[tuple[object, ...], str] = {}
    for row in rows:
        of = {
            "Mitsuba variant": (row.scene,),
            "engine of captures": (row.scene, row.spectrum, row.level, row.exposure, row.sensor),
            "engine of development": (row.processor,),
        }
        for name, value in in_words(made_by(row)).items():
            first = values.setdefault((name, *of.get(name, ())), value)
            if first != value:
                raise InputError(
                    f"cells: {name} {first} and {value} would be in one mean or comparison; allowed: one; run rodcone "
                    "sweep again, which makes them anew"
                )
