"""Rules of the code that no other tool holds; each failure says why the rule is there. See CONTRIBUTING.md."""

import ast
import re
import tomllib
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
PACKAGES = ("render", "scenes", "sensor", "isp", "studies")
MODULES = sorted(path for name in PACKAGES for path in (ROOT / name).rglob("*.py"))
SCRIPTS = sorted(path for name in ("tests", "benchmarks") for path in (ROOT / name).rglob("*.py"))
TEXTS = {".py", ".md", ".toml", ".yaml", ".yml", ".cff", ".html", ".j2", ".css", ".js", ".json", ".csv", ".txt", ""}

MOST_MODULE_LINES = 300
MOST_FUNCTION_LINES = 100

# Who alone may import a library, and why.
SOLE_IMPORTERS = {
    "drjit": (
        {"render/jit.py"},
        "it sets DRJIT_LIBLLVM_PATH first, so that no import order loads an LLVM that aborts the process; "
        "write `from render.jit import dr`",
    ),
    "mitsuba": (
        {"render/engine.py", "render/loader.py"},
        "everything else works on plain arrays, and on one variant chosen in one place; call render.engine",
    ),
}


def name_of(path: Path) -> str:
    return path.relative_to(ROOT).as_posix()


def imports(source: str) -> Iterator[tuple[int, str]]:
    """Line and dotted name of every absolute import, also `importlib.import_module("name")` and `__import__`."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            yield from ((node.lineno, alias.name) for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.level == 0 and node.module:
            yield node.lineno, node.module
        elif isinstance(node, ast.Call) and node.args and isinstance(node.args[0], ast.Constant):
            called = getattr(node.func, "attr", getattr(node.func, "id", ""))
            if called in ("import_module", "__import__", "importorskip"):
                yield node.lineno, str(node.args[0].value)


def code_lines(function: ast.FunctionDef | ast.AsyncFunctionDef) -> int:
    """Lines from `def` to the last, less the docstring's: what it says about units shouldn't be kept short."""
    first = function.body[0]
    docstring = (
        isinstance(first, ast.Expr) and isinstance(first.value, ast.Constant) and isinstance(first.value.value, str)
    )
    told = (first.end_lineno or first.lineno) - first.lineno + 1 if docstring else 0
    return (function.end_lineno or function.lineno) - function.lineno + 1 - told


def test_the_walk_finds_every_package_that_is_shipped() -> None:
    shipped = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["tool"]["hatch"]["build"]["targets"]["wheel"]
    assert {Path(name_of(path)).parts[0] for path in MODULES} == set(shipped["packages"])
    assert Path(__file__).resolve() in SCRIPTS


@pytest.mark.parametrize(("library", "rule"), SOLE_IMPORTERS.items(), ids=SOLE_IMPORTERS.keys())
def test_only_one_place_imports(library: str, rule: tuple[set[str], str]) -> None:
    allowed, reason = rule
    wrong = [
        f"{name_of(path)}:{line}"
        for path in MODULES
        if name_of(path) not in allowed
        for line, name in imports(path.read_text("utf-8"))
        if name.split(".")[0] == library
    ]
    assert not wrong, f"{wrong} import {library}; only {sorted(allowed)} may: {reason}"


def test_no_module_binds_a_packages_bare_name() -> None:
    wrong = [
        f"{name_of(path)}:{node.lineno}"
        for path in [*MODULES, *SCRIPTS]
        for node in ast.walk(ast.parse(path.read_text("utf-8")))
        if isinstance(node, ast.Import)
        for alias in node.names
        if alias.asname is None and alias.name.split(".")[0] in PACKAGES
    ]
    assert not wrong, (
        f"{wrong} bind a package's bare name, which a local variable such as `sensor` would shadow; "
        "write `from sensor.noise import ...`"
    )


@pytest.mark.parametrize("path", MODULES, ids=name_of)
def test_modules_and_functions_are_small(path: Path) -> None:
    source = path.read_text("utf-8")
    lines = len(source.splitlines())
    assert lines <= MOST_MODULE_LINES, (
        f"{name_of(path)} has {lines} lines; split it at {MOST_MODULE_LINES}: a module should be read in one go"
    )
    long = [
        f"{node.name} ({code_lines(node)})"
        for node in ast.walk(ast.parse(source))
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef) and code_lines(node) > MOST_FUNCTION_LINES
    ]
    assert not long, (
        f"{name_of(path)}: {long} have more than {MOST_FUNCTION_LINES} lines without docstring; "
        "small pure functions can be tested against closed forms one by one"
    )


def test_no_absolute_path_of_a_machine() -> None:
    absolute = re.compile(r"(?<![\w.:/>*-])(?:/(?:home|Users|root|work|opt|mnt|tmp)/|[A-Z]:\\Users)[\w.]")
    folders = [ROOT / name for name in (*PACKAGES, "tests", "benchmarks", "docs", ".ci")]
    files = [path for folder in folders for path in folder.rglob("*") if path.suffix in TEXTS and path.is_file()]
    files += [path for path in ROOT.iterdir() if path.suffix in TEXTS and path.is_file()]
    wrong = [
        f"{name_of(path)}:{number}"
        for path in files
        for number, line in enumerate(path.read_text("utf-8", errors="replace").splitlines(), 1)
        if absolute.search(line)
    ]
    assert not wrong, f"{wrong} name a folder of one machine; take it relative to the project, or as an option"


def test_tests_are_no_package() -> None:
    wrong = [name_of(path) for path in (ROOT / "tests").rglob("__init__.py")]
    assert not wrong, f"{wrong}: with --import-mode=importlib a tests package only hides what a test imports"
