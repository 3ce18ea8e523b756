"""Writes docs/hard_cases.md: every hard case and its margins. `make hard-cases` runs it."""

import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from hard.case import Margin
from hard.catalogue import CASES, INVARIANTS, LIMITS, OWN, Result, run_case, unexpected
from hard.precision import Worst, search
from hard.stages import STAGES

from rodcone.jit import backend

PAGE = Path(__file__).resolve().parents[2] / "docs" / "hard_cases.md"
COLUMNS = (*INVARIANTS, OWN)

TEXT = """# Hard cases

`make hard-cases` takes each case through the whole chain, from radiance to expected electrons, a raw image, and the
pictures of the interleaved and the Bayer camera, measures how far it is from breaking each invariant, and writes this
page. `pytest tests/hard -k sun_glint` runs one case. Both fail for anything that isn't kept and isn't listed below as a
limit. The scene is `cornell_box` at 64 × 64 pixels, rendered once and lit anew, the camera `low_noise` with an RGBW and
a Bayer mosaic, 10 ms, unless a case says otherwise.

{summary}

## What must be kept

{invariants}

Numbers are the worst error found as a share of what is allowed: up to 1 the invariant is kept. A dash: it says nothing
about the case. Allowed are, for the invariants of electrons, 10⁻⁶ of a pixel's expected electrons; for bias of the mean
of 32 raw images or 12 pictures, each with a chip of its own, what a false-alarm rate of 10⁻⁶ gives (a thirtieth of a
sample's noise in the mean of a channel, and up to a fifth in a picture); for mirrored and cut pictures what the
arithmetic's rounding makes of the samples.

## Limits

What isn't kept, by how much, and why. `tests/hard` holds this list to be exact.

{limits}

## Kept by single cases besides

{promises}

## All cases

{catalogue}

## Single against double precision

Where stages run in single precision, the same arithmetic in double precision stands beside it. A search of {tried} sets
of parameters a stage, first at random, then by steps from the worst, looks for the largest error beside the sensor's
noise: the least that a sensor can have, shot noise and the dark noise that the parameters say. Bounds are counted
roundings, u = 2⁻²⁴ of the number that is rounded; the last column is the nearest that any error came to its bound.

{precision}
"""


def main() -> int:
    """Measure everything, write the page; 1 where something isn't as the list of limits says."""
    if backend() == "numpy":
        raise SystemExit("hard cases: Dr.Jit finds no LLVM or CUDA here, and NumPy's forms would take hours")
    results = []
    for case in CASES:
        results.append(run_case(case))
        print(case.name, *unexpected(results[-1]), sep="\n    ", flush=True)
    stages = [search(stage, np.random.default_rng([8, number])) for number, stage in enumerate(STAGES)]
    PAGE.write_text(page(results, stages), encoding="utf-8")
    print(f"\n{summary(results)}\n{PAGE}")
    return int(any(unexpected(result) for result in results))


def page(results: Sequence[Result], stages: Sequence[Worst]) -> str:
    """The whole page."""
    return TEXT.format(
        summary=summary(results),
        invariants="\n".join(
            f"- **{name}**: {(measure.__doc__ or '').splitlines()[0]}" for name, measure in INVARIANTS.items()
        ),
        limits=limits(results),
        promises=promises(results),
        catalogue=catalogue(results),
        tried=stages[0].tried,
        precision=precision(stages),
    )


def summary(results: Sequence[Result]) -> str:
    """Counts in a sentence."""
    margins = [margin for result in results for margin in result.margins.values() if margin is not None]
    whole = sum(not result.broken for result in results)
    held = sum(margin.kept for margin in margins)
    return (
        f"{len(results)} cases, {len(margins)} invariants measured: {held} kept, {len(margins) - held} not; "
        f"{whole} cases keep all of theirs."
    )


def limits(results: Sequence[Result]) -> str:
    """Table of what isn't kept: by how much, and why."""
    rows = []
    for result in results:
        for name in result.broken:
            margin = result.margins[name]
            what = result.case.promise if name == OWN else name
            reason = LIMITS.get((result.case.name, name), "**unknown: a fault**")
            worst = f"{margin.worst:.3g} {margin.unit}"
            rows.append([f"`{result.case.name}`", what, worst, f"{margin.allowed:.3g}", reason])
    return table(["case", "not kept", "worst", "allowed there", "why"], rows)


def promises(results: Sequence[Result]) -> str:
    """Table of what single cases must keep besides."""
    rows = [[f"`{r.case.name}`", r.case.promise, share_text(r.margins[OWN])] for r in results if r.case.own]
    return table(["case", OWN, "share"], rows)


def catalogue(results: Sequence[Result]) -> str:
    """Table of all cases: the worst error of each invariant as a share of what is allowed."""
    rows = []
    for result in results:
        shares = [share_text(result.margins[name]) for name in COLUMNS]
        rows.append([f"`{result.case.name}`", result.case.setup, *shares, "no" if result.broken else "yes"])
    return table(["case", "how it is set up", *COLUMNS, "kept"], rows)


def precision(stages: Sequence[Worst]) -> str:
    """Table of the worst that each stage's search found."""
    rows = []
    for worst in stages:
        parameters = ", ".join(f"{name} {value:.3g}" for name, value in worst.parameters.items() if name != "seed")
        found = worst.found
        error, noise, share = f"{found.error_e:.2g}", f"{found.noise_e:.3g}", f"{found.share_of_noise:.1g}"
        rows.append([worst.stage.name, parameters, error, noise, share, worst.stage.bound, share_text(worst.bound)])
    return table(["stage", "worst parameters", "error [e⁻]", "noise [e⁻]", "share", "bound", "share of it"], rows)


def share_text(margin: Margin | None) -> str:
    """Share of what is allowed, to two digits; a dash where the invariant says nothing."""
    if margin is None:
        return "–"
    text = f"{margin.share:.2g}" if margin.share < 1000 else f"{margin.share:.0e}"
    return text if margin.kept else f"**{text}**"


def table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Markdown table."""
    return "\n".join("| " + " | ".join(line) + " |" for line in [head, ["---"] * len(head), *rows])


if __name__ == "__main__":
    sys.exit(main())
