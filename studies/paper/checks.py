"""Claims of the paper as checks with numbers; a verdict follows from them and is never written by hand."""

from dataclasses import dataclass
from math import inf, isfinite
from typing import Literal, get_args

Verdict = Literal["reproduced", "reproduced under a condition", "not reproduced"]
VERDICTS: tuple[Verdict, ...] = get_args(Verdict)

# What "about" may mean: a number given to one digit stands for a fifth more or less.
ABOUT = 0.2


@dataclass(frozen=True)
class ClaimCheck:
    """One number of a claim under one condition, and the range in which the claim holds.

    Attributes
    ----------
    condition : str
        Where or how: a reading of Table 1, a light, an exposure.
    value : float
    low, high : float
        Range in which the claim holds, ends included; infinite where it has no end.
    unit : str
        In the words of the page, such as ``dB``.
    """

    condition: str
    value: float
    low: float
    high: float
    unit: str = ""

    @property
    def holds(self) -> bool:
        """Whether the value lies in the range; NaN and infinities don't."""
        return isfinite(self.value) and self.low <= self.value <= self.high


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
        How the numbers were got, and what was ours to choose.
    """

    where: str
    text: str
    checks: tuple[ClaimCheck, ...]
    note: str = ""

    @property
    def verdict(self) -> Verdict:
        """Reproduced where every check holds, under a condition where some do."""
        held = sum(check.holds for check in self.checks)
        return VERDICTS[0] if held == len(self.checks) else VERDICTS[1] if held else VERDICTS[2]


def about(condition: str, value: float, claimed: float, unit: str = "") -> ClaimCheck:
    """Check against a number that the paper gives as "about": a fifth more or less, `ABOUT`."""
    return ClaimCheck(condition, value, claimed * (1 - ABOUT), claimed * (1 + ABOUT), unit)


def near(condition: str, value: float, claimed: float, margin: float, unit: str = "") -> ClaimCheck:
    """Check against a number within a margin on either side."""
    return ClaimCheck(condition, value, claimed - margin, claimed + margin, unit)


def at_least(condition: str, value: float, low: float, unit: str = "") -> ClaimCheck:
    """Check that a value is no less."""
    return ClaimCheck(condition, value, low, inf, unit)


def at_most(condition: str, value: float, high: float, unit: str = "") -> ClaimCheck:
    """Check that a value is no more."""
    return ClaimCheck(condition, value, -inf, high, unit)
