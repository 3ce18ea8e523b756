"""Compute all figures and claims of the paper, and write them as files and as one page."""

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from importlib import metadata
from pathlib import Path
from types import MappingProxyType
from typing import Any

from rodcone.csv_file import csv_text
from rodcone.errors import require_keys
from rodcone.files import finite, write_files
from studies.pages.page import address, own_file, write_out
from studies.pages.plots import png_bytes, svg_text
from studies.pages.report_sweep import environment
from studies.paper.best_exposure import figure_b
from studies.paper.claims import VERDICTS, Claim, PaperFigure, default_text, range_text, value_text
from studies.paper.early import section_2
from studies.paper.figure2 import figure_2
from studies.paper.light_levels import figure_a
from studies.paper.numbers import number_claims
from studies.paper.patches import figure_4, section_3_1
from studies.paper.pixel_size import figure_1a, figure_1b
from studies.paper.setup import Setup, view
from studies.paper.white_beside_bayer import figure_6
from studies.paper.white_in_low_light import figure_3
from studies.paper.white_partly_full import figure_5

Made = tuple[PaperFigure, tuple[Claim, ...]]


@dataclass(frozen=True)
class Paper:
    """The figures in the paper's order, the claims, and facts about the program and settings that made them."""

    figures: tuple[PaperFigure, ...]
    claims: tuple[Claim, ...]
    facts: dict[str, Any]


_MAKERS: Mapping[str, Callable[[Setup], Made]] = MappingProxyType(
    {
        "1a": figure_1a,
        "1b": figure_1b,
        "2": lambda _: figure_2(),
        "3": figure_3,
        "4": figure_4,
        "5": figure_5,
        "6": figure_6,
        "A": figure_a,
        "B": figure_b,
    }
)


def makers_of(figures: Sequence[str]) -> dict[str, Callable[[Setup], Made]]:
    """Return the functions that make the named figures, in the paper's order; without names, those of all figures.

    Raises
    ------
    InputError
        For a name that no figure has.
    """
    require_keys("figure", figures, _MAKERS)
    return {f"Figure {name}": maker for name, maker in _MAKERS.items() if name in figures or not figures}


def make(setup: Setup, figures: Sequence[str] = ()) -> Paper:
    """Compute figures and their claims; scenes are rendered once and kept in the folder.

    Parameters
    ----------
    setup : Setup
    figures : sequence of str
        Names such as ``6`` or ``1a``. Without names all figures are made, and also the claims that belong to no figure.

    Raises
    ------
    InputError
        For a name that no figure has.
    OSError
        Where the folder can't be written.
    """
    makers = makers_of(figures)
    setup.out.mkdir(parents=True, exist_ok=True)
    results = []
    for index, (name, maker) in enumerate(makers.items()):

        def step(what: str, share: float, name: str = name, index: int = index) -> None:
            setup.step(f"{name}: {what}", (index + share) / len(makers))

        step("begins", 0.0)
        results.append(maker(replace(setup, step=step)))
    claims = tuple(claim for _, of_figure in results for claim in of_figure)
    if not figures:
        numbers = number_claims(view(setup, "still_life", 1.0))
        claims = (*numbers, *claims, *section_2(setup), *section_3_1())
    facts = {"size": setup.size, "spp": setup.spp, "seeds": setup.seeds, "rodcone": metadata.version("rodcone")}
    return Paper(tuple(figure for figure, _ in results), claims, facts | {"environment": environment()})


def write(paper: Paper, folder: Path) -> Path:
    """Write ``paper.html``, ``.json``, ``.csv`` and each figure as SVG and PNG; all appear or none."""
    files = {f"figure_{figure.name}.svg": svg_text(figure.drawing).encode() for figure in paper.figures}
    files |= {f"figure_{figure.name}.png": png_bytes(figure.drawing) for figure in paper.figures}
    files["paper.json"] = (json.dumps(as_json(paper), indent=1, allow_nan=False) + "\n").encode()
    files["paper.csv"] = as_csv(paper).encode()
    page = write_out(
        "paper.html.j2",
        figures=[(figure, address("svg+xml", files[f"figure_{figure.name}.svg"])) for figure in paper.figures],
        claims=paper.claims,
        facts=paper.facts,
        verdicts=VERDICTS,
        value_text=value_text,
        default_text=default_text,
        range_text=range_text,
        style=own_file("report.css") + own_file("paper.css"),
    )
    files["paper.html"] = page.encode()
    write_files({folder / name: content for name, content in files.items()})
    return folder / "paper.html"


def as_json(paper: Paper) -> dict[str, Any]:
    """Return values for JSON: the facts, the number of claims with each verdict, and the claims with their checks."""
    claims = [
        {
            "where": claim.where,
            "claim": claim.text,
            "verdict": claim.verdict,
            "checks": [finite(asdict(check)) | {"holds": check.holds} for check in claim.checks],
            "note": claim.note,
        }
        for claim in paper.claims
    ]
    count = {verdict: sum(claim.verdict == verdict for claim in paper.claims) for verdict in VERDICTS}
    return {**paper.facts, "verdicts": count, "claims": claims}


def as_csv(paper: Paper) -> str:
    """Write the checks as CSV: a row per check, with the number of its claim."""
    head = ("number", "where", "claim", "verdict", "condition", "computed", "claimed", "check", "default")
    rows = []
    for number, claim in enumerate(paper.claims, 1):
        for check in claim.checks:
            computed = value_text(check), range_text(check), "holds" if check.holds else "fails", default_text(check)
            rows.append([number, claim.where, claim.text, claim.verdict, check.condition, *computed])
    return csv_text(head, rows, line_end="\n")
