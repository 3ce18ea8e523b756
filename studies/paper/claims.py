"""Claims of the paper, each with checks of computed numbers, and the texts for the page that shows them.

A verdict follows from the numbers and is never written by hand.
"""

import tomllib
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from math import inf, isfinite
from pathlib import Path
from typing import Any, Literal, TypeVar, get_args

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from studies.metrics.confidence import half_width
from studies.pages import report_text as text
from studies.paper.setup import CAMERAS

T = TypeVar("T")
Verdict = Literal["reproduced", "reproduced under a condition", "not reproduced"]
VERDICTS: tuple[Verdict, ...] = get_args(Verdict)

# The paper's "about": a number that it gives to one digit is right within a fifth of it on either side.
ABOUT = 0.2
Values = Mapping[str, float | NDArray[np.float64]]  # by condition


@dataclass(frozen=True)
class ClaimCheck:
    """One number of a claim under one condition, and the range in which the claim holds.

    Attributes
    ----------
    condition : str
        What the number was computed for: a reading of Table 1, a light, an exposure.
    value : float
    low, high : float
        Range in which the claim holds, ends included; infinite where it has no end.
    unit : str
        Unit in the words of the page, such as ``dB``.
    default : float or None
        Value of the default camera, `interleaved`, if `value` is that of the paper's method, `interleaved_paper`. It
        has no part in the verdict.
    margin : float
        Half of the value's 95 % interval over exposures; 0 for a value without scatter.
    """

    condition: str
    value: float
    low: float
    high: float
    unit: str = ""
    default: float | None = None
    margin: float = 0.0

    @property
    def holds(self) -> bool:
        """Return whether the value's whole interval lies in the range; False for NaN or an infinite value."""
        return bool(
            isfinite(self.value) and self.low <= self.value - self.margin and self.value + self.margin <= self.high
        )


@dataclass(frozen=True)
class Claim:
    """A statement of the paper, and what was computed for it.

    Attributes
    ----------
    where : str
        Figure, table or section.
    text : str
        The statement.
    checks : tuple of ClaimCheck
        One or more, each under a condition of its own.
    note : str
        How the numbers were computed, and which choices are ours.
    """

    where: str
    text: str
    checks: tuple[ClaimCheck, ...]
    note: str = ""

    @property
    def verdict(self) -> Verdict:
        """Return the verdict that follows from the checks.

        The claim is reproduced if every check holds, reproduced under a condition if some of them hold, and not
        reproduced if none does.
        """
        held = sum(check.holds for check in self.checks)
        return VERDICTS[0] if held == len(self.checks) else VERDICTS[1] if held else VERDICTS[2]


@cache
def _stated() -> dict[str, dict[str, Any]]:
    """Read `claims.toml`: what it states about each claim, by its number, and the captions of the figures."""
    return tomllib.loads(Path(__file__).with_name("claims.toml").read_text("utf-8"))


def claim(number: int, checks: Iterable[ClaimCheck], **words: object) -> Claim:
    """Return a claim of `claims.toml` with checks that have ranges already; `words` fill the braces of its note."""
    stated = _stated()[str(number)]
    return Claim(stated["where"], stated["text"], tuple(checks), stated.get("note", "").format(**words))


def judge_claim(number: int, values: Values, **words: object) -> Claim:
    """Return a claim of `claims.toml`, and check the values against the range that is stated there."""
    stated = _stated()[str(number)]
    (kind,) = _CHECKS.keys() & stated.keys()
    ends = stated[kind] if isinstance(stated[kind], list) else [stated[kind]]
    checks = _CHECKS[kind](values, *ends, unit=stated.get("unit", ""))
    return claim(number, checks, **words)


def within(values: Values, low: float = -inf, high: float = inf, unit: str = "") -> tuple[ClaimCheck, ...]:
    """Check that each value lies in a range; of values over exposures, shape (seed,), the mean and its interval."""
    return tuple(ClaimCheck(name, float(np.mean(x)), low, high, unit, margin=_margin(x)) for name, x in values.items())


def _margin(value: float | NDArray[np.float64]) -> float:
    return float(half_width(value)) if isinstance(value, np.ndarray) else 0.0


def about(values: Values, claimed: float, unit: str = "") -> tuple[ClaimCheck, ...]:
    """Check that each value is within a fifth (`ABOUT`) of a number that the paper gives as "about"."""
    return within(values, claimed * (1 - ABOUT), claimed * (1 + ABOUT), unit)


def within_margin(values: Values, claimed: float, margin: float, unit: str = "") -> tuple[ClaimCheck, ...]:
    """Check that each value differs from a number by at most a margin."""
    return within(values, claimed - margin, claimed + margin, unit)


def at_least(values: Values, low: float, unit: str = "") -> tuple[ClaimCheck, ...]:
    """Check that each value is at least `low`."""
    return within(values, low, unit=unit)


def at_most(values: Values, high: float, unit: str = "") -> tuple[ClaimCheck, ...]:
    """Check that each value is at most `high`."""
    return within(values, high=high, unit=unit)


_CHECKS: Mapping[str, Callable[..., tuple[ClaimCheck, ...]]] = {
    check.__name__: check for check in (within, about, within_margin, at_least, at_most)
}


def with_default(claims_of: Callable[[T], Sequence[Claim]], by_camera: Mapping[str, T]) -> tuple[Claim, ...]:
    """Judge the claims by the results of the paper's own method, and add the default method's value to each check.

    Parameters
    ----------
    claims_of : callable
        Function that judges the claims by the results of one method.
    by_camera : mapping of str to object
        Results by method, for the two of `CAMERAS`.
    """
    return tuple(
        replace(
            claim,
            checks=tuple(
                replace(check, default=None if default_check.value == check.value else default_check.value)
                for check, default_check in zip(claim.checks, default.checks, strict=True)
            ),
        )
        for claim, default in zip(*(claims_of(by_camera[name]) for name in CAMERAS), strict=True)
    )


@dataclass(frozen=True)
class PaperFigure:
    """A figure: its number in the paper, its caption, and the drawing."""

    name: str
    caption: str
    drawing: Figure


def paper_figure(name: str, drawing: Figure, **values: object) -> PaperFigure:
    """Return a figure with its caption from `claims.toml`, in which `values` fill the braces."""
    return PaperFigure(name, _stated()["captions"][name].format(**values), drawing)


def range_text(check: ClaimCheck) -> str:
    """Write the range in which the claim holds: ``at least 1``, ``9.04 to 10.04``, ``exactly 1``."""
    low, high = (text.significant(value, digits=4) for value in (check.low, check.high))
    if not isfinite(check.high):
        return f"at least {low}"
    if not isfinite(check.low):
        return f"at most {high}"
    return f"exactly {low}" if check.low == check.high else f"{low} to {high}"


def value_text(check: ClaimCheck) -> str:
    """Write a check's value and unit, with enough digits to differ from an end of its range if that is near."""
    for digits in range(3, 7):
        shown = text.significant(check.value, digits=digits)
        ends = [text.significant(end, digits=digits) for end in (check.low, check.high) if isfinite(end)]
        if shown not in ends or check.value in (check.low, check.high):
            break
    shown += f" ± {text.significant(check.margin, digits=2)}" if check.margin else ""
    return f"{shown}\N{NO-BREAK SPACE}{check.unit}" if check.unit else shown


def default_text(check: ClaimCheck) -> str:
    """Write the default camera's value, such as ``default: 3.1 dB``; return an empty text if it isn't known."""
    return "" if check.default is None else f"default: {value_text(replace(check, value=check.default, margin=0.0))}"
