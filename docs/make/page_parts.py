"""Parts of a page that a program writes, between comments in the page's own text; full tables go beside it as CSV."""

import json
import re
import sys
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path

from rodcone.csv_file import csv_text as csv_of
from rodcone.errors import InputError
from rodcone.files import write_files
from studies.sweep.export import read_rows
from studies.sweep.row import Row

sys.path.append(str(Path(__file__).resolve().parents[2] / "benchmarks"))  # which pages may quote

Parts = tuple[dict[str, str], str, str]  # of a page, by name; its figure as SVG, empty for none; its table as CSV

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
    drawn = {page.with_suffix(".svg"): figure} if figure else {}
    write_files({page: fill(page.read_text("utf-8"), parts), **drawn, RESULTS / f"{page.stem}.csv": cells})


def write_swept(page: Path, parts: Callable[[Sequence[Row], str], Parts], folder: str) -> None:
    """Write the page of a sweep's folder; `parts` takes its rows, and the version of rodcone that made them."""
    rows = read_rows(folder)
    write_page(page, *parts(rows, json.loads(rows[0].versions)["rodcone"] if rows else ""))


def run(write: Callable[..., None], arguments: Sequence[str], allowed: bool, fix: str) -> None:
    """Call a program's function with the words of its command line; what isn't allowed ends it in one line."""
    try:
        if not allowed:
            raise InputError(f"arguments: {list(arguments)} are not allowed; {fix}")
        write(*arguments)
    except InputError as error:
        raise SystemExit(f"{Path(sys.argv[0]).stem}: {error}") from error
