"""A sweep's rows as values, as CSV and as JSON."""

import json
from collections.abc import Sequence
from importlib import metadata
from pathlib import Path
from typing import Any

from rodcone.csv_file import csv_text
from rodcone.files import finite, require_ending, write_files
from studies.sweep.database import COLUMNS, last_run, read_results, rows
from studies.sweep.row import Row

_JSON_COLUMNS = ("render", "lens", "balance", "mean_electrons", "versions")
_FORMULA = ("=", "+", "-", "@", "\t", "\r")  # what spreadsheets take for the start of a formula (OWASP, CSV injection)


def read_rows(folder: str | Path, everything: bool = False) -> list[Row]:
    """Rows of a sweep's folder: those of its last run, or all.

    Raises
    ------
    InputError
        Where there is no results database, or one of another version.
    """
    with read_results(Path(folder)) as base:
        return rows(base, everything)


def to_csv(table: Sequence[Row]) -> str:
    """Rows as CSV (RFC 4180) with a header; a text that a spreadsheet would run as a formula gets a quote in front."""
    return csv_text(COLUMNS, ([_harmless(value) for value in vars(row).values()] for row in table))


def write_csv(table: Sequence[Row], path: Path) -> None:
    """Write rows to a ``.csv`` file, whole or not at all.

    Raises
    ------
    InputError
        For another ending.
    OSError
        Where the file can't be written.
    """
    require_ending(path, ".csv")
    write_files({path: to_csv(table)})


def results_json(folder: Path) -> bytes:
    """Study, seconds by stage and rows of a sweep's last run, as a JSON file.

    A row has the columns of `studies.sweep.row.Row`, those in JSON as objects; a number that isn't finite is null.
    """
    run, cells = last_run(folder), []
    for row in run.rows:
        values = finite(vars(row))
        cells.append(values | {name: json.loads(values[name]) for name in _JSON_COLUMNS})
    results = {"rodcone": metadata.version("rodcone"), "study": run.study, "stages": run.stages, "rows": cells}
    return (json.dumps(results, indent=1, allow_nan=False) + "\n").encode()


def _harmless(value: Any) -> Any:
    return f"'{value}" if isinstance(value, str) and value.startswith(_FORMULA) else value
