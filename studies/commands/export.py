"""The command `rodcone export`: a sweep's cells as CSV."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from studies.sweep.export import stream_rows, write_csv


def export(folder: Path, /, *, out: Path, everything: Annotated[bool, Parameter(name="--all")] = False) -> None:
    """Write the cells of a sweep as a table, a row per cell, and print its path.

    Parameters
    ----------
    folder
        Folder of the sweep.
    out
        File to write, ending in .csv.
    everything
        Also write the cells of earlier runs that the last run didn't ask for.
    """
    write_csv(stream_rows(folder, everything), out)
    print(out)
