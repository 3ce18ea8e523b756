"""The command `rodcone report`."""

from pathlib import Path

from rodcone.errors import require_whole
from rodcone.files import replacing
from studies.commands.console import OutOrNone
from studies.pages.report import render_report
from studies.pages.report_sweep import ledger_results

FILE = "report.html"


def report(
    folder: Path,
    /,
    *,
    out: OutOrNone = None,
    pictures: int | None = None,
) -> None:
    """Write the report of a sweep as one self-contained HTML file; prints its path.

    Parameters
    ----------
    folder
        Folder of the sweep.
    out
        File to write; report.html in the sweep's folder by default.
    pictures
        Pictures to put into the page, at most; by default as many as fit into 8 MB. Numbers are given for all of them.
    """
    if pictures is not None:
        require_whole("pictures", pictures, 1, 100_000, "give a number of pictures")
    print(write_report(folder, out or folder / FILE, pictures))


def write_report(folder: Path, path: Path, pictures: int | None = None) -> Path:
    """Write the report of a sweep's folder, whole or not at all; gives its path.

    Raises
    ------
    InputError
        As `studies.pages.report_sweep.ledger_results`.
    OSError
        Where the file can't be written.
    """
    page = render_report(*ledger_results(folder, pictures))
    with replacing(path) as (place,):
        place.write_text(page, "utf-8")
    return path
