"""Rules of the code that no other tool holds; each failure says why the rule is there. See CONTRIBUTING.md."""

import ast
import re
import tomllib
from collections.abc import Iterator
from functools import cache
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PACKAGES = ("rodcone", "render", "scenes", "sensor", "isp", "studies")
MODULES = sorted(path for name in PACKAGES for path in (ROOT / name).rglob("*.py"))
SCRIPTS = sorted(path for name in ("tests", "benchmarks") for path in (ROOT / name).rglob("*.py"))
TEXTS = {".py", ".md", ".toml", ".yaml", ".yml", ".cff", ".html", ".j2", ".css", ".js", ".json", ".csv", ".txt", ""}

MOST_FUNCTION_LINES, MOST_WITHOUT_SECTIONS = 100, 50
MOST_MODULES_A_FOLDER = 20
ONE_A_THING = ("scenes", "studies/commands", "studies/paper")  # a scene, a command, a figure: as many as there are


def name_of(path: Path) -> str:
    return path.relative_to(ROOT).as_posix()


@cache
def nodes(path: Path) -> tuple[ast.AST, ...]:
    """Syntax of a file, node by node; the first is the module."""
    return tuple(ast.walk(ast.parse(path.read_text("utf-8"))))


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


def test_no_module_binds_a_packages_bare_name() -> None:
    suspect = re.compile(rf"^\s*import .*\b(?:{'|'.join(PACKAGES)})\b", re.MULTILINE)  # in code or in a text
    wrong = [
        f"{name_of(path)}:{node.lineno}"
        for path in [*MODULES, *SCRIPTS]
        if suspect.search(path.read_text("utf-8"))
        for node in nodes(path)
        if isinstance(node, ast.Import)
        for alias in node.names
        if alias.asname is None and alias.name.split(".")[0] in PACKAGES
    ]
    assert not wrong, (
        f"{wrong} bind a package's bare name, which a local variable such as `sensor` would shadow; "
        "write `from sensor.readout import ...`"
    )


def functions(path: Path) -> Iterator[ast.FunctionDef | ast.AsyncFunctionDef]:
    return (node for node in nodes(path) if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef))


def test_a_long_function_has_sections() -> None:
    for path in MODULES:
        lines = path.read_text("utf-8").splitlines()
        for node in functions(path):
            place, length, indent = f"{name_of(path)}: {node.name}", code_lines(node), " " * (node.col_offset + 4)
            assert length <= MOST_FUNCTION_LINES, f"{place} has {length} lines without its docstring"
            sections = [line for line in lines[node.lineno : node.end_lineno] if line.startswith(f"{indent}# ")]
            assert length <= MOST_WITHOUT_SECTIONS or len(sections) >= 2, (
                f"{place} has {length} lines; over {MOST_WITHOUT_SECTIONS} comments divide it into sections, so that "
                "a reader finds his place"
            )


def test_a_folder_can_be_taken_in_at_a_glance() -> None:
    folders = {path.parent for path in MODULES}
    counts = {
        name_of(folder): len([path for path in folder.glob("*.py") if path.stem != "__init__"]) for folder in folders
    }
    wrong = {name: count for name, count in counts.items() if count > MOST_MODULES_A_FOLDER and name not in ONE_A_THING}
    assert not wrong, f"{wrong}: more than {MOST_MODULES_A_FOLDER} modules; which of them belong together?"


def test_a_public_class_has_a_name_of_its_own() -> None:
    found: dict[str, list[str]] = {}
    for path in MODULES:
        for node in body_of(path):
            if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                found.setdefault(node.name, []).append(name_of(path))
    twice = {name: places for name, places in found.items() if len(places) > 1}
    assert not twice, f"{twice}: a reader who meets the name must know which it is"


def body_of(path: Path) -> list[ast.stmt]:
    module = nodes(path)[0]
    assert isinstance(module, ast.Module)
    return module.body


def test_a_package_defines_nothing() -> None:
    """Beside its docstring it re-exports names that written code imports; late where that would load too much."""
    allowed = (ast.ImportFrom, ast.Import, ast.Assign, ast.AnnAssign, ast.FunctionDef, ast.Expr)
    for path in (path for path in MODULES if path.name == "__init__.py"):
        body = body_of(path)
        assert [node for node in body if not isinstance(node, allowed)] == [], name_of(path)
        names = {node.name for node in body if isinstance(node, ast.FunctionDef)}
        assert names <= {"__getattr__", "__dir__"}, name_of(path)


def test_no_array_file_can_run_code() -> None:
    """NumPy unpickles what a file holds if `allow_pickle` says so, and pickles can call anything."""
    calls = [(path, node) for path in MODULES for node in nodes(path) if isinstance(node, ast.Call)]
    said = [(path, word.value) for path, call in calls for word in call.keywords if word.arg == "allow_pickle"]
    wrong = {name_of(path) for path, value in said if not (isinstance(value, ast.Constant) and value.value is False)}
    assert len(said) > 5
    assert not wrong, f"{wrong}: allow_pickle is for files of strangers too; leave it False"


def test_no_absolute_path_of_a_machine() -> None:
    absolute = re.compile(r"(?<![\w.:/>*-])(?:/(?:home|Users|root|work|opt|mnt|tmp)/|[A-Z]:\\Users)[\w.]")
    folders = [ROOT / name for name in (*PACKAGES, "tests", "benchmarks", "docs", ".ci")]
    files = [path for folder in folders for path in folder.rglob("*") if path.suffix in TEXTS and path.is_file()]
    files += [path for path in ROOT.iterdir() if path.suffix in TEXTS and path.is_file() and path.name != ".git"]
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


def test_the_tests_of_a_fresh_environment_are_there() -> None:
    (names,) = re.findall(r"SMOKE=\((.*?)\)", (ROOT / ".ci" / "fresh").read_text(), re.DOTALL)
    assert [name for name in names.split() if not (ROOT / "tests" / f"{name}.py").is_file()] == []
