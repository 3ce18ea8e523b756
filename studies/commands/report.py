"""The command `rodcone report`."""

from collections.abc import Mapping
from pathlib import Path

from rodcone.errors import InputError, require_absent, require_whole, unknown
from rodcone.files import write_files
from studies.commands.console import say
from studies.commands.report_mark import REPORT, RESULTS, marked
from studies.pages.report import render_report
from studies.pages.report_compare import CAMERA, comparison_markdown, first_comparison
from studies.pages.report_sweep import sweep_report
from studies.sweep.database import last_run
from studies.sweep.export import MOST_ROWS, axis_values, results_json


def report(
    folder: Path,
    /,
    *,
    out: Path | None = None,
    pictures: int | None = None,
    camera: str | None = None,
    where: list[str] | None = None,
) -> None:
    """Write the report of a sweep as one self-contained HTML file, and print its path.

    With an --out that ends in .md: its answer and its leads as Markdown tables.

    Parameters
    ----------
    folder
        Folder of the sweep.
    out
        File to write, .html or .md; report.html in the sweep's folder by default.
    pictures
        Pictures to put into the page, at most; by default as many as keep the page under 10 MB. Numbers are given
        for all of them.
    camera
        For Markdown: the processor that is set beside the others; by default the one that the page leads with.
    where
        AXIS=VALUE to show alone, such as gain=2; may be given several times. Of more than 1000 pictures a page shows
        every other value of the longest axes, and says so.
    """
    if pictures is not None:
        require_whole("pictures", pictures, 1, 100_000, "give a number of pictures")
    path = out or folder / REPORT
    if path.suffix.lower() == ".md":
        write_files({path: _markdown(folder, path, camera, where)})
    else:
        require_absent("for a page, which has a menu; allowed: with an --out that ends in .md", camera=camera)
        write_report(folder, path, pictures, axis_values(where or ()))
    print(path)


def _markdown(folder: Path, out: Path, camera: str | None, where: list[str] | None) -> str:
    """Return the report as Markdown, with the command that makes it."""
    data, _ = sweep_report(folder, 0, axis_values(where or ()))
    if camera is not None and camera not in data.cameras:
        raise unknown("camera", camera, data.cameras)
    of = first_comparison(data)
    if of.a == of.b or (camera is not None and of.compared != CAMERA):
        raise InputError("study: there is nothing to compare; allowed: two cameras or more, or two sensors")
    command = f"rodcone report {folder} -o {out.name}" + (f" --camera {camera}" if camera else "")
    command += "".join(f" --where {text}" for text in where or ())
    return comparison_markdown(data, command, of.a if camera is None else data.cameras.index(camera))


def write_results(folder: Path) -> Path:
    """Write a sweep's report, and its results as JSON, into its folder, both or none; return the report's path.

    Over `studies.sweep.export.MOST_ROWS` rows there is no JSON, and a line says how to export them.

    Raises
    ------
    InputError, OSError
        As for `write_report`.
    """
    run = last_run(folder)
    page = render_report(*sweep_report(folder, run=run))
    count = len(run.rows)
    results = None if count > MOST_ROWS else results_json(run)
    files = {folder / REPORT: marked(folder, page, results, run.content)}
    if results is None:  # an older results file is removed, because it doesn't have all rows of the sweep
        write_files(files)
        (folder / RESULTS).unlink(missing_ok=True)
        say(f"{count} rows are too many for {RESULTS}: rodcone export {folder} -o rows.csv writes them")
    else:
        write_files({**files, folder / RESULTS: results})
    return folder / REPORT


def write_report(
    folder: str | Path, path: str | Path, pictures: int | None = None, where: Mapping[str, str] | None = None
) -> Path:
    """Write the report of a sweep's folder, whole or not at all; return its path.

    Raises
    ------
    InputError
        As for `studies.pages.report_sweep.sweep_report`.
    OSError
        Where the file can't be written.
    """
    path = Path(path)
    write_files({path: render_report(*sweep_report(Path(folder), pictures, where))})
    return path
