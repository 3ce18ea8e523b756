"""Tables of numbers from CSV files."""

import csv
import re
from collections.abc import Iterable, Sequence
from io import StringIO
from pathlib import Path

import numpy as np

from rodcone.errors import InputError, read_errors
from rodcone.files import read_bounded
from rodcone.types import Floats

NM = "wavelength_nm"
_WAVELENGTH = {"wavelengthnm", "wavelength", "wavelengths", "lambda", "lambdanm", "λ", "λnm", "nm", "wl"}
_NOT_LETTERS = re.compile(r"[^a-zλ]")  # lambda [nm], Wavelength (nm)
LEAST_NM = 50.0  # below it the column is in micrometres
MOST_BYTES = 1 << 23  # 100 columns at 0.1 nm over 300-1100 nm take 6 MB


def read_columns(path: str | Path, what: str) -> dict[str, Floats]:
    """Columns of a CSV by the names in its header; the first holds wavelengths in nm, and is called ``wavelength_nm``.

    Parameters
    ----------
    path : str or Path
    what : str
        That the file holds, for the message.

    Raises
    ------
    InputError
        For a file that can't be read, a cell that is no number, another header, or wavelengths that aren't rising nm.
    """
    fix = "give a CSV of numbers, with commas between them, and a header"
    with read_errors(f"{what}: {str(path)!r} can't be read", fix, (OSError, ValueError, csv.Error)):
        content = read_bounded(Path(path), MOST_BYTES)
        header, *rows = [row for row in csv.reader(StringIO(content.decode("utf-8-sig"), newline="")) if row] or [[]]
        if not header:
            raise ValueError("it is empty")
        table = np.array([[float(cell) for cell in row] for row in rows], dtype=np.float64)
    names = [name.strip() for name in header]
    if _NOT_LETTERS.sub("", names[0].lower()) in _WAVELENGTH:
        names[0] = NM
    fits = table.ndim == 2 and table.shape[1] == len(names) == len(set(names))
    if not fits or names[0] != NM or len(names) < 2:
        fault = f"{str(path)!r} has header {names}"
        raise InputError(f"{what}: {fault}; allowed: {NM} (or wavelength, lambda, nm) and one channel a column; add it")
    if table[:, 0].max() < LEAST_NM:
        raise InputError(
            f"{what}: {str(path)!r} has wavelengths up to {table[:, 0].max():g}; allowed: nm; convert them"
        )
    falls = np.flatnonzero(~(table[1:, 0] > table[:-1, 0]))
    if falls.size:
        pair = " then ".join(f"{nm:g}" for nm in table[falls[0] : falls[0] + 2, 0])
        fix = "allowed: strictly increasing; sort its rows, each wavelength once"
        raise InputError(f"{what}: {str(path)!r} has wavelengths {pair}; {fix}")
    return dict(zip(names, table.T, strict=True))


def csv_text(head: Sequence[str], rows: Iterable[Sequence[object]], line_end: str = "\r\n") -> str:
    """Table as CSV (RFC 4180)."""
    text = StringIO()
    writer = csv.writer(text, lineterminator=line_end)
    writer.writerow(head)
    writer.writerows(rows)
    return text.getvalue()
