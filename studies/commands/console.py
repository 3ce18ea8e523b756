"""Parts that the commands share: types of options, and functions that print results, notes and tables."""

import json as notation
import sys
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Protocol

from cyclopts import Parameter
from rich.console import Console
from rich.table import Table
from rich.text import Text

from rodcone.errors import InputError
from rodcone.files import check_place, finite, require_ending
from rodcone.time_text import parse_time


def _seconds(_: object, tokens: Sequence[Any]) -> float:
    """Convert a number of seconds, or a time with its unit, to seconds."""
    text = tokens[0].value
    try:
        return float(text)
    except ValueError:
        return parse_time(text)


def _time(_: object, tokens: Sequence[Any]) -> float:
    """Convert a time with its unit to seconds."""
    return parse_time(tokens[0].value)


Seconds = Annotated[float, Parameter(converter=_seconds)]  # a duration: 65 or 65s
Time = Annotated[float, Parameter(converter=_time)]  # an exposure: 20ms or 1/50

INTERRUPTED = 130  # exit code after Ctrl-C: 128 + SIGINT


def say(*notes: str) -> None:
    """Print notes on stderr, one line per note."""
    for note in notes:
        print(f"rodcone: {note}", file=sys.stderr)


def print_result(text: object, facts: Mapping[str, Any], *, json: bool) -> None:
    """Print a command's result on stdout: the text, or with --json the facts as one JSON object on one line."""
    if json:
        print_json(facts)
    else:
        print(text)


class Estimated(Protocol):
    """Cost of a command before it runs."""

    def words(self) -> str:
        """Return the cost in one line for a reader."""

    def facts(self) -> Mapping[str, Any]:
        """Return the same cost as values by name."""


def announce_cost(cost: Estimated, *, dry_run: bool, json: bool) -> bool:
    """Print what a command will cost: on stdout for a dry run, else on stderr. Return whether the command shall run."""
    if dry_run:
        print_result(cost.words(), cost.facts(), json=json)
    else:
        say(cost.words())
    return not dry_run


def print_json(facts: Mapping[str, Any]) -> None:
    """Print facts as one JSON object on one line; a number that isn't finite is null."""
    print(notation.dumps(finite(facts), allow_nan=False))


def print_table(head: Sequence[str], rows: Iterable[Sequence[str | Text]], words: int = 1) -> None:
    """Print a table on stdout whose first `words` columns hold words and the others numbers; no line is cut off."""
    table = Table(box=None, pad_edge=False, show_header=any(head))
    for index, name in enumerate(head):
        table.add_column(name, justify="left" if index < words else "right", overflow="fold", no_wrap=index == 0)
    for row in rows:
        table.add_row(*(Text(cell) if isinstance(cell, str) else cell for cell in row))
    Console(width=None if sys.stdout.isatty() else 200).print(table)


def require_new(out: Path, ending: str) -> None:
    """Raise `InputError` if a file to write has another ending or exists already."""
    require_ending(out, ending)
    if out.exists():
        raise InputError(f"out: {str(out)!r} exists; allowed: a new file; choose another name or remove it")


def require_place(out: Path | None, *endings: str) -> None:
    """Raise `InputError` or `OSError` if a file can't be written under its name; do nothing for None."""
    if out is not None:
        require_ending(out, *endings)
        check_place(out)
