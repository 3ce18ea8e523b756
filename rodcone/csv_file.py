"""Tables as CSV."""

import csv
from collections.abc import Iterable, Sequence
from io import StringIO
from typing import TextIO


def csv_text(head: Sequence[str], rows: Iterable[Sequence[object]], line_end: str = "\r\n") -> str:
    """Return a table as CSV (RFC 4180)."""
    text = StringIO()
    write_table(text, head, rows, line_end)
    return text.getvalue()


def write_table(file: TextIO, head: Sequence[str], rows: Iterable[Sequence[object]], line_end: str = "\r\n") -> None:
    """Write a table as CSV (RFC 4180) row by row into a file that was opened with ``newline=""``."""
    writer = csv.writer(file, lineterminator=line_end)
    writer.writerow(head)
    writer.writerows(rows)
