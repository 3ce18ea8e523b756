"""Tables of numbers from CSV files."""

import csv
from io import StringIO
from pathlib import Path

import numpy as np

from rodcone.errors import InputError
from rodcone.types import Floats

MOST_BYTES = 1 << 23  # 100 columns at 0.1 nm over 300-1100 nm take 6 MB


def read_columns(path: str | Path, what: str, first: str) -> dict[str, Floats]:
    """Columns of a CSV by the names in its header.

    Parameters
    ----------
    path : str or Path
    what : str
        That the file holds, for the message.
    first : str
        Name that the first column has to have; one more is needed.

    Raises
    ------
    InputError
        For a file that can't be read, a cell that is no number, or another header.
    """
    try:
        if Path(path).exists() and not Path(path).is_file():  # a pipe or a device may never end
            raise ValueError("it is a folder or a device")
        with Path(path).open("rb") as file:
            content = file.read(MOST_BYTES + 1)
        if len(content) > MOST_BYTES:
            raise ValueError(f"it is over {MOST_BYTES} bytes")
        header, *rows = [row for row in csv.reader(StringIO(content.decode("utf-8-sig"), newline="")) if row]
        table = np.array([[float(cell) for cell in row] for row in rows], dtype=np.float64)
    except (OSError, ValueError, csv.Error) as error:
        told = f"{str(path)!r} can't be read ({error})"
        raise InputError(f"{what}: {told}; give a CSV of numbers with a header") from error
    names = [name.strip() for name in header]
    fits = table.ndim == 2 and table.shape[1] == len(names) == len(set(names))
    if not fits or names[0] != first or len(names) < 2:
        told = f"{str(path)!r} has header {names}"
        raise InputError(f"{what}: {told}; allowed: {first} and one channel a column; add it")
    return dict(zip(names, table.T, strict=True))
