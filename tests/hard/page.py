"""Writes docs/hard_cases.md and its tables in docs/results: hard cases and margins. `make hard-cases` runs it."""

import sys
from collections.abc import Sequence
from csv import writer
from pathlib import Path

from hard.case import Margin
from hard.catalogue import CASES, INVARIANTS, LIMITS, OWN, Result, run_case, unexpected
from page_parts import quote_everywhere, write_quoted

from rodcone.jit import backend

PAGE = Path(__file__).resolve().parents[2] / "docs" / "hard_cases.md"
COLUMNS = (*INVARIANTS, OWN)

TEXT = """# Hard cases

A camera simulator should be right at the ends of every range: with the sun's glint, with no light at all, with a frame
of three rows, or with a well of a million electrons. `make hard-cases` runs each of these cases through the whole
chain, measures how far it is from breaking each of the promises below, and writes this page. `pytest tests/hard -k
sun_glint` runs one case. Both commands fail if a case breaks a promise and isn't listed as a limit. Unless a case says
otherwise, the scene is `cornell_box` at 64 × 64 pixels, the camera is `low_noise` with an RGBW and a Bayer mosaic, and
the exposure is 10 ms.

{summary}

## What must be kept

{invariants}

Each number in the file below is the worst error divided by the error that is allowed, so the invariant is kept up to 1.
Electrons may differ by 10⁻⁶ of a pixel's expected electrons. The mean of 32 raw images or 12 pictures may differ by
what a false-alarm rate of 10⁻⁶ allows. Mirrored and cut pictures may differ by the rounding of the arithmetic.

## Limits

The table lists what isn't kept, by how much, and why. A test in `tests/hard` checks that this list is exact.

{limits}

## Tables

[hard_cases.csv](results/hard_cases.csv) has every case with its margins. A cell is empty if the invariant says nothing
about the case.
"""


def main() -> int:
    """Measure everything, write the page; 1 where something isn't as the list of limits says."""
    if backend() == "numpy":
        raise SystemExit("hard cases: Dr.Jit finds no LLVM or CUDA here, and NumPy's forms would take hours")
    results = []
    for case in CASES:
        results.append(run_case(case))
        print(case.name, *unexpected(results[-1]), sep="\n    ", flush=True)
    PAGE.write_text(page(results), encoding="utf-8")
    with (PAGE.parent / "results" / "hard_cases.csv").open("w", encoding="utf-8", newline="") as file:
        writer(file, lineterminator="\n").writerows(catalogue(results))
    write_quoted("hard_cases", counts(results))
    quote_everywhere()
    print(f"\n{summary(results)}\n{PAGE}")
    return int(any(unexpected(result) for result in results))


def page(results: Sequence[Result]) -> str:
    """The whole page."""
    return TEXT.format(
        summary=summary(results),
        invariants="\n".join(
            f"- **{name}**: {(measure.__doc__ or '').splitlines()[0]}" for name, measure in INVARIANTS.items()
        ),
        limits=limits(results),
    )


def summary(results: Sequence[Result]) -> str:
    """Counts in a sentence."""
    told = counts(results)
    return (
        f"{told['cases']} cases, {told['invariants']} invariants measured: {told['kept']} kept, {told['not_kept']} "
        f"not; {told['whole']} cases keep all of theirs."
    )


def counts(results: Sequence[Result]) -> dict[str, str]:
    """Counts by name: cases, invariants, how many are kept and not, cases that keep all of theirs."""
    margins = [margin for result in results for margin in result.margins.values() if margin is not None]
    held = sum(margin.kept for margin in margins)
    numbers = {
        "cases": len(results),
        "invariants": len(margins),
        "kept": held,
        "not_kept": len(margins) - held,
        "whole": sum(not result.broken for result in results),
    }
    return {name: str(number) for name, number in numbers.items()}


def limits(results: Sequence[Result]) -> str:
    """Table of what isn't kept: by how much, and why."""
    first_case: dict[str, str] = {}
    rows = []
    for result in results:
        for name in result.broken:
            margin = result.margins[name]
            what = result.case.promise if name == OWN else name
            reason = LIMITS.get((result.case.name, name), "**unknown: a fault**")
            worst = f"{margin.worst:.3g} {margin.unit}"
            place = f"`{result.case.name}`, {what}"
            first = first_case.setdefault(reason, place)  # a reason stands at its first case alone
            why = reason if first == place else f"as {first}"
            rows.append([f"`{result.case.name}`", what, worst, f"{margin.allowed:.3g}", why])
    return table(["case", "not kept", "worst", "allowed there", "why"], rows)


def catalogue(results: Sequence[Result]) -> list[list[str]]:
    """Table of all cases: the worst error of each invariant as a share of what is allowed."""
    rows = [["case", "how it is set up", *COLUMNS, "kept", f"{OWN} invariant"]]
    for result in results:
        shares = [share_text(result.margins[name]) for name in COLUMNS]
        kept = "no" if result.broken else "yes"
        rows.append([result.case.name, result.case.setup, *shares, kept, result.case.promise])
    return rows


def share_text(margin: Margin | None) -> str:
    """Share of what is allowed, to two digits; nothing where the invariant says nothing."""
    if margin is None:
        return ""
    return f"{margin.share:.2g}" if margin.share < 1000 else f"{margin.share:.0e}"


def table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Markdown table."""
    return "\n".join("| " + " | ".join(line) + " |" for line in [head, ["---"] * len(head), *rows])


if __name__ == "__main__":
    sys.exit(main())
