"""Hook of the package's build (hatchling): the description is README.md, whose links lead to the repository.

An index shows the description without the repository around it. So each relative link becomes absolute, from the
`Repository` of pyproject.toml's [project.urls].
"""

import re
from pathlib import Path
from typing import Any

from hatchling.metadata.plugin.interface import MetadataHookInterface

LINK = re.compile(r"(!?)\[((?:[^\[\]]|!\[[^\]]*\]\([^)]*\))*)\]\((?!https?:|mailto:|#)([^)\s]+)\)")
QUOTE = re.compile(r"<!-- (?:=[\w.]+|/) -->")


class PackageReadme(MetadataHookInterface):
    """Give the package its description."""

    def update(self, metadata: dict[str, Any]) -> None:
        """Put the description into the package's metadata."""
        text = (Path(self.root) / "README.md").read_text("utf-8")
        text = with_absolute_links(text, metadata["urls"]["Repository"])
        metadata["readme"] = {"content-type": "text/markdown", "text": text}


def with_absolute_links(text: str, repository: str) -> str:
    """Return Markdown whose relative links lead to the repository's files, and its pictures to their raw form."""

    def absolute(link: re.Match[str]) -> str:
        kind = "raw" if link[1] else "blob"
        return f"{link[1]}[{LINK.sub(absolute, link[2])}]({repository}/{kind}/main/{link[3]})"

    return QUOTE.sub("", LINK.sub(absolute, text))
