"""Write `contract_names.txt`: every name that README, docs and notebooks of the first contract's commit import.

    python tests/contract_names.py [COMMIT]

Whoever wrote a program after one of these pages finds the names where they stood. The list is committed, so that the
test needs no history of the repository.
"""

import json
import re
import subprocess
import sys
from pathlib import Path

COMMIT = "35f5fbe"
LIST = Path(__file__).with_name("contract_names.txt")
PACKAGES = ("rodcone", "render", "scenes", "sensor", "isp", "studies")
_IMPORT = re.compile(rf"\bfrom[ \t]+((?:{'|'.join(PACKAGES)})(?:\.\w+)*)[ \t]+import[ \t]+(\([^)]*\)|[^\n(;\"'`]+)")
# What the pages import and the contract leaves out.
LEFT_OUT = {
    ("isp.two_by_two", "picture_two_by_two"): "docs/how_to/own_processor.md writes this module itself",
    ("sensor.noise", "..."): "docs/decisions/0001 shows how an import is written; three dots are no name",
}


def imports(text: str) -> set[tuple[str, str]]:
    """Module and name of every import of the project's packages in a text, whether program, shell command or diff."""
    found = set()
    for module, names in _IMPORT.findall(text):
        for name in re.sub(r"#.*", "", names.strip("() \t")).split(","):
            if name.strip():
                found.add((module, name.split()[0]))
    return found


def text_of(name: str, content: bytes) -> str:
    """A page as it stands; of a notebook the programs and texts of its cells."""
    if name.endswith(".ipynb"):
        return "\n".join("".join(cell["source"]) for cell in json.loads(content)["cells"])
    return content.decode()


def names_of(commit: str) -> list[tuple[str, str]]:
    """The contract: module and name, sorted."""
    listed = _git("ls-tree", "-r", "--name-only", commit, "README.md", "docs").decode().split()
    pages = [name for name in listed if name.endswith((".md", ".ipynb", ".py"))]
    found = set().union(*(imports(text_of(name, _git("show", f"{commit}:{name}"))) for name in pages))
    return sorted(found - set(LEFT_OUT))


def _git(*arguments: str) -> bytes:
    return subprocess.run(["git", *arguments], cwd=LIST.parent.parent, capture_output=True, check=True).stdout


if __name__ == "__main__":
    commit = sys.argv[1] if len(sys.argv) > 1 else COMMIT
    LIST.write_text("".join(f"{module} {name}\n" for module, name in names_of(commit)), "utf-8")
