"""What the programs that write pages share: parts of a page, tables beside it, and figures that sentences quote.

A part of a page stands between ``<!-- NAME -->`` and ``<!-- end -->``; the program that makes the page writes it. A
figure within a sentence stands between ``<!-- =NAME -->`` and ``<!-- / -->``. NAME is one of docs/results/quoted.csv or
a cell of a table there, ``TABLE[KEY=VALUE;KEY=VALUE].COLUMN``, with its interval where there is a column ``COLUMN ±``.
"""

import csv
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
ROOT = RESULTS.parents[1]
QUOTED = RESULTS / "quoted.csv"
QUOTE = re.compile(r"(<!-- =(?P<name>.+?) -->)(?P<text>.*?)(<!-- / -->)", re.DOTALL)
CELL = re.compile(r"(?P<table>\w+)\[(?P<keys>[^\]]*)\]\.(?P<column>.+)")
STAMP = "# "  # begins the line of a table that says where it comes from


def stamped(table: str, origin: str) -> str:
    """Return a CSV table with the line that says where it comes from, in place of an older one."""
    return f"{STAMP}{origin}\n{unstamped(table)}"


def unstamped(table: str) -> str:
    """Return a CSV table without the line that says where it comes from."""
    return table.partition("\n")[2] if table.startswith(STAMP) else table


def quoted_pages() -> list[Path]:
    """Return the pages that may quote: README and everything in docs."""
    return [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]


def read_quoted() -> dict[str, str]:
    """Return the figures that sentences may quote, by name."""
    if not QUOTED.is_file():
        return {}
    return {row["name"]: row["text"] for row in csv.DictReader(QUOTED.read_text("utf-8").splitlines())}


def with_quotes(text: str, figures: Mapping[str, str]) -> str:
    """Return a page's text with each quoted figure as it is now.

    Raises
    ------
    InputError
        For a figure that nothing makes.
    """

    def quote(place: re.Match[str]) -> str:
        name = place["name"]
        if at := CELL.fullmatch(name):
            return f"{place[1]}{cell_text(at['table'], at['keys'], at['column'])}{place[4]}"
        if name not in figures:
            raise InputError(f"{name}: no part of `make results` makes it; allowed: the names in {QUOTED.name}")
        return f"{place[1]}{figures[name]}{place[4]}"

    return QUOTE.sub(quote, text)


def cell_text(table: str, keys: str, column: str) -> str:
    """Return the text of one cell of a table of docs/results.

    Raises
    ------
    InputError
        Where there is no such table or column, or the keys are those of no row or of several.
    """
    path = RESULTS / f"{table}.csv"
    rows = list(csv.DictReader(unstamped(path.read_text("utf-8")).splitlines())) if path.is_file() else []
    wanted = dict(key.split("=", 1) for key in keys.split(";"))
    found = [row for row in rows if all(row.get(key) == value for key, value in wanted.items())]
    if len(found) != 1 or column not in found[0]:
        raise InputError(f"{table}[{keys}].{column}: {len(found)} rows; allowed: a column of one row of {path.name}")
    half = found[0].get(f"{column} ±", "")
    return f"{found[0][column]} ± {half}" if half else found[0][column]


def quote_everywhere() -> None:
    """Write the figures of quoted.csv into every page that quotes them."""
    figures = read_quoted()
    texts = {page: page.read_text("utf-8") for page in quoted_pages()}
    new = {page: with_quotes(text, figures) for page, text in texts.items()}
    write_files({page: text for page, text in new.items() if text != texts[page]})


def write_quoted(prefix: str, figures: Mapping[str, str]) -> None:
    """Write a part's figures, by name after the prefix and a point, in place of those that it had."""
    kept = {name: text for name, text in read_quoted().items() if not name.startswith(f"{prefix}.")}
    now = sorted({**kept, **{f"{prefix}.{name}": text for name, text in figures.items()}}.items())
    write_files({QUOTED: csv_text(["name", "text"], now)})


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
