"""Camera simulation from spectral scene to developed picture: the public names of the chain.

A name is imported from its module when it is asked for, so that `import rodcone` takes no time and loads neither
Mitsuba nor Dr.Jit. It only chooses the LLVM library that Dr.Jit will load: import rodcone before `mitsuba` or `drjit`.
"""

from pathlib import Path as _Path
from typing import Any

from rodcone import llvm as _llvm  # noqa: F401  (run for its effect: it names the LLVM library to Dr.Jit)
from rodcone.doors import door, imported
from rodcone.doors import require_no_shadow as _require_no_shadow

_require_no_shadow()

# public.toml states the module and attribute of each public name. These texts are the only exception to the rule that
# imports run downwards (rodcone is the lowest package): import-linter sees no imports, because nothing is imported
# until a user asks. docs/make/public_stub.py writes `__init__.pyi`, the same names with their types, from this file and
# from the functions. No module of this package may have one of these names. The file is read when a user first asks for
# a name, which commands never do.


def __getattr__(name: str) -> Any:
    """Import a public name from its module: a class, or a function with the checks of `rodcone.doors` before it."""
    if name == "_PUBLIC":
        places = imported("tomllib").loads(_Path(__file__).with_name("public.toml").read_text("utf-8"))
        globals()[name] = {public: tuple(place.split(":")) for public, place in places.items()}
        return globals()[name]
    if name == "__all__":
        globals()[name] = sorted(__getattr__("_PUBLIC"))
        return globals()[name]
    if name == "__version__":
        globals()[name] = imported("importlib.metadata").version("rodcone")
        return globals()[name]
    public = __getattr__("_PUBLIC")
    if name not in public:
        raise AttributeError(f"module 'rodcone' has no attribute {name!r}")
    module, attribute = public[name]
    value = getattr(imported(module), attribute)
    globals()[name] = value if isinstance(value, type) else door(name, value)
    return globals()[name]


def __dir__() -> list[str]:
    """Return the names that an interpreter offers for completion."""
    return [*__getattr__("__all__"), "__version__"]
