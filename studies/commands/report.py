"""The command `rodcone report`."""

from pathlib import Path

from rodcone.errors import require_whole
from rodcone.files import replacing
from studies.commands.console import OutOrNone
from studies.pages.report import render_report
from studies.pages.report_sweep import sweep_report
from studies.sweep.results import overview, results_json

FILE, RESULTS, OVERVIEW = "report.html", "results.json", "overview.png"


def report(folder: Path, /, *, out: OutOrNone = None, pictures: int | None = None) -> None:
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


def write_results(folder: Path) -> Path:
    """Write a sweep's report, its results as JSON and an overview of its pictures into its folder; gives the report.

    All of the three appear or none.

    Raises
    ------
    InputError, OSError
        As `write_report`.
    """
    page = render_report(*sweep_report(folder)).encode()
    files = {FILE: page, RESULTS: results_json(folder), OVERVIEW: overview(folder)}
    with replacing(*(folder / name for name in files)) as places:
        for place, content in zip(places, files.values(), strict=True):
            place.write_bytes(content)
    return folder / FILE


def write_report(folder: str | Path, path: str | Path, pictures: int | None = None) -> Path:
    """Write the report of a sweep's folder, whole or not at all; gives its path.

    Raises
    ------
    InputError
        As `studies.pages.report_sweep.sweep_report`.
    OSError
        Where the file can't be written.
    """
    path = Path(path)
    page = render_report(*sweep_report(Path(folder), pictures))
    with replacing(path) as (place,):
        place.write_text(page, "utf-8")
    return path
