"""Parts of a page that a program writes, between comments in the page's own text; full tables go beside it as CSV."""

import re
from collections.abc import Mapping
from functools import partial
from pathlib import Path

from rodcone.csv_file import csv_text as csv_of

csv_text = partial(csv_of, line_end="\n")  # as git keeps the results' tables
RESULTS = Path(__file__).resolve().parents[1] / "results"


def fill(text: str, parts: Mapping[str, str]) -> str:
    """Return a page's text with new content between ``<!-- NAME -->`` and ``<!-- end -->`` of each part.

    Raises
    ------
    KeyError
        For a page that lacks one of them.
    """
    for name, content in parts.items():
        place = re.compile(rf"(<!-- {name} -->\n).*?(<!-- end -->)", re.DOTALL)
        text, count = place.subn(lambda part, new=content: f"{part[1]}\n{new}\n\n{part[2]}", text)
        if count != 1:
            raise KeyError(name)
    return text
