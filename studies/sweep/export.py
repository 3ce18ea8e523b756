"""A sweep's rows as CSV, Parquet (extra ``parquet``) or a pandas table (extra ``pandas``)."""

import csv
from collections.abc import Sequence
from dataclasses import asdict
from importlib.util import find_spec
from io import StringIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rodcone.errors import InputError, unknown
from rodcone.files import replacing
from studies.sweep.database import COLUMNS, read_results, rows
from studies.sweep.row import Row

if TYPE_CHECKING:
    import pandas as pd

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
    text = StringIO()
    writer = csv.writer(text)
    writer.writerow(COLUMNS)
    writer.writerows([_harmless(value) for value in asdict(row).values()] for row in table)
    return text.getvalue()


def to_pandas(table: Sequence[Row]) -> "pd.DataFrame":
    """Rows as a pandas table, a column each.

    Raises
    ------
    InputError
        Where pandas is not installed.
    """
    _require("pandas", "pandas")
    import pandas

    return pandas.DataFrame([asdict(row) for row in table], columns=list(COLUMNS))


def write_table(table: Sequence[Row], path: str | Path) -> None:
    """Write rows to a ``.csv`` or ``.parquet`` file, whole or not at all.

    Raises
    ------
    InputError
        For another ending, or Parquet without pyarrow.
    OSError
        Where the file can't be written.
    """
    path = Path(path)
    if path.suffix not in (".csv", ".parquet"):
        raise unknown(f"out: {str(path)!r}: ending", path.suffix, (".csv", ".parquet"))
    if path.suffix == ".parquet":
        _require("pyarrow", "parquet")
    with replacing(path) as (place,):
        if path.suffix == ".csv":
            place.write_text(to_csv(table), "utf-8", newline="")
        else:
            import pyarrow
            import pyarrow.parquet

            columns: dict[str, list[Any]] = {name: [getattr(row, name) for row in table] for name in COLUMNS}
            pyarrow.parquet.write_table(pyarrow.table(columns), place)


def _harmless(value: Any) -> Any:
    return f"'{value}" if isinstance(value, str) and value.startswith(_FORMULA) else value


def _require(module: str, extra: str) -> None:
    if find_spec(module) is None:
        raise InputError(f"export: {module} is not installed; install it: pip install 'rodcone[{extra}]'")
