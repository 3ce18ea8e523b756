"""The page "claim, computed, verdict": self-contained HTML without a script."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import isfinite
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup
from matplotlib.figure import Figure

from studies.pages import report_text as text
from studies.pages.plots import svg_text
from studies.pages.report import TEMPLATES, data_uri
from studies.paper.checks import VERDICTS, Check, Claim


@dataclass(frozen=True)
class PaperFigure:
    """A figure: the paper's number, its caption, what it shows for those who don't see it, and the drawing."""

    name: str
    caption: str
    description: str
    drawing: Figure


def range_text(check: Check) -> str:
    """Where the claim holds, in words: ``at least 1``, ``9.04 to 10.04``, ``exactly 1``."""
    low, high = (text.significant(value, digits=4) for value in (check.low, check.high))
    if not isfinite(check.high):
        return f"at least {low}"
    if not isfinite(check.low):
        return f"at most {high}"
    return f"exactly {low}" if check.low == check.high else f"{low} to {high}"


def value_text(check: Check) -> str:
    """Number and unit, to as many digits as tell it from the end of its range that it is near to."""
    for digits in range(3, 7):
        shown = text.significant(check.value, digits=digits)
        ends = [text.significant(end, digits=digits) for end in (check.low, check.high) if isfinite(end)]
        if shown not in ends or check.value in (check.low, check.high):
            break
    return f"{shown}\N{NO-BREAK SPACE}{check.unit}" if check.unit else shown


def summary(claims: Sequence[Claim]) -> str:
    """How many claims have which verdict, as a sentence."""
    counts = [(verdict, sum(claim.verdict == verdict for claim in claims)) for verdict in VERDICTS]
    parts = [f"{count} {'is' if count == 1 else 'are'} {verdict}" for verdict, count in counts if count]
    return f"Of {len(claims)} claims, {text.join(parts)}."


def paper_page(figures: Sequence[PaperFigure], claims: Sequence[Claim], facts: Mapping[str, Any]) -> str:
    """Write the page.

    Parameters
    ----------
    figures : sequence of PaperFigure
    claims : sequence of Claim
    facts : mapping
        Set-up and versions, as `studies.paper.paper.Paper` has them.
    """
    environment = Environment(
        loader=FileSystemLoader(TEMPLATES),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    styles = ("report.css", "paper.css")
    style = "\n".join((TEMPLATES / name).read_text(encoding="utf-8") for name in styles)
    drawn = [(figure, data_uri(figure.name, svg_text(figure.drawing).encode())) for figure in figures]
    return environment.get_template("paper.html.j2").render(
        figures=drawn,
        claims=claims,
        facts=facts,
        summary=summary(claims),
        verdicts=VERDICTS,
        value_text=value_text,
        range_text=range_text,
        style=Markup(style),  # files of this package, never input
    )
