"""The command `rodcone stress`."""

import json as notation
import sys
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter


def stress(
    *,
    case: Annotated[list[str] | None, Parameter(negative_iterable=())] = None,
    out: Annotated[Path, Parameter(name=["--out", "-o"])] = Path("out/stress"),
    json: Annotated[bool, Parameter(negative="")] = False,
) -> int:
    """Put hard cases through the whole chain and measure by what margin each invariant is kept; exit 1 for a fault.

    Prints the table of cases and writes the page hard_cases.md.

    Parameters
    ----------
    case
        Case by name, such as sun_glint; may be given several times (all of them, and the search for the worst of
        single precision, by default).
    out
        Folder for hard_cases.md.
    json
        Print every margin as one JSON object instead of the table.
    """
    from rodcone.files import replacing
    from rodcone.jit import backend
    from rodcone.progress import progress
    from studies.stress import choose, run_cases, unexpected
    from studies.stress_page import as_json, catalogue, page, summary
    from studies.stress_precision import run_stages
    from studies.stress_stages import STAGES

    cases = choose(case)
    out.mkdir(parents=True, exist_ok=True)  # a place that can't be written is told before the first case
    with progress(sys.stderr) as step:
        results = run_cases(cases, step)
        # NumPy's forms work in double precision throughout
        stages = [] if case or backend() == "numpy" else run_stages(STAGES, step)
    with replacing(out / "hard_cases.md") as (file,):
        file.write_text(page(results, stages), encoding="utf-8")
    if json:
        print(notation.dumps(as_json(results, stages), allow_nan=False))
    else:
        print(catalogue(results), summary(results), out / "hard_cases.md", sep="\n\n")
    faults = unexpected(results)
    for fault in faults:
        print(f"rodcone: {fault}", file=sys.stderr)
    return 1 if faults else 0
