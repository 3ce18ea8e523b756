"""The command `rodcone opponents`."""

import json
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter


def opponents(
    folder: Path,
    /,
    *,
    out: Annotated[Path, Parameter(name=["--out", "-o"])] = Path("opponents.md"),
    camera: str = "interleaved",
) -> None:
    """Write a page on one camera beside the other processors of a sweep, its losses included; prints its path.

    Every number and sentence is computed from the ledger; the figure is an SVG file of the page's name.

    Parameters
    ----------
    folder
        Folder of a sweep of two seeds or more; rodcone new study opponents writes a study to start from.
    out
        Page to write, ending in .md.
    camera
        Processor whose leads and losses the page tells.
    """
    from render.errors import InputError
    from render.files import check_place
    from studies.export import read_rows
    from studies.opponents_page import write_page

    if out.suffix != ".md":
        raise InputError(f"out: {str(out)!r} doesn't end in .md; allowed: that ending; write {out.stem}.md")
    check_place(out)
    rows = read_rows(folder)
    write_page(rows, _last_study(folder), folder, out, camera)
    print(out)


def _last_study(folder: Path) -> dict[str, Any]:
    """Return the study of a ledger's last run, as it is noted there."""
    from studies.ledger import open_ledger

    with open_ledger(folder) as base:
        noted = base.execute("SELECT study FROM runs ORDER BY rowid DESC LIMIT 1").fetchone()
    return dict(json.loads(noted[0])) if noted else {}
