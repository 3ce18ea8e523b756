"""The page "claim, computed, verdict": self-contained HTML without a script."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import isfinite
from typing import Any

from matplotlib.figure import Figure

from studies.pages import report_text as text
from studies.pages.page import address, own_file, write_out
from studies.pages.plots import svg_text
from studies.paper.checks import VERDICTS, Claim, ClaimCheck


@dataclass(frozen=True)
class PaperFigure:
    """A figure: the paper's number, its caption, and the drawing."""

    name: str
    caption: str
    drawing: Figure


def range_text(check: ClaimCheck) -> str:
    """Where the claim holds, in words: ``at least 1``, ``9.04 to 10.04``, ``exactly 1``."""
    low, high = (text.significant(value, digits=4) for value in (check.low, check.high))
    if not isfinite(check.high):
        return f"at least {low}"
    if not isfinite(check.low):
        return f"at most {high}"
    return f"exactly {low}" if check.low == check.high else f"{low} to {high}"


def value_text(check: ClaimCheck) -> str:
    """Number and unit, to as many digits as tell it from the end of its range that it is near to."""
    for digits in range(3, 7):
        shown = text.significant(check.value, digits=digits)
        ends = [text.significant(end, digits=digits) for end in (check.low, check.high) if isfinite(end)]
        if shown not in ends or check.value in (check.low, check.high):
            break
    return f"{shown}\N{NO-BREAK SPACE}{check.unit}" if check.unit else shown


def paper_page(figures: Sequence[PaperFigure], claims: Sequence[Claim], facts: Mapping[str, Any]) -> str:
    """Write the page.

    Parameters
    ----------
    figures : sequence of PaperFigure
    claims : sequence of Claim
    facts : mapping
        Set-up and versions, as `studies.paper.paper.Paper` has them.
    """
    return write_out(
        "paper.html.j2",
        figures=[(figure, address("svg+xml", svg_text(figure.drawing).encode())) for figure in figures],
        claims=claims,
        facts=facts,
        verdicts=VERDICTS,
        value_text=value_text,
        range_text=range_text,
        style=own_file("report.css") + own_file("paper.css"),
    )
