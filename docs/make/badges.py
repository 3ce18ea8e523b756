"""Write what pages take from pyproject.toml: `python docs/make/badges.py`.

These are the README's badges, which show without a network, the repository's address in the lines that show how to
install, and the version of CITATION.cff.
"""

import re
import tomllib
from collections.abc import Mapping
from html import escape
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
INSTALL = re.compile(r"git\+https?://\S+?\.git")
VERSION = re.compile(r"^version: .*$", re.MULTILINE)
IMAGES = ROOT / "docs" / "images"
LETTER, PAD, HEIGHT = 6.6, 6, 20  # pixels


def badges() -> dict[str, str]:
    """Return each badge's SVG, by the name of its file."""
    project: Mapping[str, str] = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
    oldest = project["requires-python"].removeprefix(">=")
    texts = {"version": project["version"], "licence": str(project["license"]), "python": f"{oldest} or newer"}
    return {f"badge_{name}.svg": svg(name.capitalize(), text) for name, text in texts.items()}


def addressed() -> dict[Path, str]:
    """Return the pages that show how to install, with the repository's address, and CITATION.cff with the version."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
    address = f"git+{project['urls']['Repository']}.git"
    pages = [ROOT / "README.md", ROOT / "docs" / "how_to" / "install.md", ROOT / "docs" / "index.md"]
    texts = {page: INSTALL.sub(address, page.read_text("utf-8")) for page in pages}
    citation = ROOT / "CITATION.cff"
    return texts | {citation: VERSION.sub(f"version: {project['version']}", citation.read_text("utf-8"))}


def svg(name: str, text: str) -> str:
    """Return a badge: a name on grey, its text on green."""
    left, right = (LETTER * len(word) + 2 * PAD for word in (name, text))
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{left + right:.0f}" height="{HEIGHT}" role="img" '
        f'font-family="Verdana, DejaVu Sans, sans-serif" font-size="11" fill="#fff" text-anchor="middle">'
        f"<title>{escape(name)}: {escape(text)}</title>"
        f'<rect width="{left:.0f}" height="{HEIGHT}" fill="#4a5259"/>'
        f'<rect x="{left:.0f}" width="{right:.0f}" height="{HEIGHT}" fill="#2b7a4b"/>'
        f'<text x="{left / 2:.0f}" y="14">{escape(name)}</text>'
        f'<text x="{left + right / 2:.0f}" y="14">{escape(text)}</text></svg>\n'
    )


if __name__ == "__main__":
    for file, content in badges().items():
        (IMAGES / file).write_text(content, "utf-8")
    for path, text in addressed().items():
        path.write_text(text, "utf-8")
