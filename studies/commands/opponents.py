"""The command `rodcone opponents`."""

from pathlib import Path

from rodcone.files import check_place
from studies.commands.console import Out, require_ending
from studies.pages.duels_page import write_page
from studies.sweep.database import last_run


def opponents(folder: Path, /, *, out: Out = Path("opponents.md"), camera: str = "interleaved") -> None:
    """Write a page on one camera beside the other processors of a sweep, its losses included; prints its path.

    Every number is computed from the results database; the figure is an SVG file of the page's name.

    Parameters
    ----------
    folder
        Folder of a sweep of two seeds or more; rodcone new study opponents writes a study to start from.
    out
        Page to write, ending in .md.
    camera
        Processor that the page compares with the others.
    """
    require_ending(out, ".md")
    check_place(out)
    run = last_run(folder)
    write_page(run.rows, run.study, folder, out, camera)
    print(out)
