"""The command `rodcone paper`."""

import sys
from dataclasses import replace
from pathlib import Path

from rodcone.progress import progress
from studies.commands.console import print_result
from studies.paper.paper import as_json, make, makers_of, write
from studies.paper.setup import Setup


def paper(
    *,
    out: Path = Path("out/paper"),
    figure: tuple[str, ...] = (),
    size: int = 192,
    spp: int = 256,
    seeds: int = 4,
    json: bool = False,
) -> None:
    """Compute the figures and claims of Parmar & Wandell 2009, check each claim and print the page's path.

    Parameters
    ----------
    figure
        Make this figure alone, with its claims: 1a, 1b, 2, 3, 4, 5, 6, A or B; may be given several times. All where
        it is left out.
    out
        Folder for paper.html, paper.json, the figures as SVG and PNG, and the renders, which another run uses again.
    size
        Side of the pictures in pixels.
    spp
        Samples per pixel of the renders.
    seeds
        Exposures of each condition.
    json
        Print the claims, their numbers and verdicts as one JSON object instead of the path.
    """
    setup = Setup(out, size, spp, seeds=seeds)
    makers_of(figure)  # so that an unknown name fails before a folder is made
    out.mkdir(parents=True, exist_ok=True)  # so that a folder that can't be written fails before a render
    with progress(sys.stderr) as step:
        results = make(replace(setup, step=step), figure)
    page = write(results, out)
    print_result(page, as_json(results), json=json)
