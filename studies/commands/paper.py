"""The command `rodcone paper`."""

import json as notation
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter


def paper(
    *,
    out: Annotated[Path, Parameter(name=["--out", "-o"])] = Path("out/paper"),
    size: int = 192,
    spp: int = 256,
    seeds: int = 4,
    json: Annotated[bool, Parameter(negative="")] = False,
) -> None:
    """Compute the figures and claims of Parmar & Wandell 2009 and judge each claim; prints the page's path.

    Parameters
    ----------
    out
        Folder for paper.html, paper.json, the figures as SVG and PNG, and the renders, which another run takes up.
    size
        Side of the pictures in pixels.
    spp
        Samples a pixel of the renders.
    seeds
        Exposures of each condition.
    json
        Print the claims, their numbers and verdicts as one JSON object instead of the path.
    """
    from studies.paper.paper import as_json, make, write
    from studies.paper.setup import Setup

    setup = Setup(out, size, spp, seeds=seeds)
    out.mkdir(parents=True, exist_ok=True)  # a place that can't be written is told before the first render
    with _steps() as step:
        made = make(replace(setup, step=step))
    page = write(made, out)
    print(notation.dumps(as_json(made), allow_nan=False) if json else page)


@contextmanager
def _steps() -> Iterator[Callable[[str, float], None]]:
    """Progress on stderr: a bar on a terminal, else a line as each figure begins."""
    from rodcone.progress import progress

    if sys.stderr.isatty():
        with progress(sys.stderr) as step:
            yield step
        return
    told = ""

    def line(what: str, share: float) -> None:
        nonlocal told
        figure = what.partition(":")[0]
        if figure != told:
            told = figure
            print(f"rodcone: {share:.0%}, {figure}", file=sys.stderr)

    yield line
