"""The catalogue of hard cases as a page of Markdown, and as JSON."""

from collections.abc import Mapping, Sequence
from typing import Any

from studies.stress import INVARIANTS, LIMITS, OWN, Result
from studies.stress_case import Margin
from studies.stress_precision import Worst

COLUMNS = (*INVARIANTS, OWN)
WORDS = {name: (measure.__doc__ or "").splitlines()[0] for name, measure in INVARIANTS.items()}


INTRODUCTION = """# Hard cases

`rodcone stress` takes each case through the whole chain, from radiance to expected electrons, a raw image, and the
pictures of the interleaved and the Bayer camera, and measures how far it is from breaking each invariant. `--case NAME`
runs one, `--json` prints every number, and the command fails for anything that isn't kept and isn't listed below as a
limit. The scene is `cornell_box` at 64 × 64 pixels, rendered once and lit anew, the camera `low_noise` with an RGBW and
a Bayer mosaic, 10 ms, unless a case says otherwise.
"""

MEANING = """Numbers are the worst error found as a share of what is allowed: up to 1 it is kept. A dash: the
invariant says nothing about the case. What is allowed is 10⁻⁶ of a pixel's expected electrons for the invariants of
electrons; for bias the mean of 32 raw images or 12 pictures, each with a chip of its own, at a false-alarm rate of 10⁻⁶
(a thirtieth of a sample's noise in the mean of a letter, and up to a fifth in a picture); for mirrored and cut pictures
what the arithmetic's rounding makes of the samples."""


PRECISION = """Where stages run in single precision, the same arithmetic in double precision stands beside it. A search
of {tried} places a stage, first at random, then by steps from the worst one, looks for the largest error beside the
sensor's noise: the least that a sensor can have, shot noise and the dark noise that the place says. Bounds are counted
roundings, u = 2⁻²⁴ of the number that is rounded; the last column is the nearest that any place came to its bound."""


def page(results: Sequence[Result], stages: Sequence[Worst] = ()) -> str:
    """The whole page; `stages` may be left out."""
    invariants = "\n".join(f"- **{name}**: {words}" for name, words in WORDS.items())
    return (
        "\n\n".join(
            [
                INTRODUCTION.strip(),
                summary(results),
                "## What must be kept",
                invariants,
                MEANING,
                "## Limits",
                "What isn't kept, by how much, and why. `tests/hard` holds this list to be exact.",
                limits(results),
                "## Kept by single cases besides",
                promises(results),
                "## All cases",
                catalogue(results),
                *(["## Single against double precision", PRECISION.format(tried=stages[0].tried)] if stages else []),
                *([precision(stages)] if stages else []),
            ]
        )
        + "\n"
    )


def precision(stages: Sequence[Worst]) -> str:
    """Table of the worst place of each stage."""
    rows = []
    for worst in stages:
        place = ", ".join(f"{name} {value:.3g}" for name, value in worst.place.items() if name != "seed")
        error, noise = f"{worst.found.error_e:.2g}", f"{worst.found.noise_e:.3g}"
        share = f"{worst.found.share_of_noise:.1g}"
        rows.append([worst.stage.name, place, error, noise, share, worst.stage.bound, share_text(worst.bound)])
    return table(["stage", "worst place", "error [e⁻]", "noise [e⁻]", "share", "bound", "share of it"], rows)


def share_text(margin: Margin | None) -> str:
    """Share of what is allowed, to two digits; a dash where the invariant says nothing."""
    if margin is None:
        return "–"
    text = f"{margin.share:.2g}" if margin.share < 1000 else f"{margin.share:.0e}"
    return text if margin.kept else f"**{text}**"


def catalogue(results: Sequence[Result]) -> str:
    """Table of all cases: the worst error of each invariant as a share of what is allowed."""
    head = ["case", "how it is set up", *COLUMNS, "kept"]
    rows = [
        [
            f"`{result.case.name}`",
            result.case.setup,
            *(share_text(result.margins[name]) for name in COLUMNS),
            kept(result),
        ]
        for result in results
    ]
    return table(head, rows)


def kept(result: Result) -> str:
    """Yes, or no."""
    return "no" if result.broken else "yes"


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
            if margin is None:
                continue
            reason = LIMITS.get((result.case.name, name), "**unknown: a fault**")
            what = result.case.promise if name == OWN else name
            found = f"{margin.worst:.3g} {margin.unit}", f"{margin.allowed:.3g}"
            rows.append([f"`{result.case.name}`", what, *found, reason])
    return table(["case", "not kept", "worst", "allowed there", "why"], rows) if rows else "None."


def promises(results: Sequence[Result]) -> str:
    """Table of what cases must keep besides."""
    rows = [[f"`{r.case.name}`", r.case.promise, share_text(r.margins[OWN])] for r in results if r.case.own]
    return table(["case", OWN, "share"], rows) if rows else "None."


def table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Markdown table."""
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join("| " + " | ".join(cell.replace("|", "\\|") for cell in line) + " |" for line in lines)


def as_json(results: Sequence[Result], stages: Sequence[Worst] = ()) -> dict[str, Any]:
    """Everything measured, as plain values; an infinite share is null."""
    return {
        "cases": [
            {
                "name": result.case.name,
                "setup": result.case.setup,
                "kept": not result.broken,
                "invariants": {
                    name: _margin_json(result.case.promise if name == OWN else WORDS[name], margin)
                    for name, margin in result.margins.items()
                    if margin is not None
                },
            }
            for result in results
        ],
        "single_precision": [
            {
                "stage": worst.stage.name,
                "place": dict(worst.place),
                "error_e": worst.found.error_e,
                "noise_e": worst.found.noise_e,
                "bound": _margin_json(worst.stage.bound, worst.bound),
            }
            for worst in stages
        ],
    }


def _margin_json(words: str, margin: Margin) -> Mapping[str, Any]:
    return {
        "says": words,
        "worst": margin.worst if margin.worst < float("inf") else None,
        "allowed": margin.allowed,
        "unit": margin.unit,
        "share": margin.share if margin.share < float("inf") else None,
        "kept": margin.kept,
    }
