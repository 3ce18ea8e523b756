"""Parts of a page that a program writes, between comments in the page's own text; full tables go beside it as CSV."""

import re
from collections.abc import Mapping
from functools import partial
from pathlib import Path

from rodcone.csv_file import csv_text as csv_of
from rodcone.files import replacing

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


def write_page(page: Path, parts: Mapping[str, str], figure: str, cells: str) -> None:
    """Write a page's parts, its figure (SVG) beside it, and its table (CSV) of the same name, all or none."""
    with replacing(page, page.with_suffix(".svg"), RESULTS / f"{page.stem}.csv") as (to_page, to_figure, to_cells):
        to_page.write_text(fill(page.read_text("utf-8"), parts), "utf-8")
        to_figure.write_text(figure, "utf-8")
        to_cells.write_text(cells, "utf-8")
