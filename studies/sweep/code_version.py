"""The version of the code that decides a picture: part of every cell's key."""

import ast
import threading
from importlib import metadata
from pathlib import Path

from rodcone.digests import digest, digest_file

ROOT = Path(__file__).resolve().parents[2]
_WHOLE = ("rodcone", "render", "scenes", "sensor", "isp")  # beside `studies`, all of them decide a picture
# Of `studies` what making a frame and running a cell import; the other modules only ask, store and show.
_DECIDING = ("studies.sweep.run_cell", "studies.sweep.frames")
_CODE = (".py", ".toml", ".csv")
_PARSING = threading.Lock()  # CPython 3.11 counts the depth of all threads' parsing as one, and fails


def code_version(root: Path = ROOT) -> str:
    """Version of rodcone, and the hash of the sources that decide a picture."""
    files = [path for name in _WHOLE for path in (root / name).rglob("*") if path.suffix in _CODE]
    files += deciding_modules(root)
    contents = {path.relative_to(root).as_posix(): digest_file(path) for path in files}
    return f"{metadata.version('rodcone')}+{digest(contents)[:12]}"


def deciding_modules(root: Path = ROOT) -> list[Path]:
    """Modules of `studies` that decide a picture: `_DECIDING`, and all that these import."""
    found, waiting = set[Path](), list(_DECIDING)
    while waiting:
        name = waiting.pop()
        path = root.joinpath(*name.split(".")).with_suffix(".py")
        if not path.is_file() or path in found:  # a package, which decides nothing, or a name within a module
            continue
        found.add(path)
        with _PARSING:
            tree = ast.parse(path.read_text("utf-8"))
        for node in ast.walk(tree):
            if isinstance(node, ast.ImportFrom) and node.module and node.module.split(".")[0] == "studies":
                waiting += [node.module, *(f"{node.module}.{alias.name}" for alias in node.names)]
            elif isinstance(node, ast.Import):
                waiting += [alias.name for alias in node.names if alias.name.split(".")[0] == "studies"]
    return sorted(found)
