"""Tables as CSV."""

import csv
from collections.abc import Iterable, Sequence
from io import StringIO


def csv_text(head: Sequence[str], rows: Iterable[Sequence[object]], line_end: str = "\r\n") -> str:
    """Table as CSV (RFC 4180)."""
    text = StringIO()
    writer = csv.writer(text, lineterminator=line_end)
    writer.writerow(head)
    writer.writerows(rows)
    return text.getvalue()
