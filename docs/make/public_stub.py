"""Write `rodcone/__init__.pyi` from `rodcone/public.toml` and the functions' own signatures.

python docs/make/public_stub.py

A name or a path may stand in place of some values, because `rodcone.doors` finds the value by it: `WIDER` says which.
A function with such a parameter gets a line of its own in the stub; every other name is imported from its module.
"""

import ast
import subprocess
import sys
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
STUB = ROOT / "rodcone" / "__init__.pyi"
HEAD = '''"""Public names with their types, as docs/make/public_stub.py writes them."""

from pathlib import Path
from typing import TypeAlias

'''
ALIASES = """
__version__: str

_Sensor: TypeAlias = SensorConfig | str | Path
_Seconds: TypeAlias = float | str
_Light: TypeAlias = Spectrum | str
_Study: TypeAlias = Study | str | Path

"""
ALIASED = ("sensor.config:SensorConfig", "render.spectrum:Spectrum", "studies.study.study:Study")
# Parameter and type of it: what a caller may give.
WIDER = {
    ("sensor", "SensorConfig"): "_Sensor",
    ("light", "Spectrum"): "_Light",
    ("scene", "Scene"): "Scene | str",
    ("study", "Study"): "_Study",
    ("exposure_s", "float"): "_Seconds",
    ("flicker", "Waveform"): "Waveform | str",
    ("waveform", "Waveform"): "Waveform | str",
}
ARRAYS = ("NDArray", "Floats", "Image", "Plane", "Mosaic")  # types of arrays, of which a list is taken too


def public_names() -> dict[str, tuple[str, str]]:
    """Return each public name's module and its name there."""
    lines = tomllib.loads((ROOT / "rodcone" / "public.toml").read_text("utf-8"))
    return {name: (place.partition(":")[0], place.partition(":")[2]) for name, place in lines.items()}


def tree_of(module: str) -> ast.Module:
    """Return the syntax of a module of the packages."""
    return ast.parse((ROOT / (module.replace(".", "/") + ".py")).read_text("utf-8"))


def wider(parameter: str, annotation: str) -> str:
    """Return the type that a caller may give for a parameter of this name and type."""
    one, *none = annotation.split(" | None")
    if (parameter, one) in WIDER:
        return WIDER[parameter, one] + " | None" * len(none)
    parts = annotation.split(" | ")
    if not any(part.split("[")[0] in ARRAYS for part in parts):
        return annotation
    others = [part for part in parts if part.split("[")[0] not in (*ARRAYS, "Sequence")]
    return " | ".join([x for x in others if x != "None"] + ["ArrayLike"] + [x for x in others if x == "None"])


class _Plain(ast.NodeTransformer):
    """Leave an `Annotated` type's limits out."""

    def visit_Subscript(self, node: ast.Subscript) -> ast.expr:
        """Return the type that `Annotated` holds, or what stands there."""
        annotated = ast.unparse(node.value) == "Annotated" and isinstance(node.slice, ast.Tuple)
        return node.slice.elts[0] if annotated else node


def widened(function: ast.FunctionDef) -> bool:
    """Write into a function's signature what a caller may give; return whether that is more than the function says."""
    arguments, more = function.args, False
    for argument in [*arguments.posonlyargs, *arguments.args, *arguments.kwonlyargs, arguments.vararg, arguments.kwarg]:
        if argument is not None and argument.annotation is not None:
            said = ast.unparse(_Plain().visit(argument.annotation))
            given = wider(argument.arg, said)
            more |= given != said
            argument.annotation = ast.parse(given, mode="eval").body
    return more


def shortened(default: ast.expr | None) -> ast.expr | None:
    """Return a default as the stub shows it: a number or a text itself, and three dots for what a name stands for."""
    plain = default is None or isinstance(default, ast.Constant) or ast.unparse(default) == "()"
    return default if plain else ast.Constant(...)


def definition(name: str, function: ast.FunctionDef) -> str:
    """Return the line of the stub that states a function."""
    function.name, function.decorator_list, function.body = name, [], [ast.Expr(ast.Constant(...))]
    function.args.defaults = [x for x in map(shortened, function.args.defaults) if x is not None]
    function.args.kw_defaults = [shortened(x) for x in function.args.kw_defaults]
    return ast.unparse(ast.fix_missing_locations(function))


def imports_for(function: ast.FunctionDef, module: str, tree: ast.Module) -> set[str]:
    """Return the lines of import that a function's annotations need."""
    places = {
        alias.asname or alias.name: f"from {node.module} import {alias.name}"
        for node in tree.body
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }
    places |= {"np": "import numpy as np", "ArrayLike": "from numpy.typing import ArrayLike"}
    notes = [one.annotation for one in ast.walk(function) if isinstance(one, ast.arg)] + [function.returns]
    names = {one.id for note in notes if note for one in ast.walk(note) if isinstance(one, ast.Name)}
    built_in = {*dir(__builtins__), "float", "int", "str", "bool", "tuple", "list", "dict"}
    return {places.get(name, f"from {module} import {name}") for name in names - built_in if not name.startswith("_")}


def stub_text() -> str:
    """Return the whole stub, laid out as the project's code is."""
    names = public_names()
    imports = {f"from {module} import {name}" for module, _, name in (place.partition(":") for place in ALIASED)}
    definitions = []
    for public, (module, name) in names.items():
        tree = tree_of(module)
        found = [node for node in tree.body if isinstance(node, ast.FunctionDef) and node.name == name]
        if found and widened(found[0]):
            imports |= imports_for(found[0], module, tree)
            definitions.append((public, definition(public, found[0])))
        else:
            imports.add(f"from {module} import {name} as {public}")
    # A public class that a signature names is imported once, as what it is to the public.
    imports -= {line.partition(" as ")[0] for line in imports if line.split()[-1] == line.split()[-3]}
    listed = "__all__ = [" + "".join(f'"{name}",' for name in sorted(names)) + "]\n"
    text = HEAD + "\n".join(sorted(imports)) + "\n\n" + listed + ALIASES
    text += "\n".join(line for _, line in sorted(definitions)) + "\n"
    for command in (["check", "--quiet", "--select", "I", "--fix"], ["format"]):
        ruff = [sys.executable, "-m", "ruff", *command, "--stdin-filename", str(STUB), "-"]
        text = subprocess.run(ruff, input=text, capture_output=True, text=True, check=True, cwd=ROOT).stdout
    return text


if __name__ == "__main__":
    STUB.write_text(stub_text(), "utf-8")
